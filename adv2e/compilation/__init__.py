"""How compiled code is kept between runs."""
