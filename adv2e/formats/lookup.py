"""Formats by name, by suffix and by how files begin: which one a path means, to read or to write.

No reader or writer is imported here, nor NumPy: what completes a command line asks, too.
"""

from __future__ import annotations

from pathlib import Path

from adv2e.errors import DataError, UsageError
from adv2e.files.regular import check_ends
from adv2e.formats.registry import FORMATS, Format

_MOST_MAGIC = max(len(found.magic) for found in FORMATS)

HDF5 = "h5"
"""Name of HDF5 of any layout for ``--format``."""


def layouts() -> list[str]:
    """Return the layouts of HDF5 that can be written; the first is the default."""
    return [found.name for found in FORMATS if found.is_hdf5 and found.writer]


def names() -> list[str]:
    """Return the names that ``--format`` takes."""
    return [HDF5, *(found.name for found in FORMATS if not found.is_hdf5 and found.writer)]


def to_write(path: Path, format: str | None = None, layout: str | None = None) -> Format:
    """Return the format that was asked for by name, or by the path's suffix; of "-", text.

    Raises
    ------
    UsageError
        There is no such format or layout, or they do not fit together.
    """
    if str(path) == "-":
        if format not in (None, "txt"):
            raise UsageError(f"--format {format}: standard output takes txt only")
        if layout is not None:
            raise UsageError(f"--layout {layout}: standard output takes text only")
        return _STANDARD_OUTPUT
    if format is not None:
        if format not in names():
            raise UsageError(f"--format {format}: unknown, must be one of {', '.join(names())}")
        found = next(f for f in FORMATS if format in (f.name, HDF5 * f.is_hdf5))
    else:
        found = _of_suffix(path)
    if layout is None:
        return found
    if not found.is_hdf5:
        raise UsageError(f"--layout {layout}: only HDF5 files (.h5) have layouts")
    if layout not in layouts():
        raise UsageError(f"--layout {layout}: unknown, must be one of {', '.join(layouts())}")
    return next(f for f in FORMATS if f.name == layout)


def check_frames(found: Format) -> None:
    """Raise UsageError if a format is to hold frames and cannot."""
    if "w" not in found.frames:
        others = [f.name for f in FORMATS if "w" in f.frames]
        raise UsageError(
            f"--with-frames: {found.what} holds events alone; frames go to {', '.join(others)}"
        )


def may_hold_events(path: Path) -> bool:
    """Tell, by its name, whether a file or folder may be an event file; a .npy is looked into."""
    readable = (found for found in FORMATS if found.reader)
    if path.is_dir():
        return any(found.file and (path / found.file).is_file() for found in readable)
    suffix = path.suffix.lower()
    if suffix == ".npy":
        from adv2e.formats.npz import is_array_of_events  # noqa: PLC0415 - needs NumPy

        return is_array_of_events(path)
    return bool(suffix) and any(suffix in found.suffixes for found in readable)


def format_of(path: Path) -> Format:
    """Return the format of a file or folder that exists.

    Raises
    ------
    DataError
        It is of no known format, or not of that which its suffix says; or it is a pipe, which
        would have to be read twice.
    """
    check_ends(path)
    if path.is_dir():
        folders = [found for found in FORMATS if found.reader and "" in found.suffixes]
        return next((f for f in folders if (path / f.file).is_file()), folders[0])
    suffix = path.suffix.lower()
    named = [found for found in FORMATS if found.reader and suffix and suffix in found.suffixes]
    if any(found.is_hdf5 for found in named):
        return _layout_of(path, named)
    with path.open("rb") as file:
        begin = file.read(_MOST_MAGIC)
    fitting = [found for found in named if begin.startswith(found.magic)]
    if fitting:
        return fitting[0]
    like = [f for f in FORMATS if f.reader and any(f.magic) and begin.startswith(f.magic)]
    if like and named:
        raise DataError(
            f"{path}: begins as {like[0].what} does, which is called {like[0].suffixes[0]}: rename"
            " it"
        )
    if named:
        raise DataError(f"{path}: does not begin as {named[0].what} does: damaged, or misnamed")
    from adv2e.sources import VIDEO_SUFFIXES  # noqa: PLC0415 - names should cost nothing

    if suffix in VIDEO_SUFFIXES:
        raise DataError(f"{path}: is a video and holds no events; make some: adv2e convert {path}")
    known = dict.fromkeys(s for f in FORMATS if f.reader for s in f.suffixes if s)
    raise DataError(
        f"{path}: unknown suffix '{suffix}', must be one of {', '.join(known)}"
        " or a DAVIS240C folder"
    )


def _layout_of(path: Path, layouts: list[Format]) -> Format:
    from adv2e.formats import hdf5  # noqa: PLC0415 - h5py takes its time

    with hdf5.opened(path) as file:
        for found in layouts:
            if all(hdf5.sides(file, name) for name in found.datasets):
                return found
    known = "; or ".join(f"{f.name} (datasets {', '.join(f.datasets)})" for f in layouts)
    raise DataError(f"{path}: unknown HDF5 layout, must be {known}")


_PICTURES_OF_EVENTS = (".mp4", ".webm", ".gif", ".avi", ".mkv", ".mov", ".png", ".jpg", ".jpeg")

_STANDARD_OUTPUT = Format(name="txt", what="text", suffixes=(), writer="text.writer:StandardOutput")


def _of_suffix(path: Path) -> Format:
    suffix = path.suffix.lower()
    for found in FORMATS:
        if found.writer and suffix in found.suffixes:
            return found
    if suffix in _PICTURES_OF_EVENTS:
        raise UsageError(
            f"{path}: would be a picture or film of events, and a file of events is to be written:"
            f" add --preview {path}, or make one later with 'adv2e render EVENTS -o {path}'"
        )
    known = dict.fromkeys(s for f in FORMATS if f.writer for s in f.suffixes if s)
    raise UsageError(
        f"{path}: unknown suffix '{suffix}', must be one of {', '.join(known)},"
        f" none (a DAVIS240C folder), or choose with --format: {', '.join(names())}"
    )
