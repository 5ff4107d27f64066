"""Timestamps of frames: lists, names, rates, units and gaps."""
