"""Parts of a solver compiled by a second process, while this one compiles the others.

Numba compiles in one thread at a time.  The second process leaves the code of its parts in the
cache, where this one finds them.  Whatever goes wrong with it, this one compiles them itself.
"""

from __future__ import annotations

import pickle
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from importlib import import_module
from pathlib import Path
from typing import Any

from adv2e.process import python_command

Part = tuple[str, str, tuple[Any, ...]]
"""Module and name of a compiled function, and types of its arguments."""


@contextmanager
def compiled_beside(parts: Sequence[Part]) -> Iterator[None]:
    """Have a second process compile parts during the block, at whose end they are waited for."""
    process = _started(pickle.dumps(parts))
    try:
        yield
    except BaseException:
        if process is not None:
            process.kill()
        raise
    finally:
        if process is not None:
            process.wait()


def _started(told: bytes) -> subprocess.Popen[bytes] | None:
    """Return the process that compiles; None: it could not be started."""
    if "python" not in Path(sys.executable or "").name.lower():
        return None  # a program that holds Python: to start it may do anything
    try:
        process = subprocess.Popen(
            python_command("from adv2e.compilation import ahead; ahead.main()"),
            stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )  # fmt: skip
    except OSError:
        return None
    with suppress(OSError), process.stdin:  # type: ignore[union-attr]
        process.stdin.write(told)  # type: ignore[union-attr]
    return process


def main() -> None:
    """Compile the parts that standard input tells, by a parent of the same program."""
    for module, name, types in pickle.load(sys.stdin.buffer):
        getattr(import_module(module), name).dispatcher.compile(types)
