"""Parts of ``scripts/compare_real.py`` and ``scripts/diagnose_real.py``."""
