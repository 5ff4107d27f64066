"""Effects that may be missing, and the fits of their parameters by simulation."""
