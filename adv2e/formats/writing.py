"""Where events go: files of several formats, and standard output.

>>> from adv2e.events import make_events
>>> from adv2e.formats.writing import open_sink
>>> events = make_events(t=[10, 20], x=[0, 3], y=[0, 2], p=[1, 0])
>>> with open_sink("-", width=4, height=3, metadata={}) as sink:  # doctest: +SKIP
...     sink.write_events(events)
0.000010000 0 0 1
0.000020000 3 2 0
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from adv2e.background import default_threads
from adv2e.errors import UsageError
from adv2e.events import Events, checked_events
from adv2e.files.staging import Staging
from adv2e.formats.sink import Request, Sink, Writer

FORMATS = {"txt": (".txt",), "zip": (".zip",), "folder": ("",), "h5": (".h5", ".hdf5")}
"""Formats by name, and the suffixes that stand for them."""

LAYOUTS = ("monash",)
"""Layouts of HDF5 files; the first is the default."""


def open_sink(
    path: str | Path,
    *,
    width: int,
    height: int,
    metadata: dict[str, Any],
    format: str | None = None,
    layout: str | None = None,
    overwrite: bool = False,
    with_frames: bool = False,
    threads: int | None = None,
    staging: Staging | None = None,
) -> Sink:
    """Return a sink for `path`, to be used in a ``with`` block.

    Nothing is written before the block is entered, and nothing is left if it is left by an
    exception; folders missing above `path` are made.

    Parameters
    ----------
    path : str or Path
        Output; "-": text to standard output.
    width, height : int
        Geometry [pixels].
    metadata : dict
        What JSON can hold; stored inside, or in ``<path>.json`` beside a text file.
    format : str, optional
        One of :data:`FORMATS`; default: by the suffix, a path without one is a folder.
    layout : str, optional
        One of :data:`LAYOUTS`, for HDF5.
    overwrite : bool
        Replace, at the end, what exists.
    with_frames : bool
        Store frames, where the format can.
    threads : int, optional
        Threads that compress; default: all cores.  The bytes do not depend on it.
    staging : Staging, optional
        Takes the output together with others; it says whether what exists is replaced.

    Raises
    ------
    UsageError
        Unknown `format` or `layout`, or they do not fit together.
    OutputError
        Unknown suffix; the output exists already, or cannot be made.
    """
    path = Path(path)
    name = format_name(path, format)
    if layout is not None:
        if str(path) == "-":
            raise UsageError(f"--layout {layout}: standard output takes text only")
        if name != "h5":
            raise UsageError(f"--layout {layout}: only HDF5 files (.h5) have layouts")
        if layout not in LAYOUTS:
            raise UsageError(f"--layout {layout}: unknown, must be one of {', '.join(LAYOUTS)}")
    version = {"adv2e": metadata["adv2e"]} if "adv2e" in metadata else {}
    request = Request(
        path=path,
        width=width,
        height=height,
        description={**version, "width": width, "height": height, **metadata},
        with_frames=with_frames,
        threads=threads or default_threads(),
    )
    files = Staging(overwrite) if staging is None else staging
    return Sink(_writer(path, name), request, files, is_alone=staging is None)


def write_events(
    path: str | Path,
    events: Events,
    size: tuple[int, int],
    *,
    metadata: dict[str, Any] | None = None,
    overwrite: bool = False,
) -> None:
    """Write events to a file, whose suffix tells the format, or to a folder.

    Parameters
    ----------
    path : str or Path
        Output: .txt, .h5, .zip (DAVIS240C), or a folder in that layout.
    events : structured array, (n,)
        With the fields t [us], x, y, p, in any order of time; sorted ones are written as they are.
    size : (int, int)
        Width and height of the sensor [pixels].
    metadata : dict, optional
        What JSON can hold; stored inside, or in ``<path>.json`` beside a text file.
    overwrite : bool
        Replace, at the end, what exists.

    Raises
    ------
    DataError
        The array has other fields, or an event lies outside the sensor.
    OutputError
        Unknown suffix; the output exists already, or cannot be made.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from adv2e import read_events, write_events
    >>> from adv2e.events import make_events
    >>> events = make_events(t=[10, 20], x=[0, 3], y=[0, 2], p=[1, 0])
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_events(Path(folder, "a.h5"), events, (4, 3))
    ...     recording = read_events(Path(folder, "a.h5"))
    >>> recording.events["t"].tolist(), recording.width, recording.height
    ([10, 20], 4, 3)
    """
    width, height = size
    ours = checked_events(events, width, height)
    with open_sink(
        path, width=width, height=height, metadata=dict(metadata or {}), overwrite=overwrite
    ) as sink:
        sink.write_events(ours)


def _writer(path: Path, name: str) -> type[Writer]:
    """Return what writes a format; imported late, as each needs other libraries."""
    if str(path) == "-":
        from adv2e.formats.text.writer import StandardOutput  # noqa: PLC0415

        return StandardOutput
    if name == "h5":
        from adv2e.formats.monash.writer import MonashWriter  # noqa: PLC0415

        return MonashWriter
    if name == "txt":
        from adv2e.formats.text.writer import TextWriter  # noqa: PLC0415

        return TextWriter
    from adv2e.formats.davis240c.writer import FolderWriter, ZipWriter  # noqa: PLC0415

    return ZipWriter if name == "zip" else FolderWriter


def format_name(path: Path, format: str | None) -> str:
    """Return the format that was asked for by name, or by the path's suffix; of "-", text.

    Raises
    ------
    UsageError
        There is no such format.
    """
    if str(path) == "-":
        if format not in (None, "txt"):
            raise UsageError(f"--format {format}: standard output takes txt only")
        return "txt"
    if format is not None:
        if format not in FORMATS:
            raise UsageError(f"--format {format}: unknown, must be one of {', '.join(FORMATS)}")
        return format
    suffix = path.suffix.lower()
    for name, suffixes in FORMATS.items():
        if suffix in suffixes:
            return name
    known = [suffix for suffixes in FORMATS.values() for suffix in suffixes if suffix]
    raise UsageError(
        f"{path}: unknown suffix '{suffix}', must be one of {', '.join(known)},"
        f" none (a DAVIS240C folder), or choose with --format: {', '.join(FORMATS)}"
    )
