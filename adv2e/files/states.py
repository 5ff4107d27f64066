"""Identity and change of files: size and time at a glance, SHA-256 for certain."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from adv2e.errors import OutputError
from adv2e.files.regular import check_ends

_BLOCK = 1 << 20


@dataclass(frozen=True)
class State:
    """Size, number of files and time of change of a file or folder.

    Attributes
    ----------
    bytes : int
        Size of all files.
    files : int
        Number of files.
    changed_ns : int
        Time of the last change of any file.
    """

    bytes: int
    files: int
    changed_ns: int

    def is_alike(self, other: State) -> bool:
        """Tell whether both may be the same, seen from two machines, which may round times."""
        return (self.bytes, self.files) == (other.bytes, other.files)


def state_of(path: Path) -> State:
    found = [file.stat() for _, file in _files(path)]
    return State(
        sum(one.st_size for one in found),
        len(found),
        max((one.st_mtime_ns for one in found), default=0),
    )


def digest_of(path: Path) -> str:
    """Return the SHA-256 of a file, or of the names and contents of all files below a folder.

    Raises
    ------
    DataError
        One is a pipe, a device or a socket.
    """
    total = hashlib.sha256()
    for name, file in _files(path):
        own = hashlib.sha256()
        check_ends(file)
        with file.open("rb") as opened:
            while block := opened.read(_BLOCK):
                own.update(block)
        if not name:
            return own.hexdigest()
        # the digests are of one length, so that no name can pass for a content
        total.update(own.digest() + os.fsencode(name) + b"\0")
    return total.hexdigest()


def digest_of_values(*values: Any) -> str:
    """Return the SHA-256 of values that can be written as JSON."""
    text = json.dumps(values, sort_keys=True, ensure_ascii=True, allow_nan=False)
    return hashlib.sha256(text.encode("ascii")).hexdigest()


def _files(path: Path) -> Iterator[tuple[str, Path]]:
    """Yield name and path of each file, sorted by name; the name of a single file is empty."""
    if not path.is_dir():
        yield "", path
        return
    for place, folders, files in os.walk(path):
        folders.sort()
        here = Path(place)
        for file in sorted(files):
            yield (here / file).relative_to(path).as_posix(), here / file


# ---- Outputs and inputs are to be different files, by whatever names they go.


def check_distinct(output: str | Path, inputs: Iterable[str | Path]) -> None:
    """Refuse to write where something is read from, whether it may be replaced or not.

    Parameters
    ----------
    inputs : iterable of str or Path
        All files that are read, and folders; names of nothing do not matter.

    Raises
    ------
    OutputError
        `output` is one of them, or a folder that holds one.
    """
    final = Path(output)
    if not os.path.lexists(final):
        return
    within = final.resolve() if final.is_dir() else None
    for one in map(Path, inputs):
        if are_one(final, one):
            raise OutputError(f"{output}: is read and would be lost; choose another name")
        if within is not None and within in one.resolve().parents and one.exists():
            raise OutputError(f"{output}: holds the input {one}; choose another name")


def are_one(one: Path, other: Path) -> bool:
    """Tell whether two names lead to one file, also where upper and lower case are the same."""
    if os.path.normcase(one) == os.path.normcase(other):
        return True
    try:
        return one.samefile(other)
    except OSError:
        return False
