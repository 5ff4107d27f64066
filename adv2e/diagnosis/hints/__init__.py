"""What can be read off a recording, so that fits start near the truth."""
