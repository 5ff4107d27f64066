"""HDF5 recordings in the layout of ``event_utils`` and ``event_cnn_minimal``.

See :mod:`adv2e.formats.monash.writer`.  Polarity may be bool, 0/1 or -1/+1; times are seconds,
unless they tell another unit (:mod:`adv2e.sources.times.units`); frames come in the order of their
names.
"""

from __future__ import annotations

from decimal import Decimal
from functools import partial
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from adv2e.errors import DataError
from adv2e.formats import hdf5
from adv2e.formats.event_file import EventFile, Facts
from adv2e.sources.frame import Pixels, Shot
from adv2e.sources.times.units import Unit, frame_unit
from adv2e.ticks import NS, to_ticks

COLUMNS = ("events/ts", "events/xs", "events/ys", "events/ps")


def open_monash(path: Path, facts: Facts) -> EventFile:
    """Open a file of this layout.

    Raises
    ------
    DataError
        Columns of different lengths or kinds, times that are not finite or beyond 146 years, a
        broken image, or something that is not in the file itself.
    """
    with hdf5.opened(path) as file:
        hdf5.describe(file, facts, "events")
        images = hdf5.find(file, "images")
        if isinstance(images, h5py.Dataset):
            raise DataError(f"{path}: images is a dataset, must be a group of images")
        names = [f"images/{name}" for name in sorted(images)] if images is not None else []
        found = [hdf5.dataset(file, name) for name in names]
        if found:
            height, width = _pixels(path, found[0])[:2]
            facts.state((width, height), "the first image")
        frames = _Stamps(path, found)
        if len(found) > 1 and frames.name == "timestamp":
            facts.note_frames(frames.unit(None, facts.stated_unit), whole=frames.whole)
        columns = hdf5.columns(file, COLUMNS)
        whole = columns[0].dtype.kind in "iu"
        facts.time_unit = facts.time_unit or hdf5.unit_of(columns[0])
        t, x, y = (column[: hdf5.PART] for column in columns[:3])
        unit = facts.unit_of_events(t, x, y, facts.geometry, whole=whole)
        of_frames = frames.unit(facts.unit_of_frames(whole=frames.whole), facts.stated_unit)
        if of_frames.doubt:
            facts.problems.append(f"images: {of_frames.doubt}")
        times = frames.times_ns(of_frames).tolist() if found else []

    shots = [
        Shot(t_ns, f"{path}: {name}", partial(_image, path, name))
        for t_ns, name in zip(times, names, strict=True)
    ]
    return EventFile(
        "monash",
        facts,
        partial(hdf5.parts, path, COLUMNS, facts),
        (lambda: iter(shots)) if shots else None,
        unit_ns=unit.ns,
        times=COLUMNS[0],
    )


def _pixels(path: Path, image: h5py.Dataset) -> tuple[int, ...]:
    """Return the shape of an image; DataError if it is none."""
    shape = tuple(image.shape)
    if len(shape) not in (2, 3) or (len(shape) == 3 and shape[2] not in (1, 3)) or 0 in shape:
        raise DataError(f"{path}: {image.name[1:]} is no image, but of shape {shape}")
    if image.dtype.kind not in "uif":
        raise DataError(f"{path}: {image.name[1:]} is no image, but of {image.dtype}")
    return shape


class _Stamps:
    """Timestamps of the images, from their attributes of one name."""

    def __init__(self, path: Path, images: list[h5py.Dataset]) -> None:
        exact = all("timestamp_ns" in image.attrs for image in images)
        self.name = "timestamp_ns" if exact else "timestamp"
        self._labels = [f"{path}: {image.name}" for image in images]
        pairs = zip(self._labels, images, strict=True)
        self._stamps = [_stamp(label, image, self.name) for label, image in pairs]
        self.whole = all(stamp.dtype.kind != "f" for stamp in self._stamps)

    def unit(self, given: str | None, stated: str | None) -> Unit:
        if self.name == "timestamp_ns":
            return Unit("ns")
        values = [Decimal(stamp.item()) for stamp in self._stamps]
        return frame_unit(values, given=given, stated=stated)

    def times_ns(self, unit: Unit) -> NDArray[np.int64]:
        pairs = zip(self._labels, self._stamps, strict=True)
        ticks = [to_ticks(stamp, unit.ns, NS, f"{label}: {self.name}") for label, stamp in pairs]
        return np.concatenate(ticks)


def _stamp(label: str, image: h5py.Dataset, name: str) -> NDArray[Any]:
    """Return an array of the one number in an attribute."""
    if name in image.attrs:
        stamp = np.asarray(image.attrs[name])
        if stamp.size == 1 and stamp.dtype.kind in "iuf":
            if not np.all(np.isfinite(stamp)):
                raise DataError(f"{label}: {name} holds NaN or infinite times")
            return stamp.reshape(1)
    raise DataError(f"{label} has no attribute timestamp [s]")


def _image(path: Path, name: str) -> Pixels:
    with hdf5.opened(path) as file:
        found = hdf5.dataset(file, name)
        shape = _pixels(path, found)
        image = hdf5.read_all(found, f"{path}: {name}")
    if len(shape) == 3:
        image = image[..., 0] if shape[2] == 1 else image[..., ::-1]
    return Pixels(np.ascontiguousarray(image))
