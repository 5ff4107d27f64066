"""Inspection of a file: its content as one dictionary, and as text for people."""
