"""Effects between the pixel and the file."""
