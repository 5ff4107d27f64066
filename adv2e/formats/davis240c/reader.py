"""Recordings in the layout of the Event-Camera Dataset (DAVIS240C): a folder or its zip.

``events.txt`` (see :mod:`adv2e.formats.text.reader`) and, if there are frames, ``images.txt`` with
lines ``t name``, t in seconds.  A zip holds them at its root or in one folder.  A zip of a single
text file (as rpg_e2vid takes it) is read as text.

References
----------
.. [1] E. Mueggler et al., "The Event-Camera Dataset and Simulator", IJRR 2017,
   doi:10.1177/0278364917691115.
"""

from __future__ import annotations

import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path, PurePosixPath
from typing import IO, Any, Protocol

import numpy as np

from adv2e.errors import DataError
from adv2e.files.zips import open_member, zip_archive
from adv2e.formats.clock import Beside, Clock, disagreement
from adv2e.formats.gather import Gatherer
from adv2e.formats.recording import Recording, described_geometry, parse_description
from adv2e.formats.text.reader import Lines, gather_lines
from adv2e.sources.base import Pixels
from adv2e.sources.opencv import decode_image
from adv2e.sources.times.columns import has_lines
from adv2e.sources.times.lists import FrameList, decoded, parse_list
from adv2e.sources.times.names import found_outside, members_of, nowhere

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


def read_folder(
    path: Path, time_unit: str | None = None, *, images_anywhere: bool = False
) -> Recording:
    """Return the recording in a folder; `images_anywhere`: also those that lead out of it.

    Raises
    ------
    DataError
        No ``events.txt`` in it, a line that cannot be read, or an image that is listed is missing.
    """
    if not (path / EVENTS).is_file():
        raise DataError(f"{path}: no {EVENTS} in it; a folder must be a DAVIS240C recording")
    files = _Folder(path)
    outside = found_outside(path) if images_anywhere else nowhere
    return _read(files, path, EVENTS, lambda names: _images(files, names), time_unit, outside)


def read_zip(path: Path, time_unit: str | None = None) -> Recording:
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

        return _read(_Archive(path, archive, top), path, name, images, time_unit, nowhere)


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


def _read(
    files: _Files,
    path: Path,
    name: str,
    images: Any,
    time_unit: str | None,
    outside: Callable[[str], str | None],
) -> Recording:
    gatherer = Gatherer()
    description: dict[str, Any] = {}
    if files.has(DESCRIPTION):
        text = _text(files, DESCRIPTION, "replace")
        description = parse_description(text, files.label(DESCRIPTION), gatherer.problems)
    stated = "s" if description else None
    found = _listed(files, stated=stated)
    frames = None
    if found is not None and len(found.stamps) > 1:
        frames = Beside(found.unit, found.whole)
    with files.open(name) as file:
        clock = Clock(time_unit, stated, frames)
        lines = gather_lines(file, files.label(name), gatherer, clock)
    times, names = None, []
    if found is not None:
        if unit := _unit_beside(lines, found, clock):
            found = _listed(files, time_unit=unit) or found
        gatherer.problems += [f"{LIST}: {line}" for line in (found.unit.doubt, found.order) if line]
        names = members_of(found.stamps, files.label(LIST), files.has, outside=outside)
        times = np.array([stamp.t_ns for stamp in found.stamps], np.int64)
    geometry, whence = described_geometry(description), DESCRIPTION
    if geometry is None and names:
        first = next(iter(images(names[:1]))).image
        geometry, whence = (first.shape[1], first.shape[0]), names[0]
    if geometry is None:
        geometry, whence = lines.geometry, f"the first line of {name}"
    events, width, height = gatherer.finish(geometry, whence)
    gatherer.problems += disagreement(events, times)
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


def _listed(files: _Files, **evidence: Any) -> FrameList | None:
    """Return the list of frames, or None without frames."""
    if not files.has(LIST):
        return None
    label = files.label(LIST)
    with files.open(LIST) as file:
        text = decoded(file.read(), label)
    return parse_list(text, label, **evidence) if has_lines(text) else None


def _unit_beside(lines: Lines, found: FrameList, clock: Clock) -> str | None:
    """Return the unit of the frames that user or events say; None: the list itself tells."""
    if clock.given is not None:
        return clock.given_for_frames(whole=found.whole, events_whole=lines.whole)
    return lines.unit if lines.whole == found.whole and clock.beside is None else None


def _images(files: _Files, names: list[str]) -> Iterator[Pixels]:
    for name in names:
        with files.open(name) as file:
            yield decode_image(file.read(), files.label(name))
