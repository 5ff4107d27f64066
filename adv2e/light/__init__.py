"""Light at the pixel's instants: decoded from the frames' numbers and interpolated between them."""
