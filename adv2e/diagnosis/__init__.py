"""Diagnosis of recordings: residual, missing effect, and a configuration that explains both."""
