"""The experiments by which simulators of event cameras are judged, one command a module."""
