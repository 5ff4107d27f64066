"""Events in NumPy archives: one structured array, or an array for each column.

========== ======================= =================================================
column     names                   meaning
========== ======================= =================================================
time       t_s, t_ms, t_us, t_ns   as they say
           t, ts, time(stamp)(s)   told from the times: :mod:`adv2e.formats.units`
column     x, xs                   from the left
row        y, ys                   from the top
polarity   p, ps, pol(arity)       ON above 0
========== ======================= =================================================

``width`` and ``height`` tell the geometry [pixels], ``adv2e`` (JSON) what wrote the file.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.errors import DataError
from adv2e.files.npy import read_array
from adv2e.files.zips import open_member, zip_archive
from adv2e.formats.event_file import EventFile, Facts, Progress, described_geometry
from adv2e.ticks import US, to_ticks

_NAMES = {
    "time": ("t_us", "t_ns", "t_ms", "t_s", "t", "ts", "time", "times", "timestamp", "timestamps"),
    "x": ("x", "xs"),
    "y": ("y", "ys"),
    "polarity": ("p", "ps", "pol", "polarity"),
}

_BEYOND = 1 << 31


def open_npz(path: Path, facts: Facts) -> EventFile:
    """Open a NumPy archive, and read it.

    Raises
    ------
    DataError
        Not such an archive, a column is missing, or columns differ in length.
    """
    arrays = _load(path, facts.progress)
    if "adv2e" in arrays:
        facts.describe(str(arrays["adv2e"]), f"{path}: adv2e", "the file")
    columns = _columns(path, arrays)
    x, y, p = (_whole(path, *columns[name]) for name in ("x", "y", "polarity"))
    sizes: dict[str, Any] = {
        name: arrays[name].item()
        for name in ("width", "height")
        if name in arrays and arrays[name].size == 1
    }
    facts.state(described_geometry(sizes), "the file")
    name, t = columns["time"]
    if t.dtype.kind not in "iuf":
        raise DataError(f"{path}: {name} must hold numbers, not {t.dtype}")
    stated = name[2:] if name.startswith("t_") else None
    facts.time_unit, facts.stated_unit = facts.time_unit or stated, None
    unit = facts.unit_of_events(t, x, y, facts.geometry, whole=t.dtype.kind != "f")
    ticks = to_ticks(t, unit.ns, US, f"{path}: {name}")
    return EventFile("npz", facts, lambda: iter([(ticks, x, y, p)]))


def _load(path: Path, progress: Progress) -> dict[str, NDArray[Any]]:
    arrays = {}
    with zip_archive(path, "a NumPy archive") as archive:
        total, done = sum(member.file_size for member in archive.infolist()), 0
        for member in archive.infolist():
            name, suffix = member.filename[:-4], member.filename[-4:]
            if suffix == ".npy":
                with open_member(archive, member) as file:
                    arrays[name] = read_array(file, member.file_size, f"{path}: {name}")
            done += member.file_size
            progress(done, total)
    return arrays


def _columns(path: Path, arrays: Mapping[str, NDArray[Any]]) -> dict[str, tuple[str, NDArray[Any]]]:
    """Return (name in the file, array) of each column."""
    structured = [array for array in arrays.values() if array.dtype.names is not None]
    if len(structured) == 1:
        table = structured[0]
        arrays = {name: table[name] for name in table.dtype.names or ()}
    found = {}
    for column, names in _NAMES.items():
        name = next((name for name in names if name in arrays), None)
        if name is None:
            raise DataError(
                f"{path}: no column for {column} ({', '.join(names)}); it has"
                f" {', '.join(arrays) or 'nothing'}"
            )
        found[column] = (name, arrays[name])
    shapes = {array.shape for _, array in found.values()}
    if len(shapes) != 1 or len(next(iter(shapes))) != 1:
        raise DataError(f"{path}: columns must be of one length, got {sorted(shapes)}")
    return found


def _whole(path: Path, name: str, column: NDArray[Any]) -> NDArray[np.int64]:
    """Return a column of whole numbers, whatever their type."""
    if column.dtype.kind not in "biuf":
        raise DataError(f"{path}: {name} must hold numbers, not {column.dtype}")
    if column.dtype.kind == "f" and not np.array_equal(np.floor(column), column):
        raise DataError(f"{path}: {name} must hold whole numbers")
    # beyond any sensor, and within 64 bits whatever the type
    whole: NDArray[np.int64] = np.clip(column, -_BEYOND, _BEYOND).astype(np.int64)
    return whole
