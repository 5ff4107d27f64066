"""Verdict of a search, with its errors, findings and pictures for the report."""
