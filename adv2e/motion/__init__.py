"""Motion between frames: how far each pixel goes, how its path bends, and where light is then."""
