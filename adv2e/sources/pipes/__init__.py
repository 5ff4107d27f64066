"""Frames that come through standard input, uncompressed: Y4M, and raw video of a stated layout."""
