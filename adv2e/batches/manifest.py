"""Manifest of a batch, ``manifest.jsonl``: sources and outputs, a line for each step, append-only.

Each line is one JSON object and is on the disk before the next step begins.  A line that was torn,
because the machine stopped while it was written, is cut off when the file is opened the next time.
Only one process writes a manifest: it holds a lock on it, which the system lets go of however that
process ends.

The folder may come from elsewhere, and the file with it.  No name in it says what is written or
removed; a line counts only if all in it has the form that a batch gives it.

Each shard of a batch has a manifest of its own, ``manifest-2-of-8.jsonl``, so that several machines
never write one file.  What was done is what all of them in a folder say, later lines first.
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterator, Mapping
from datetime import datetime, timezone
from pathlib import Path, PurePath, PurePosixPath
from typing import Any, BinaryIO

from adv2e.errors import DataError, OutputError
from adv2e.files.regular import check_ends
from adv2e.files.workspace import lock_file, sync_one, unlock_file

_FORM: dict[str, type] = {
    **dict.fromkeys(("name", "status", "at", "adv2e", "settings", "output"), str),
    **dict.fromkeys(("source_sha256", "sha256"), str),
    **dict.fromkeys(("source", "beside", "export"), dict),
    "seed": int,
}
_ALWAYS = {"name", "status", "at"}
_DONE = _FORM.keys() - {"beside", "export"}

_ANY = "manifest*.jsonl"
_SHARD = re.compile(r"manifest(?:-[0-9]+-of-([0-9]+))?\.jsonl")


def manifest_path(dest: Path, shard: tuple[int, int] | None) -> Path:
    """Return the manifest of a batch, or of one of its shards (I, N)."""
    return dest / (
        "manifest.jsonl" if shard is None else f"manifest-{shard[0]}-of-{shard[1]}.jsonl"
    )


def read_records(dest: Path) -> dict[str, dict[str, Any]]:
    """Return the last line of each sequence in all manifests of a folder, by its name.

    A line that is being written, or was torn, does not count.

    Raises
    ------
    DataError
        Another line is no such object.
    """
    lines: list[tuple[str, int, dict[str, Any]]] = []
    for path in sorted(dest.glob(_ANY)):
        check_ends(path)
        with path.open("rb") as file:
            lines += [(one["at"], n, one) for n, one in enumerate(_lines(path, file))]
    return {one["name"]: one for _, _, one in sorted(lines, key=lambda line: line[:2])}


def check_alone(own: Path) -> None:
    """Raise OutputError if another batch works on the same sequences, in the folder of `own`.

    Shards of the same number work side by side.
    """
    for path in own.parent.glob(_ANY):
        same = _count(path) == _count(own) != ""
        if path == own or same:
            continue
        check_ends(path, OutputError)
        with path.open("r+b") as file:
            if not lock_file(file, wait=False):
                raise OutputError(f"{path}: another batch writes here: wait for it, or end it")
            unlock_file(file)


def _count(path: Path) -> str:
    found = _SHARD.fullmatch(path.name)
    return (found[1] or "") if found else ""


class Manifest:
    """The manifest in a folder, open for more.

    Parameters
    ----------
    path : Path
        The file; it and its folder are made if they are missing.

    Raises
    ------
    OutputError
        Another process writes it, it is a link, or it cannot be written.
    DataError
        A line before the last is no such object.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        path.parent.mkdir(parents=True, exist_ok=True)
        if path.is_symlink():
            raise OutputError(f"{path}: is a link, and must be a file: remove it")
        check_ends(path, OutputError)
        # not buffered: what could not be written would be tried again when it is closed
        self._file = path.open("a+b", buffering=0)
        try:
            if not lock_file(self._file, wait=False):
                raise OutputError(f"{path}: another batch writes here: wait for it, or end it")
            self._cut()
            sync_one(path.parent)  # its own name
        except BaseException:
            self._file.close()
            raise

    def __enter__(self) -> Manifest:
        return self

    def __exit__(self, *_: object) -> None:
        unlock_file(self._file)
        self._file.close()

    def add(self, record: Mapping[str, Any]) -> None:
        """Append a line; it is on the disk when this returns.

        Raises
        ------
        OSError
            It is not: what was written of it is cut off again.
        """
        now = datetime.now(timezone.utc).isoformat(timespec="microseconds")
        line = json.dumps({**record, "at": now}, ensure_ascii=True, allow_nan=False) + "\n"
        end = self._file.seek(0, os.SEEK_END)
        try:
            rest = line.encode("ascii")
            while rest:
                rest = rest[self._file.write(rest) :]
            os.fsync(self._file.fileno())
        except OSError:
            self._file.truncate(end)
            raise

    def _cut(self) -> None:
        self._file.seek(0)
        for _ in _lines(self.path, self._file):
            pass
        self._file.seek(0)
        whole = sum(len(line) for line in self._file if line.endswith(b"\n"))
        self._file.truncate(whole)


def _lines(path: Path, file: BinaryIO) -> Iterator[dict[str, Any]]:
    for number, line in enumerate(file, start=1):
        record = _record(line)
        if record is not None:
            yield record
        elif line.endswith(b"\n"):
            raise DataError(f"{path}:{number}: is no line of a manifest: mend or remove it")


def _record(line: bytes) -> dict[str, Any] | None:
    """Return the record of a line; None: it is torn, or no line of a manifest."""
    if not line.endswith(b"\n"):
        return None
    try:
        record = json.loads(line)
    except (ValueError, RecursionError):
        return None
    if not isinstance(record, dict):
        return None
    if any(not isinstance(record[key], kind) for key, kind in _FORM.items() if key in record):
        return None
    if not (_DONE if record.get("status") == "done" else _ALWAYS) <= record.keys():
        return None
    below = PurePosixPath(record["name"])
    inside = not below.is_absolute() and ".." not in below.parts
    beside = all(PurePath(name).name == name for name in record.get("beside", ()))
    return record if inside and beside else None
