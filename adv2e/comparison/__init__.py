"""Comparison of two event streams: distances, statistics of each, and noise floors."""
