"""From a source to a finished output: reading, simulating and writing at the same time."""
