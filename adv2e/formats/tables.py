"""Layouts of HDF5 with the events in one table of four columns, and the frames in one stack."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from adv2e.errors import DataError
from adv2e.formats import hdf5
from adv2e.formats.clock import unwrapped
from adv2e.formats.event_file import Columns, EventFile, Facts
from adv2e.sources.frame import Pixels, Shot
from adv2e.ticks import NS, US, to_ticks

_COARSE_US = 1 << 24
"""Times from which on single precision has steps of more than 1 us [us]."""
_FEW = 100
"""Number of times below which all may be even by chance."""


@dataclass(frozen=True)
class Table:
    """Datasets of a layout: events, frames and timestamps.

    Attributes
    ----------
    events : str
        The dataset of the events.
    order : str
        Its columns.
    frames, stamps : str
        The datasets of the frames and their times.
    """

    events: str
    order: str
    frames: str
    stamps: str


def open_table(
    path: Path, facts: Facts, layout: str, table: Table, unit_ns: int, stamps_ns: int
) -> EventFile:
    """Open a file of such a layout.

    Parameters
    ----------
    path, facts
        See :mod:`adv2e.formats.event_file`.
    layout : str
        What it is called.
    table : Table
    unit_ns, stamps_ns : int
        Units of the times of events and frames [ns].

    Raises
    ------
    DataError
        Datasets of other shapes or kinds, or as many frames as there are not times.
    """
    with hdf5.opened(path) as file:
        hdf5.describe(file, facts, table.events, table.events.rpartition("/")[0])
        _events(file, table)
        stack = _stack(file, table)
        shots: list[Shot] = []
        if stack is not None:
            facts.state((stack.shape[2], stack.shape[1]), f"/{table.frames}")
            times = _times(file, table, stack.shape[0], stamps_ns, facts)
            labels = [f"{path}: {table.frames} {number}" for number in range(times.size)]
            shots = [
                Shot(t_ns, label, partial(_load, path, table, number))
                for number, (t_ns, label) in enumerate(zip(times.tolist(), labels, strict=True))
            ]
    return EventFile(
        layout,
        facts,
        partial(_parts, path, facts, table),
        (lambda: iter(shots)) if shots else None,
        unit_ns=unit_ns,
        times=table.events,
        order=table.order,
    )


def _events(file: h5py.File, table: Table) -> h5py.Dataset:
    events = hdf5.dataset(file, table.events)
    if events.ndim != 2 or events.shape[1] != 4 or events.dtype.kind not in "iuf":
        raise DataError(
            f"{file.filename}: {table.events} must be (events, 4) numbers, got {events.shape} of"
            f" {events.dtype}"
        )
    hdf5.check_stored([events], f"{file.filename}: {table.events}")
    return events


def _parts(path: Path, facts: Facts, table: Table) -> Iterator[Columns]:
    label = f"{path}: {table.events}"
    late = odd = last = 0
    with hdf5.opened(path) as file:
        events = _events(file, table)
        is_whole = events.dtype.kind != "f"
        for begin in range(0, events.shape[0], hdf5.PART):
            part = events[begin : begin + hdf5.PART]
            column = {name: part[:, place] for place, name in enumerate(table.order)}
            t = column["t"]
            x, y = (_whole(column[name], f"{label}, {name}") for name in "xy")
            if is_whole:
                late += int(np.count_nonzero(t >= _COARSE_US))
                odd += int(np.count_nonzero((t >= _COARSE_US) & (t % 2 == 1)))
                last = max(last, int(t.max()))
            yield t, x, y, hdf5.signs(column["p"])
            facts.progress(begin + t.size, events.shape[0])
    if late >= _FEW and not odd and not facts.description:
        facts.tell(
            f"times were made in single precision: from {_COARSE_US / 1e6:.1f} s on they have"
            f" steps of 2 us and more, at the end of {float(np.spacing(np.float32(last))):g} us"
        )


def _whole(values: NDArray[Any], label: str) -> NDArray[np.int64]:
    """Return coordinates as whole numbers."""
    if values.dtype.kind == "f":
        values = np.rint(values.astype(np.float64))
        if not np.all(np.abs(values) < 1 << 31):  # nor is NaN
            raise DataError(f"{label} holds numbers that are no coordinates")
    whole: NDArray[np.int64] = values.astype(np.int64)
    return whole


def _stack(file: h5py.File, table: Table) -> h5py.Dataset | None:
    """Return the frames; None: there are none."""
    if hdf5.find(file, table.frames) is None:
        return None
    stack = hdf5.dataset(file, table.frames)
    if stack.ndim != 3 or 0 in stack.shape[1:] or stack.dtype not in (np.uint8, np.uint16):
        raise DataError(
            f"{file.filename}: {table.frames} must be (frames, rows, columns) of 8 or 16 bits, got"
            f" {stack.shape} of {stack.dtype}"
        )
    return stack if stack.shape[0] else None


def _times(
    file: h5py.File, table: Table, count: int, unit_ns: int, facts: Facts
) -> NDArray[np.int64]:
    label = f"{file.filename}: {table.stamps}"
    stamps = hdf5.read_all(hdf5.dataset(file, table.stamps), label).reshape(-1)
    if stamps.size != count:
        raise DataError(f"{label} holds {stamps.size} times for {count} frames")
    times = to_ticks(unwrapped(stamps), unit_ns, NS, label)
    if stamps.dtype.kind == "f" and stamps.dtype.itemsize < 8:
        step_us = float(np.spacing(stamps.max())) * unit_ns / US
        if step_us > 1:
            facts.problems.append(
                f"/{table.stamps} is of single precision: times of frames have steps of up to"
                f" {step_us:.3g} us"
            )
    return times


def _load(path: Path, table: Table, number: int) -> Pixels:
    with hdf5.opened(path) as file:
        stack = _stack(file, table)
        assert stack is not None
        return Pixels(np.ascontiguousarray(stack[number]))
