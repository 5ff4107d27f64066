"""Memory of the whole process: what a command sets, and a library never.

The allocator of glibc learns: once a large array has been freed, arrays of that size, up to 32 MB,
come from its heaps, where they leave holes that nothing else fills.  A process that makes large
arrays of changing sizes, one after the other, then holds a good deal more than it uses.

References
----------
.. [1] mallopt(3), M_MMAP_THRESHOLD: "dynamic mmap threshold".
"""

from __future__ import annotations

import ctypes
import gc
from contextlib import suppress

LARGE_BYTES = 1 << 20
"""Blocks from this size on are given back as soon as they are freed."""

_MMAP_THRESHOLD = -3  # of <malloc.h>


def return_large_blocks() -> None:
    """Have the system take large blocks back as soon as they are freed, from now on.

    Holds for the whole process.  Does nothing where the C library has no such setting.
    """
    with suppress(OSError, AttributeError, TypeError):  # TypeError: Windows knows no nameless one
        ctypes.CDLL(None).mallopt(_MMAP_THRESHOLD, LARGE_BYTES)


def collect_seldom() -> tuple[int, int, int]:
    """Look for cycles among many objects at a time only; return the thresholds that were.

    Imports make tens of thousands of objects that stay, and compiling a million; looking through
    them again and again takes longer than a short run may.
    """
    before = gc.get_threshold()
    gc.set_threshold(200_000, 20, 20)
    return before
