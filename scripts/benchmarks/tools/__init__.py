"""One module a tool, imported only where it is run.

Each has ``simulator(options)``, which returns a function of (frames, fps) that returns events in
whatever form the tool gives them, and ``columns(events)``, which turns these into int64 times [us],
columns, rows and polarities (1 or 0).
"""
