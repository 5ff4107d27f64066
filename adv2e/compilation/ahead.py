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

Part = tuple[str, str, tuple[Any, ...]]
"""Module and name of a compiled function, and types of its arguments."""

_HOME = str(Path(__file__).resolve().parents[2])


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
    path = [place for place in sys.path if place not in ("", ".")]
    path += [] if _HOME in path else [_HOME]  # last: nothing in it can stand for another module
    # until the path is set nothing is imported but `sys`, which is no file
    code = f"import sys; sys.path[:] = {path!a}; from adv2e.compilation import ahead; ahead.main()"
    isolated = ["-I"] if sys.flags.isolated else []
    try:
        process = subprocess.Popen(
            [sys.executable, *isolated, "-c", code],
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
