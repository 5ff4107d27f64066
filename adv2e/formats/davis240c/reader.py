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
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import IO, Any

import numpy as np

from adv2e.errors import DataError
from adv2e.files.zips import open_member, zip_archive
from adv2e.formats.builder import RecordingBuilder
from adv2e.formats.recording import Recording
from adv2e.formats.text.reader import read_lines
from adv2e.sources.frame import Pixels
from adv2e.sources.images.opencv import decode_image
from adv2e.sources.times.columns import has_lines
from adv2e.sources.times.lists import FrameList, decoded, parse_list
from adv2e.sources.times.names import members_of

EVENTS, LIST, DESCRIPTION = "events.txt", "images.txt", "adv2e.json"


@dataclass(frozen=True)
class _Files:
    """The files of a recording, by their names in it, wherever they lie."""

    path: Path
    has: Callable[[str], bool]
    label: Callable[[str], str]
    open: Callable[[str], IO[bytes]]


def _in_folder(path: Path) -> _Files:
    return _Files(
        path,
        lambda name: (path / name).is_file(),
        lambda name: str(path / name),
        lambda name: (path / name).open("rb"),
    )


def _in_archive(path: Path, archive: zipfile.ZipFile, top: str) -> _Files:
    """Return the members of an open zip, below its one folder if there is one."""
    names = set(archive.namelist())
    return _Files(
        path,
        lambda name: top + name in names,
        lambda name: f"{path}: {top}{name}",
        lambda name: open_member(archive, top + name),
    )


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
    files = _in_folder(path)
    return _read(files, EVENTS, lambda names: _images(files, names), time_unit, images_anywhere)


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
                yield from _images(_in_archive(path, again, top), names)

        return _read(_in_archive(path, archive, top), name, images, time_unit)


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
    name: str,
    images: Callable[[list[str]], Iterator[Pixels]],
    time_unit: str | None,
    anywhere: bool = False,
) -> Recording:
    builder = RecordingBuilder(files.path, time_unit)
    if files.has(DESCRIPTION):
        with files.open(DESCRIPTION) as file:
            text = file.read().decode("utf-8-sig", "replace")
        builder.describe(text, files.label(DESCRIPTION), DESCRIPTION)
    found = _listed(files, stated=builder.stated_unit)
    if found is not None and len(found.stamps) > 1:
        builder.note_frames(found.unit, whole=found.whole)
    with files.open(name) as file:
        geometry = read_lines(file, files.label(name), builder)
    times, names = None, []
    if found is not None:
        if unit := builder.unit_of_frames(whole=found.whole):
            found = _listed(files, time_unit=unit) or found
        builder.problems += [f"{LIST}: {line}" for line in (found.unit.doubt, found.order) if line]
        folder = files.path if files.path.is_dir() else None
        label = files.label(LIST)
        names = members_of(found.stamps, label, files.has, folder=folder, anywhere=anywhere)
        times = np.array([stamp.t_ns for stamp in found.stamps], np.int64)
    if builder.geometry is None and names:
        rows, columns = next(images(names[:1])).image.shape[:2]
        builder.state((columns, rows), names[0])
    builder.state(geometry, f"the first line of {name}")
    return builder.finish("davis240c" if name == EVENTS else "text", times, lambda: images(names))


def _listed(files: _Files, **evidence: Any) -> FrameList | None:
    """Return the list of frames, or None without frames."""
    if not files.has(LIST):
        return None
    label = files.label(LIST)
    with files.open(LIST) as file:
        text = decoded(file.read(), label)
    return parse_list(text, label, **evidence) if has_lines(text) else None


def _images(files: _Files, names: list[str]) -> Iterator[Pixels]:
    for name in names:
        with files.open(name) as file:
            yield decode_image(file.read(), files.label(name))
