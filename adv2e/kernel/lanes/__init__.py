"""Pixels that may fire, solved side by side from event to event."""
