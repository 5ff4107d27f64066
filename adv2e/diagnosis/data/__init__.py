"""The recording that is diagnosed: what is in it, how it is divided, what looks wrong in it."""
