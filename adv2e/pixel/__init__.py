"""The pixel array: its state, what moves it, and its events in order."""
