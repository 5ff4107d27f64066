"""Standard error for ourselves: what libraries print about a file is not for users.

Decoders write there past Python, in lines that name no file and follow no setting; ours is the one
line that people see.
"""

from __future__ import annotations

import faulthandler
import io
import os
import sys
from contextlib import suppress
from typing import BinaryIO, cast

_descriptor = 2


def errors_descriptor() -> int:
    """Return the descriptor of standard error."""
    return _descriptor


def keep_errors_for_ourselves() -> None:
    """Let Python alone write to standard error from now on, in this process.

    Nothing changes where there is no standard error, or where whoever looks for a fault wants to
    see all (``python -X faulthandler``, ``-X dev``).
    """
    global _descriptor  # noqa: PLW0603 - a process has one
    if sys.stderr is None or faulthandler.is_enabled():
        return
    with suppress(OSError, ValueError):
        sys.stderr.flush()
        kept = os.dup(sys.stderr.fileno())
        nothing = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nothing, 2, inheritable=True)
        os.close(nothing)
        encoding = sys.stderr.encoding
        # nothing may stay in a buffer: where it cannot be written, the end would try again and fail
        unbuffered = open(kept, "wb", 0)  # noqa: PTH123, SIM115
        sys.stderr = io.TextIOWrapper(
            cast(BinaryIO, unbuffered), encoding, "backslashreplace", write_through=True
        )
        _descriptor = kept
