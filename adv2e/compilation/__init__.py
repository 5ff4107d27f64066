"""Compiled code: how it is made by Numba, and where it is kept."""
