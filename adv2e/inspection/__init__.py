"""What a file holds: ``events.py`` for events, ``frames.py`` for frames, ``report.py`` for both."""
