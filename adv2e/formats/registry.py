"""The formats of event files: what they can hold, and which one a path means, to read or to write.

Neither readers and writers nor NumPy are imported here, as what completes a command line asks, too:
each format is a module below this package, and is imported when it is used.
"""

from __future__ import annotations

import importlib
from dataclasses import dataclass
from operator import attrgetter
from pathlib import Path
from typing import Any

from adv2e.errors import DataError, UsageError
from adv2e.files.regular import check_ends

_LARGEST_US = 2**62 // 1000  # adv2e.ticks.LARGEST_NS, without NumPy


@dataclass(frozen=True)
class Format:
    """One format of event files.

    Attributes
    ----------
    name : str
        What ``--format`` calls it; of a layout of HDF5, ``--layout``.
    what : str
        What it is, in a few words.
    suffixes : tuple of str
        With their dots; the empty one: a folder.
    reader, writer : str
        Where the function ``open(path, facts) -> EventFile`` is, and the subclass of
        :class:`adv2e.formats.writing.Writer`: ``module:name`` below this package.  Empty: it cannot
        be read, or written.
    magic : bytes
        How such a file begins, if always so.
    datasets : tuple of str
        Of a layout of HDF5: the datasets by which it is known; ``*`` is left or right.
    file : str
        Of a folder: the file in it by which it is known.
    frames : str
        ``r``: frames are read, ``w``: they are written, ``rw``: both.
    is_camera : bool
        Such files are recordings of cameras: where they hold frames, ``adv2e convert`` simulates.
    holds_settings : bool
        It holds how it was made; else that lies beside it, in ``<path>.json``.
    causes : str
        Where the function is that finds the causes of the events in it: ``find(path)`` returns what
        reads them, or None.  Empty: it has no place for them, and they lie beside it.
    most : (int, int)
        Most columns and rows of a sensor that it can hold.
    first_us, last_us : int
        Times that it can hold [us].
    extra : str
        Name of the optional packages that it needs.
    """

    name: str
    what: str
    suffixes: tuple[str, ...]
    reader: str = ""
    writer: str = ""
    magic: bytes = b""
    datasets: tuple[str, ...] = ()
    file: str = ""
    frames: str = ""
    is_camera: bool = False
    holds_settings: bool = True
    causes: str = ""
    most: tuple[int, int] = (1 << 16, 1 << 16)
    first_us: int = -_LARGEST_US
    last_us: int = _LARGEST_US
    extra: str = ""

    @property
    def is_hdf5(self) -> bool:
        """True for layouts of HDF5."""
        return ".h5" in self.suffixes

    @property
    def is_davis240c(self) -> bool:
        """True for whole recordings (DAVIS 240C), with frames that keep all their bits."""
        return self.name in ("zip", "folder")

    def load(self, what: str) -> Any:
        """Return the object that `what`, `reader` or `writer`, stands for."""
        module, _, name = what.partition(":")
        return attrgetter(name)(importlib.import_module(f"adv2e.formats.{module}"))


_HDF5 = (".h5", ".hdf5")

FORMATS = (
    # layouts of HDF5: the first is the default
    Format("monash", "HDF5 of event_utils and event_cnn_minimal", _HDF5,
           "hdf5_layouts:MONASH.open", "hdf5_writer:MonashWriter",
           datasets=("events/ts", "events/xs", "events/ys", "events/ps"),
           frames="rw", causes="causes:in_hdf5"),
    Format("dsec", "HDF5 of DSEC", _HDF5, "hdf5_layouts:DSEC.open", "hdf5_writer:DsecWriter",
           datasets=("events/t", "events/x", "events/y", "events/p"), causes="causes:in_hdf5"),
    Format("v2e", "HDF5 of v2e", _HDF5, "hdf5_layouts:V2E.open", "hdf5_writer:V2eWriter",
           datasets=("events",), frames="rw", first_us=0, last_us=(1 << 32) - 1),
    Format("mvsec", "HDF5 of MVSEC", _HDF5, "hdf5_layouts:MVSEC.open", "hdf5_writer:MvsecWriter",
           datasets=("davis/*/events",), frames="rw", is_camera=True),
    Format("m3ed", "HDF5 of M3ED", _HDF5, "hdf5_layouts:M3ED.open", "hdf5_writer:M3edWriter",
           datasets=("prophesee/*/t", "prophesee/*/x", "prophesee/*/y", "prophesee/*/p"),
           first_us=0, last_us=(1 << 40) - 1),
    Format("prophesee", "HDF5 of Prophesee's tools", _HDF5, "hdf5_layouts:PROPHESEE.open",
           datasets=("CD/events",)),
    Format("ddd", "HDF5 of DDD17 and DDD20", _HDF5, "ddd:open_ddd",
           datasets=("dvs/data", "dvs/timestamp"), frames="r", is_camera=True),
    Format("ddd20", "HDF5 exported from DDD20", _HDF5, "ddd:open_exported",
           datasets=("event", "frame", "frame_ts"), frames="r", is_camera=True),
    Format("txt", "text, a line for each event: seconds, column, row, polarity", (".txt",),
           "text:open_text", "text_writer:TextWriter", holds_settings=False),
    Format("zip", "a DAVIS240C recording as a zip", (".zip",),
           "davis240c:open_davis240c", "davis240c:ZipWriter",
           magic=b"PK", frames="rw", is_camera=True),
    Format("folder", "a DAVIS240C recording as a folder", ("",),
           "davis240c:open_davis240c", "davis240c:FolderWriter",
           file="events.txt", frames="rw", is_camera=True),
    Format("e2vid", "text for rpg_e2vid, its first line the size; or a zip of it", (".txt", ".zip"),
           "", "davis240c:E2vidWriter", holds_settings=False),
    Format("aedat4", "AEDAT4 of iniVation's cameras", (".aedat4",),
           "aedat4:open_aedat4", "aedat4:Aedat4Writer",
           magic=b"#!AER-DAT4.0\r\n", frames="rw", is_camera=True, most=(32767, 32767),
           extra="aedat4"),
    Format("bag", "a bag of ROS 1", (".bag",), "bag:open_bag", "bag:BagWriter",
           magic=b"#ROSBAG V", frames="rw", is_camera=True, holds_settings=False,
           first_us=0, last_us=(1 << 32) * 1_000_000 - 1, extra="bag"),
    Format("ros2", "a bag of ROS 2, a folder", ("",),
           "bag:open_bag", "bag:Ros2Writer",
           file="metadata.yaml", frames="rw", is_camera=True,
           first_us=0, last_us=(1 << 31) * 1_000_000 - 1, extra="bag"),
    Format("mcap", "MCAP of ROS 2", (".mcap",), "bag:open_bag",
           magic=b"\x89MCAP", frames="r", is_camera=True, extra="bag"),
    Format("db3", "the database of a bag of ROS 2", (".db3",), "bag:open_bag",
           magic=b"SQLite format 3", frames="r", is_camera=True, extra="bag"),
    Format("csv", "CSV with a heading", (".csv",), "csv:open_csv", "csv:CsvWriter",
           holds_settings=False, causes="csv:causes_of"),
    Format("npz", "NumPy archive", (".npz",), "npz:open_npz", "npz:NpzWriter",
           magic=b"PK", causes="npz:causes_of"),
    Format("npy", "a NumPy array of events", (".npy",), "npz:open_npy", magic=b"\x93NUMPY"),
    Format("evt3", "EVT 3.0 of Prophesee's cameras", (".raw",),
           "binary:open_raw", "binary:Evt3Writer",
           is_camera=True, most=(1 << 11, 1 << 11), first_us=0, last_us=(1 << 36) - 1),
    Format("evt2", "EVT 2.0 of Prophesee's cameras", (".raw",),
           "binary:open_raw", "binary:Evt2Writer",
           is_camera=True, most=(1 << 11, 1 << 11), first_us=0, last_us=(1 << 34) - 1),
    Format("evt21", "EVT 2.1 of Prophesee's cameras", (".raw",), "binary:open_raw",
           is_camera=True),
    Format("dat", "DAT of Prophesee's cameras", (".dat",), "binary:open_dat", "binary:DatWriter",
           magic=b"%", is_camera=True, most=(1 << 14, 1 << 14),
           first_us=0, last_us=(1 << 32) - 1),
    Format("nmnist", "N-MNIST and N-Caltech101", (".bin",),
           "binary:open_nmnist", "binary:NmnistWriter", is_camera=True, holds_settings=False,
           most=(256, 240), first_us=0, last_us=(1 << 23) - 1),
    Format("aedat2", "AEDAT-2.0 of jAER", (".aedat",), "aedat2:open_aedat2", "aedat2:Aedat2Writer",
           frames="r", is_camera=True, most=(1 << 10, 1 << 9),
           first_us=0, last_us=(1 << 31) - 1),
    Format("es", "Event Stream", (".es",), "binary:open_es", "binary:EsWriter",
           magic=b"Event Stream", is_camera=True, holds_settings=False,
           most=((1 << 16) - 1, (1 << 16) - 1), first_us=0, last_us=(1 << 35) - 1),
)  # fmt: skip
"""All formats; of those with the same suffix, the first is what a suffix alone stands for."""


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
        return _has_fields(path)
    return bool(suffix) and any(suffix in found.suffixes for found in readable)


def _has_fields(path: Path) -> bool:
    """Tell whether a ``.npy`` holds named fields, as stacks of frames do not."""
    from adv2e.files.zips import read_header  # noqa: PLC0415 - needs NumPy

    try:
        check_ends(path)
        with path.open("rb") as file:
            header = read_header(file, path.stat().st_size, str(path))
    except (OSError, DataError):  # for others to tell
        return False
    return header.dtype.names is not None


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

_STANDARD_OUTPUT = Format("txt", "text", (), writer="text_writer:StandardOutput")


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
