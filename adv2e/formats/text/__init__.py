"""Events as text, one a line."""
