"""HDF5 files of which only what is in them is read.

An HDF5 file can hold links and datasets that stand for other files, any file of the system among
them, or for themselves.  Every name is therefore walked link by link, and a dataset is read only if
its numbers lie in the file.

References
----------
.. [1] The HDF Group, "HDF5 File Format Specification Version 3.0": link message, data layout
   message (virtual storage), external data files message.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from h5py import h5d, h5z
from numpy.typing import NDArray

from adv2e.errors import DataError
from adv2e.files.regular import check_expansion
from adv2e.formats.columns import SIZE_NAMES, named_geometry, unit_of_attribute
from adv2e.formats.event_file import Facts
from adv2e.process.machine import machine_complaint
from adv2e.sources.frame import Track, counted

PART = 1 << 20
"""Events read at once."""

SIDES = "left", "right"
"""Names of the cameras in layouts with several."""
_SIDES = 3
"""Most numbers in a dataset with the size of a sensor; the third one counts polarities."""

_LINKS = 16
"""Soft links on the way to one name, as in the library itself."""

_ECF = 0x8ECF
"""The filter of Prophesee's files."""

_PLUGINS = {32001: "Blosc", 32004: "LZ4", 32008: "bitshuffle", 32015: "Zstandard", 32026: "Blosc2"}
"""Filters of the package hdf5plugin that recordings use."""

_FAILURES = (OSError, RuntimeError, KeyError, ValueError, TypeError, OverflowError)
"""Exceptions of h5py for files that are damaged."""


_SIDE = re.compile("imu|pose|odom|gps|depth|flow|lidar|velodyne|label|trigger|masks?$")
"""Words of names of side data."""


@contextmanager
def opened(path: Path) -> Iterator[h5py.File]:
    """Open a file for reading; any fault that the library finds is a DataError."""
    try:
        with h5py.File(path, "r") as file:
            yield file
    except DataError:
        raise
    except _FAILURES as error:
        if machine_complaint(error):
            raise
        why = str(error).partition("(")[2].rstrip(")") or str(error)
        raise DataError(f"{path}: not an HDF5 file that can be read, or damaged: {why}") from error


def find(file: h5py.File, name: str) -> h5py.Group | h5py.Dataset | None:
    """Return the object of a name, with slashes, in the file itself; None if there is none.

    Raises
    ------
    DataError
        A link on the way leads out of the file, to nothing, or in circles; or the name is that of a
        dataset whose numbers are not in the file.
    """
    label = f"{file.filename}: {name}"
    here: Any = file["/"]
    parts = name.split("/")
    followed = 0
    while parts:
        part, *parts = parts
        if part in ("", "."):
            continue
        link = here.get(part, getlink=True) if isinstance(here, h5py.Group) else None
        if isinstance(link, h5py.HardLink):
            here = here[part]
        elif isinstance(link, h5py.SoftLink):
            followed += 1
            if followed > _LINKS:
                raise DataError(f"{label}: is a link that leads to itself")
            if link.path.startswith("/"):
                here = file["/"]
            parts = link.path.split("/") + parts
        elif link is not None:
            raise DataError(f"{label}: is a link to another file, which is not followed")
        elif followed:
            raise DataError(f"{label}: is a link to nothing")
        else:
            return None
    if isinstance(here, h5py.Dataset):
        _check_own(here, label)
    return here if isinstance(here, (h5py.Group, h5py.Dataset)) else None


def besides(file: h5py.File, group: str = "") -> list[str]:
    """Return the names of what, by its name, is side data: in the file, and in a group of it."""
    places = ("", f"{group}/") if group else ("",)
    held = [f"{place}{name}" for place in places for name in file[f"/{place}"]]
    return sorted(name for name in held if _SIDE.search(name.rpartition("/")[2].lower()))


def is_dataset(file: h5py.File, name: str) -> bool:
    """Tell whether the name is that of a dataset; DataError as :func:`find`."""
    return isinstance(find(file, name), h5py.Dataset)


def sides(file: h5py.File, pattern: str) -> list[str]:
    """Return the cameras of a pair, left and right, with the dataset of a name with a ``*``."""
    return [side for side in SIDES if is_dataset(file, pattern.replace("*", side))]


def choose(file: h5py.File, facts: Facts, events: str, frames: str = "") -> tuple[str, str]:
    """Return of which camera, left or right, the events and the frames are to be read.

    Parameters
    ----------
    events, frames : str
        Names of datasets whose length is their number, with ``*`` for the camera.
    """

    def tracks(pattern: str, what: str) -> list[Track]:
        names = [pattern.replace("*", side) for side in sides(file, pattern)] if pattern else []
        counts = [math.prod(dataset(file, name).shape[:1]) for name in names]
        return [
            Track(name.removesuffix("/t"), counted(count, what), is_empty=not count)
            for name, count in zip(names, counts, strict=True)
        ]

    event, frame = facts.choose(tracks(events, "events"), tracks(frames, "frames"))
    side = sides(file, events)[event or 0]
    return side, side if frame is None else sides(file, frames)[frame]


def dataset(file: h5py.File, name: str) -> h5py.Dataset:
    """Return the dataset of a name; DataError as :func:`find`, or if it is none."""
    found = find(file, name)
    if not isinstance(found, h5py.Dataset):
        raise DataError(f"{file.filename}: {name} is no dataset")
    return found


def read_all(column: h5py.Dataset, label: str) -> NDArray[Any]:
    """Return all that a dataset holds; DataError if it states far more than that."""
    check_stored([column], label)
    return np.asarray(column[()])


def read_column(path: Path, name: str) -> NDArray[Any]:
    """Return a dataset of one dimension; DataError if it is none."""
    with opened(path) as file:
        found = read_all(dataset(file, name), f"{path}: {name}")
    if found.ndim != 1:
        raise DataError(f"{path}: {name} must be a column, not of shape {found.shape}")
    return found


def number(file: h5py.File, name: str) -> int:
    """Return the one whole number that a dataset holds; DataError if it holds something else."""
    found = dataset(file, name)
    if found.size != 1 or found.dtype.kind not in "iu":
        raise DataError(f"{file.filename}: {name} must hold one whole number")
    return int(np.asarray(found[()]).item())


def describe(file: h5py.File, facts: Facts, *groups: str) -> None:
    """Take the description of a file, if this program wrote it, and the size of its sensor.

    The size may stand in attributes or small datasets, of the root and of the `groups`.
    """
    if "adv2e" in file.attrs:
        label = f"{facts.path}: attribute adv2e"
        facts.describe(str(file.attrs["adv2e"]), label, "the attribute adv2e")
    for name in ("", *groups):
        group = find(file, name)
        if group is None:
            continue
        values: dict[str, Any] = {}
        for key in SIZE_NAMES:
            if key in group.attrs:
                values[key] = group.attrs[key]
            elif isinstance(group, h5py.Group) and is_dataset(file, f"{name}/{key}"):
                held = dataset(file, f"{name}/{key}")
                if held.size <= _SIDES:
                    values[key] = held[()]
        key, geometry = named_geometry(values)
        facts.state(geometry, f"{name}/{key}".lstrip("/"))


def unit_of(column: h5py.Dataset) -> str | None:
    """Return the unit that an attribute of a column of times states; None: there is none."""
    for name in ("units", "unit"):
        value = column.attrs.get(name)
        if isinstance(value, (bytes, str)):
            return unit_of_attribute(value if isinstance(value, str) else value.decode("latin-1"))
    return None


def signs(p: NDArray[Any]) -> NDArray[np.int8]:
    """Return polarities in 8 bits; those that do not fit keep their sign, and stay odd."""
    if p.dtype.kind == "b":
        return p.astype(np.int8)
    if p.dtype.kind == "u":  # -1 without a sign
        p = p.view(p.dtype.str.replace("u", "i"))
    found: NDArray[np.int8] = np.clip(np.nan_to_num(p, nan=-2.0), -2, 2).astype(np.int8)
    return found


def check_stored(columns: list[h5py.Dataset], label: str) -> None:
    """Raise DataError if datasets together state far more than the file holds of them."""
    stated = sum(math.prod(column.shape or ()) * column.dtype.itemsize for column in columns)
    check_expansion(stated, sum(column.id.get_storage_size() for column in columns), label)


def _check_own(found: h5py.Dataset, label: str) -> None:
    """Refuse a dataset whose numbers are elsewhere, or that has none."""
    made = found.id.get_create_plist()
    if made.get_layout() == h5d.VIRTUAL:
        raise DataError(f"{label}: is a virtual dataset, made of others, which are not followed")
    if made.get_external_count():
        raise DataError(f"{label}: keeps its numbers in another file, which is not read")
    if found.shape is None:
        raise DataError(f"{label}: is an empty dataset")
    for number in range(made.get_nfilters()):
        _check_filter(made.get_filter(number)[0], label)


def _check_filter(code: int, label: str) -> None:
    """Refuse a dataset that is compressed in a way for which the plug-in is missing."""
    if h5z.filter_avail(code):
        return
    if code == _ECF:
        raise DataError(
            f"{label}: is compressed with ECF (filter {_ECF}), which only Metavision's own plug-in"
            " reads; make a .dat of it with that: metavision_file_to_dat -i FILE"
        )
    try:
        import hdf5plugin  # noqa: F401, PLC0415 - an extra; it registers what it can read
    except ImportError:
        raise DataError(
            f"{label}: is compressed with {_PLUGINS.get(code, 'a plug-in')} (filter {code}), which"
            " needs another package: pip install 'adv2e[blosc]'"
        ) from None
    if not h5z.filter_avail(code):
        raise DataError(f"{label}: is compressed with filter {code}, which is not known here")
