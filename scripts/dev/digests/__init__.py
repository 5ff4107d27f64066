"""Cases that ``event_digests.py`` makes digests of, and what tells two results apart."""
