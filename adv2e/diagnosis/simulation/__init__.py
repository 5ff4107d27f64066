"""Simulations of a recording's own frames: what of it can be simulated, and how, many at a time."""
