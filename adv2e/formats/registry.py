"""The formats of event files: what they are called, how they begin, and what they can hold.

Nothing is imported here but names: each format is a module below this one, with what reads it and
what writes it, and is imported when it is used.
"""

from __future__ import annotations

import importlib
from dataclasses import dataclass
from operator import attrgetter
from typing import Any

_LARGEST_US = 2**62 // 1000  # adv2e.ticks.LARGEST_NS, without NumPy


@dataclass(frozen=True, kw_only=True)
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
        :class:`adv2e.formats.sink.Writer`: ``module:name`` below this package.  Empty: it cannot
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
    Format(
        name="monash",
        what="HDF5 of event_utils and event_cnn_minimal",
        suffixes=_HDF5,
        reader="hdf5_layouts:MONASH.open",
        writer="hdf5_writer:MonashWriter",
        datasets=("events/ts", "events/xs", "events/ys", "events/ps"),
        frames="rw",
        causes="causes:in_hdf5",
    ),
    Format(
        name="dsec",
        what="HDF5 of DSEC",
        suffixes=_HDF5,
        reader="hdf5_layouts:DSEC.open",
        writer="hdf5_writer:DsecWriter",
        datasets=("events/t", "events/x", "events/y", "events/p"),
        causes="causes:in_hdf5",
    ),
    Format(
        name="v2e",
        what="HDF5 of v2e",
        suffixes=_HDF5,
        reader="hdf5_layouts:V2E.open",
        writer="hdf5_writer:V2eWriter",
        datasets=("events",),
        frames="rw",
        first_us=0,
        last_us=(1 << 32) - 1,
    ),
    Format(
        name="mvsec",
        what="HDF5 of MVSEC",
        suffixes=_HDF5,
        reader="hdf5_layouts:MVSEC.open",
        writer="hdf5_writer:MvsecWriter",
        datasets=("davis/*/events",),
        frames="rw",
        is_camera=True,
    ),
    Format(
        name="m3ed",
        what="HDF5 of M3ED",
        suffixes=_HDF5,
        reader="hdf5_layouts:M3ED.open",
        writer="hdf5_writer:M3edWriter",
        datasets=("prophesee/*/t", "prophesee/*/x", "prophesee/*/y", "prophesee/*/p"),
        first_us=0,
        last_us=(1 << 40) - 1,
    ),
    Format(
        name="prophesee",
        what="HDF5 of Prophesee's tools",
        suffixes=_HDF5,
        reader="hdf5_layouts:PROPHESEE.open",
        datasets=("CD/events",),
    ),
    Format(
        name="ddd",
        what="HDF5 of DDD17 and DDD20",
        suffixes=_HDF5,
        reader="ddd:open_ddd",
        datasets=("dvs/data", "dvs/timestamp"),
        frames="r",
        is_camera=True,
    ),
    Format(
        name="ddd20",
        what="HDF5 exported from DDD20",
        suffixes=_HDF5,
        reader="ddd:open_exported",
        datasets=("event", "frame", "frame_ts"),
        frames="r",
        is_camera=True,
    ),
    Format(
        name="txt",
        what="text, a line for each event: seconds, column, row, polarity",
        suffixes=(".txt",),
        reader="text.reader:open_text",
        writer="text.writer:TextWriter",
        holds_settings=False,
    ),
    Format(
        name="zip",
        what="a DAVIS240C recording as a zip",
        suffixes=(".zip",),
        reader="davis240c.reader:open_davis240c",
        writer="davis240c.writer:ZipWriter",
        magic=b"PK",
        frames="rw",
        is_camera=True,
    ),
    Format(
        name="folder",
        what="a DAVIS240C recording as a folder",
        suffixes=("",),
        reader="davis240c.reader:open_davis240c",
        writer="davis240c.writer:FolderWriter",
        file="events.txt",
        frames="rw",
        is_camera=True,
    ),
    Format(
        name="e2vid",
        what="text for rpg_e2vid, its first line the size; or a zip of it",
        suffixes=(".txt", ".zip"),
        writer="e2vid:E2vidWriter",
        holds_settings=False,
    ),
    Format(
        name="aedat4",
        what="AEDAT4 of iniVation's cameras",
        suffixes=(".aedat4",),
        reader="aedat4.reader:open_aedat4",
        writer="aedat4.writer:Aedat4Writer",
        magic=b"#!AER-DAT4.0\r\n",
        frames="rw",
        is_camera=True,
        most=(32767, 32767),
        extra="aedat4",
    ),
    Format(
        name="bag",
        what="a bag of ROS 1",
        suffixes=(".bag",),
        reader="bag.reader:open_bag",
        writer="bag.writer:BagWriter",
        magic=b"#ROSBAG V",
        frames="rw",
        is_camera=True,
        holds_settings=False,
        first_us=0,
        last_us=(1 << 32) * 1_000_000 - 1,
        extra="bag",
    ),
    Format(
        name="ros2",
        what="a bag of ROS 2, a folder",
        suffixes=("",),
        reader="bag.reader:open_bag",
        writer="bag.writer:Ros2Writer",
        file="metadata.yaml",
        frames="rw",
        is_camera=True,
        first_us=0,
        last_us=(1 << 31) * 1_000_000 - 1,
        extra="bag",
    ),
    Format(
        name="mcap",
        what="MCAP of ROS 2",
        suffixes=(".mcap",),
        reader="bag.reader:open_bag",
        magic=b"\x89MCAP",
        frames="r",
        is_camera=True,
        extra="bag",
    ),
    Format(
        name="db3",
        what="the database of a bag of ROS 2",
        suffixes=(".db3",),
        reader="bag.reader:open_bag",
        magic=b"SQLite format 3",
        frames="r",
        is_camera=True,
        extra="bag",
    ),
    Format(
        name="csv",
        what="CSV with a heading",
        suffixes=(".csv",),
        reader="csv:open_csv",
        writer="csv:CsvWriter",
        holds_settings=False,
        causes="csv:causes_of",
    ),
    Format(
        name="npz",
        what="NumPy archive",
        suffixes=(".npz",),
        reader="npz:open_npz",
        writer="npz:NpzWriter",
        magic=b"PK",
        causes="npz:causes_of",
    ),
    Format(
        name="npy",
        what="a NumPy array of events",
        suffixes=(".npy",),
        reader="npz:open_npy",
        magic=b"\x93NUMPY",
    ),
    Format(
        name="evt3",
        what="EVT 3.0 of Prophesee's cameras",
        suffixes=(".raw",),
        reader="binary:open_raw",
        writer="binary:Evt3Writer",
        is_camera=True,
        most=(1 << 11, 1 << 11),
        first_us=0,
        last_us=(1 << 36) - 1,
    ),
    Format(
        name="evt2",
        what="EVT 2.0 of Prophesee's cameras",
        suffixes=(".raw",),
        reader="binary:open_raw",
        writer="binary:Evt2Writer",
        is_camera=True,
        most=(1 << 11, 1 << 11),
        first_us=0,
        last_us=(1 << 34) - 1,
    ),
    Format(
        name="evt21",
        what="EVT 2.1 of Prophesee's cameras",
        suffixes=(".raw",),
        reader="binary:open_raw",
        is_camera=True,
    ),
    Format(
        name="dat",
        what="DAT of Prophesee's cameras",
        suffixes=(".dat",),
        reader="binary:open_dat",
        writer="binary:DatWriter",
        magic=b"%",
        is_camera=True,
        most=(1 << 14, 1 << 14),
        first_us=0,
        last_us=(1 << 32) - 1,
    ),
    Format(
        name="nmnist",
        what="N-MNIST and N-Caltech101",
        suffixes=(".bin",),
        reader="nmnist:open_nmnist",
        is_camera=True,
    ),
    Format(
        name="aedat2",
        what="AEDAT-2.0 of jAER",
        suffixes=(".aedat",),
        reader="aedat2:open_aedat2",
        writer="aedat2:Aedat2Writer",
        frames="r",
        is_camera=True,
        most=(1 << 10, 1 << 9),
        first_us=0,
        last_us=(1 << 31) - 1,
    ),
    Format(
        name="es",
        what="Event Stream",
        suffixes=(".es",),
        reader="binary:open_es",
        writer="binary:EsWriter",
        magic=b"Event Stream",
        is_camera=True,
        holds_settings=False,
        most=((1 << 16) - 1, (1 << 16) - 1),
        first_us=0,
        last_us=(1 << 35) - 1,
    ),
)
"""All formats; of those with the same suffix, the first is what a suffix alone stands for."""
