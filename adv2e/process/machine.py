"""Limits of the machine: errors of libraries for lack of memory or threads.

Under ``ulimit -v`` or in a container, libraries cannot be loaded, threads not started and arrays
not made; the input is not to blame for that, nor a bug.
"""

from __future__ import annotations

import errno
import re

_SIGNS = re.compile(
    r"failed to map segment|cannot allocate memory|can't start new thread|bad_alloc"
    r"|insufficient memory|failed to allocate|out of memory|unable to allocate"
    # llvmlite names no reason; the file is there, as it is installed with it
    r"|could not find/load shared object file",
    re.IGNORECASE,
)


def machine_complaint(error: BaseException) -> str:
    """Return the message for an exception that the machine's limits caused, or ""."""
    told = " ".join(str(error).split())
    of_limits = isinstance(error, MemoryError) or (
        isinstance(error, OSError) and error.errno in (errno.ENOMEM, errno.EAGAIN)
    )
    found = _SIGNS.search(told)
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
