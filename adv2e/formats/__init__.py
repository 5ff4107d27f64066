"""Event files: one package or module a format, reading and writing side by side."""
