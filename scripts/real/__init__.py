"""Parts of ``scripts/real/compare.py`` and ``scripts/real/diagnose.py``."""
