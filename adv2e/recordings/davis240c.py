"""Recordings in the layout of the Event-Camera Dataset (DAVIS240C): a folder or its zip.

``events.txt`` (see :mod:`adv2e.recordings.text`) and, if there are frames, ``images.txt`` with
lines ``t name``, t in seconds.  A zip holds them at its root or in one folder.  A zip of a single
text file (as rpg_e2vid takes it) is read as text.

References
----------
.. [1] E. Mueggler et al., "The Event-Camera Dataset and Simulator", IJRR 2017,
   doi:10.1177/0278364917691115.
"""

from __future__ import annotations

import zipfile
from collections.abc import Iterator
from pathlib import Path, PurePosixPath
from typing import IO, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from adv2e.errors import DataError
from adv2e.recordings.base import Recording, described_geometry, parse_description
from adv2e.recordings.gather import Gatherer
from adv2e.recordings.text import gather_lines
from adv2e.sources.base import Pixels
from adv2e.sources.opencv import decode_image
from adv2e.sources.times import parse_list
from adv2e.zips import open_member, zip_archive

EVENTS, LIST, DESCRIPTION = "events.txt", "images.txt", "adv2e.json"


class _Files(Protocol):
    """The files of a recording, wherever they lie."""

    def has(self, name: str) -> bool: ...

    def label(self, name: str) -> str: ...

    def open(self, name: str) -> IO[bytes]: ...


class _Folder:
    """Files in a folder."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def has(self, name: str) -> bool:
        return (self._path / name).is_file()

    def label(self, name: str) -> str:
        return str(self._path / name)

    def open(self, name: str) -> IO[bytes]:
        return (self._path / name).open("rb")


class _Archive:
    """Members of an open zip, below its one folder if there is one."""

    def __init__(self, path: Path, archive: zipfile.ZipFile, top: str) -> None:
        self._path, self._archive, self._top = path, archive, top
        self._names = set(archive.namelist())

    def has(self, name: str) -> bool:
        return self._top + name in self._names

    def label(self, name: str) -> str:
        return f"{self._path}: {self._top}{name}"

    def open(self, name: str) -> IO[bytes]:
        return open_member(self._archive, self._top + name)


def read_folder(path: Path) -> Recording:
    """Return the recording in a folder.

    Raises
    ------
    DataError
        No ``events.txt`` in it, a line that cannot be read, or an image that is listed is missing.
    """
    if not (path / EVENTS).is_file():
        raise DataError(f"{path}: no {EVENTS} in it; a folder must be a DAVIS240C recording")
    files = _Folder(path)
    return _read(files, path, EVENTS, lambda names: _images(files, names))


def read_zip(path: Path) -> Recording:
    """Return the recording in a zip archive.

    Raises
    ------
    DataError
        As :func:`read_folder`; or not a zip archive, or damaged.
    """
    with zip_archive(path) as archive:
        top, name = _events_member(path, archive)

        def images(names: list[str]) -> Iterator[Pixels]:
            with zip_archive(path) as again:
                yield from _images(_Archive(path, again, top), names)

        return _read(_Archive(path, archive, top), path, name, images)


def _events_member(path: Path, archive: zipfile.ZipFile) -> tuple[str, str]:
    """Return (its folder with a slash or "", name) of the member with the events."""
    names = [name for name in archive.namelist() if not name.startswith("__MACOSX/")]
    shallow = [PurePosixPath(name) for name in names if len(PurePosixPath(name).parts) <= 2]
    found = [name for name in shallow if name.name == EVENTS]
    if not found:
        found = [name for name in shallow if name.suffix == ".txt"]
    if len(found) != 1:
        raise DataError(
            f"{path}: must hold one {EVENTS}, at its root or in one folder, or a single text file"
        )
    top = "" if len(found[0].parts) == 1 else f"{found[0].parent}/"
    return top, found[0].name


def _read(files: _Files, path: Path, name: str, images: Any) -> Recording:
    gatherer = Gatherer()
    description: dict[str, Any] = {}
    if files.has(DESCRIPTION):
        text = _text(files, DESCRIPTION, "replace")
        description = parse_description(text, files.label(DESCRIPTION), gatherer.problems)
    with files.open(name) as file:
        header = gather_lines(file, files.label(name), gatherer)
    times, names = _listed(files, gatherer.problems)
    geometry, whence = described_geometry(description), DESCRIPTION
    if geometry is None and names:
        first = next(iter(images(names[:1]))).image
        geometry, whence = (first.shape[1], first.shape[0]), names[0]
    if geometry is None:
        geometry, whence = header, f"the first line of {name}"
    events, width, height = gatherer.finish(geometry, whence)
    return Recording(
        str(path),
        "davis240c" if name == EVENTS else "text",
        width,
        height,
        events,
        times,
        description,
        gatherer.problems,
        lambda: images(names),
    )


def _text(files: _Files, name: str, errors: str) -> str:
    with files.open(name) as file:
        return file.read().decode("utf-8-sig", errors)


def _listed(files: _Files, problems: list[str]) -> tuple[NDArray[np.int64] | None, list[str]]:
    """Return times [ns], or None without frames, and names of the frames.

    What is to be told of them is added to `problems`.
    """
    if not files.has(LIST):
        return None, []
    text, label = _text(files, LIST, "backslashreplace"), files.label(LIST)
    if not any(line.strip() and not line.strip().startswith("#") for line in text.splitlines()):
        return None, []
    stamps, unit = parse_list(text, label)
    if unit:
        problems.append(f"{LIST}: {unit}")
    for stamp in stamps:
        if stamp.name is None:
            raise DataError(f"{label} line {stamp.line}: must be 'time name', the name is missing")
        if not files.has(stamp.name):
            raise DataError(f"{label} line {stamp.line}: no image {stamp.name}")
    times = np.array([stamp.t_ns for stamp in stamps], np.int64)
    return times, [stamp.name for stamp in stamps if stamp.name is not None]


def _images(files: _Files, names: list[str]) -> Iterator[Pixels]:
    for name in names:
        with files.open(name) as file:
            yield decode_image(file.read(), files.label(name))
