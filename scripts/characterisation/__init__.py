"""Reading published measurements, for the scripts that characterise them."""
