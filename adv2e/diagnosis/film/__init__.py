"""Recordings of a known film: what of the scene is not known is fitted, apart from the camera."""
