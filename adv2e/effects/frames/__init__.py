"""Effects on the frames, before the pixel sees them."""
