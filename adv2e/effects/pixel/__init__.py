"""Effects inside the pixel, in signal order."""
