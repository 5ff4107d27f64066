"""Files read with care and written so that a final name only ever holds finished work."""
