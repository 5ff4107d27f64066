"""When Python looks for cycles among its objects."""

from __future__ import annotations

import gc


def collect_seldom() -> tuple[int, int, int]:
    """Look for cycles among many objects at a time only; return the thresholds that were.

    Imports make tens of thousands of objects that stay, and compiling a million; looking through
    them again and again takes longer than a short run may.
    """
    before = gc.get_threshold()
    gc.set_threshold(200_000, 20, 20)
    return before
