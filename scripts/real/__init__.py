"""Parts of ``scripts/compare_real.py``: recordings, thresholds that match totals, the table."""
