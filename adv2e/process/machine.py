"""Limits of the machine: errors for lack of memory or threads, and the memory of the process.

Under ``ulimit -v`` or in a container, libraries cannot be loaded, threads not started and arrays
not made; the input is not to blame for that, nor a bug.
"""

from __future__ import annotations

import ctypes
import errno
import re
from contextlib import suppress

from adv2e.errors import one_line

_SIGNS = re.compile(
    r"failed to map segment|cannot allocate memory|can't start new thread|bad_alloc"
    r"|insufficient memory|failed to allocate|out of memory|unable to allocate"
    # llvmlite names no reason; the file is there, as it is installed with it
    r"|could not find/load shared object file",
    re.IGNORECASE,
)


def machine_complaint(error: BaseException) -> str:
    """Return the message for an exception that the machine's limits caused, or ""."""
    told = one_line(error)
    of_limits = isinstance(error, MemoryError) or (
        isinstance(error, OSError) and error.errno in (errno.ENOMEM, errno.EAGAIN)
    )
    found = _SIGNS.search(told)
    if isinstance(error, ModuleNotFoundError) and (error.name or "").partition(".")[0] == "adv2e":
        # Python takes a file whose state it could not read for one that is not there
        missing = f"to load {error.name}, or adv2e is not installed whole"
        return f"not enough memory (see ulimit -v) {missing}"
    if not of_limits and not (
        found and isinstance(error, (ImportError, OSError, RuntimeError, SystemError))
    ):
        return ""
    if "thread" in told:
        return f"the machine starts no more threads (see ulimit -u, or --threads 1): {told}"
    if "llvmlite" in told:  # where it is missing, that is all it says, too
        return "not enough memory (see ulimit -v) to load llvmlite, or it is not installed whole"
    # NumPy's advice is a page long, and its reason last
    reason = told.rpartition("Original error was: ")[2] if found else told
    return "not enough memory (see ulimit -v)" + (f": {reason}" if reason else "")


# ---- Memory of the whole process: what a command sets, and a library never.
#
# The allocator of glibc learns: once a large array has been freed, arrays of that size, up to 32
# MB, come from its heaps, where they leave holes that nothing else fills. A process that makes
# large arrays of changing sizes, one after the other, then holds a good deal more than it uses.
#
# References
# ----------
# .. [1] mallopt(3), M_MMAP_THRESHOLD: "dynamic mmap threshold".


LARGE_BYTES = 1 << 20
"""Blocks from this size on are given back as soon as they are freed."""

_MMAP_THRESHOLD = -3  # of <malloc.h>


def return_large_blocks() -> None:
    """Have the system take large blocks back as soon as they are freed, from now on.

    Holds for the whole process.  Does nothing where the C library has no such setting.
    """
    with suppress(OSError, AttributeError, TypeError):  # TypeError: Windows knows no nameless one
        ctypes.CDLL(None).mallopt(_MMAP_THRESHOLD, LARGE_BYTES)
