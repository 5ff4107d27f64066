"""One line of JSON a case, in files that several processes may add to."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

Line = dict[str, Any]
"""A finished case; see :func:`studies.run.diagnosed`."""

ENDING = ".jsonl"


def append(path: Path, line: Line) -> None:
    """Add a line to a file, by one write, and see it to the disk.

    After a line that was cut off by an interruption a new one is begun.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    text = (json.dumps(line, sort_keys=True) + "\n").encode()
    handle = os.open(path, os.O_RDWR | os.O_CREAT | os.O_APPEND, 0o644)
    try:
        size = os.fstat(handle).st_size
        os.lseek(handle, max(size - 1, 0), os.SEEK_SET)
        whole = size == 0 or os.read(handle, 1) == b"\n"
        os.write(handle, text if whole else b"\n" + text)
        os.fsync(handle)
    finally:
        os.close(handle)


def read(folder: Path) -> list[Line]:
    """Return the whole lines of all files in a folder; what was cut off is left out."""
    return [line for path in sorted(folder.glob(f"*{ENDING}")) for line in _lines(path)]


def _lines(path: Path) -> Iterator[Line]:
    for text in path.read_text("utf-8").splitlines():
        try:
            line = json.loads(text)
        except json.JSONDecodeError:  # cut off
            continue
        if isinstance(line, dict):
            yield line


def identity(line: Line) -> tuple[str, ...]:
    """Return what makes two lines the same work: case, seed, setup and commit."""
    setup = json.dumps(line["setup"], sort_keys=True)
    return line["key"], str(line["study_seed"]), setup, line["commit"]


def finished(lines: Sequence[Line]) -> set[tuple[str, ...]]:
    """Return the work that is done; what failed is to be done again."""
    return {identity(line) for line in lines if "failed" not in line}


def latest(lines: Sequence[Line]) -> list[Line]:
    """Return one line for each work: what succeeded, else the last failure."""
    held: dict[tuple[str, ...], Line] = {}
    for line in lines:
        if "failed" in held.get(identity(line), {"failed": ""}):
            held[identity(line)] = line
    return list(held.values())
