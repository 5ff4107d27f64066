"""Sequences below a folder, each of which is one conversion.

==============  =================================================================================
layout          what counts
==============  =================================================================================
``videos``      files that are opened as video
``gopro``       folders of GOPRO_Large and GOPRO_Large_all; of one with several kinds, ``sharp``
``ddd17``       HDF5 of DDD17 and DDD20
``davis240c``   recordings of DAVIS240C: folders and zips with ``images.txt``
``auto``        all of these, and what else holds frames and their times: folders with a list of
                them, AEDAT4, bags of ROS, AEDAT-2
==============  =================================================================================

The name of a sequence is its path below the folder, without its suffix, unless two would be called
the same.  Hidden files and folders do not count, and links to folders are not followed, so that
nothing is found twice or for ever.
"""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from adv2e.errors import DataError
from adv2e.formats.lookup import format_of, may_hold_events
from adv2e.sources import VIDEO_SUFFIXES
from adv2e.sources.gopro import find_sequence
from adv2e.sources.images.source import found_list, natural_key

LAYOUTS = ("auto", "gopro", "ddd17", "davis240c", "videos")

_DDD = ("ddd", "ddd20")
_RECORDINGS = {"ddd17": (".h5", ".hdf5"), "davis240c": (".zip",)}


@dataclass(frozen=True)
class Sequence:
    """What one conversion is made of.

    Attributes
    ----------
    name : str
        Path below the folder that was searched, with ``/``.
    source : Path
        File or folder.
    layout : str
        Which of LAYOUTS it was found as; ``auto`` for others.
    """

    name: str
    source: Path
    layout: str


def find_sequences(
    root: Path, layout: str = "auto", *, leave_out: Path | None = None, by_name: bool = False
) -> list[Sequence]:
    """Return the sequences below a folder, in natural order of their names; or that of a file.

    Parameters
    ----------
    root : Path
        Folder, or a single file.
    layout : str
        One of LAYOUTS.
    leave_out : Path, optional
        Folder in which nothing is looked for: that of the results.
    by_name : bool
        Files cannot be read: recordings are told by the layout and their suffix.

    Raises
    ------
    DataError
        There is no such file or folder, it cannot be read, or nothing in it counts.
    """
    if not root.exists():
        raise DataError(f"{root}: no such file or folder")
    avoided = None if leave_out is None else leave_out.resolve()
    trusted = layout if by_name else ""
    walked = _walk(root, avoided, trusted)
    found = [(path, kind) for path, kind in walked if layout in ("auto", kind)]
    if not found:
        raise DataError(f"{root}: {_nothing(layout)}")
    names = _names(root, [path for path, _ in found])
    sequences = [
        Sequence(name, path, kind) for name, (path, kind) in zip(names, found, strict=True)
    ]
    return sorted(sequences, key=lambda one: natural_key(one.name))


def _nothing(layout: str) -> str:
    if layout == "auto":
        return "holds no video, and no recording or folder with frames and their times"
    return f"holds no sequence of the layout {layout}"


def _walk(root: Path, avoided: Path | None, trusted: str) -> Iterator[tuple[Path, str]]:
    """Yield each sequence with its layout; nothing is looked for inside of one."""

    def fail(error: OSError) -> None:
        raise DataError(f"{error.filename}: {error.strerror}") from error

    if root.is_file():
        if kind := _kind_of_file(root, trusted):
            yield root, kind
        return
    for place, folders, files in os.walk(root, onerror=fail):
        here = Path(place)
        if kind := _kind_of_folder(here):
            folders.clear()
            yield here, kind
            continue
        folders[:] = sorted(
            one
            for one in folders
            if not one.startswith(".") and (avoided is None or (here / one).resolve() != avoided)
        )
        for file in sorted(files):
            path = here / file
            if file.startswith(".") or not path.is_file():
                continue
            if kind := _kind_of_file(path, trusted):
                yield path, kind


def _kind_of_folder(path: Path) -> str:
    if (path / "images.txt").is_file():
        return "davis240c"
    if find_sequence(path):
        return "gopro"
    if found_list(path):
        return "auto"
    is_bag = may_hold_events(path) and "r" in format_of(path).frames
    return "auto" if is_bag else ""


def _kind_of_file(path: Path, trusted: str) -> str:
    suffix = path.suffix.lower()
    if suffix in VIDEO_SUFFIXES:
        return "videos"
    if suffix in _RECORDINGS.get(trusted, ()):
        return trusted
    if not may_hold_events(path):
        return ""
    try:
        found = format_of(path)
    except DataError:
        return ""  # named as a recording, and none: as any other file that lies about
    if found.name in _DDD:
        return "ddd17"
    if found.is_davis240c:
        return "davis240c"
    return "auto" if found.is_camera and "r" in found.frames else ""


def _names(root: Path, paths: list[Path]) -> list[str]:
    """Return a name for each, none of them twice, whatever the system holds for the same."""
    base = root.parent if paths == [root] else root
    whole = [PurePosixPath(path.relative_to(base).as_posix()) for path in paths]
    short = [
        name if path.is_dir() else name.with_suffix("")
        for name, path in zip(whole, paths, strict=True)
    ]
    count = Counter(str(name).casefold() for name in short)
    return [
        str(full if count[str(name).casefold()] > 1 else name)
        for full, name in zip(whole, short, strict=True)
    ]
