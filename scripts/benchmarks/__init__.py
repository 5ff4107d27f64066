"""Benchmarks, and the clips, fresh processes and tables that they share."""
