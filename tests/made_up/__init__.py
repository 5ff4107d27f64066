"""Small scenes, streams and samplers for the tests of the diagnosis."""
