"""Real recordings: read, simulated, searched for effects; and what measurements say of pixels."""
