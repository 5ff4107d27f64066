"""Parts of ``fuzz_readers.py``."""
