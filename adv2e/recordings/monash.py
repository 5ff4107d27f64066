"""HDF5 recordings in the layout of ``event_utils`` and ``event_cnn_minimal``.

See :mod:`adv2e.sinks.monash`.  Polarity may be bool, 0/1 or -1/+1; times are seconds (whole
numbers: microseconds); frames come in the order of their names.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from adv2e.errors import DataError
from adv2e.recordings.base import Recording, described_geometry, parse_description
from adv2e.recordings.gather import Gatherer
from adv2e.sources.base import Image
from adv2e.sources.times import seconds_to_ns

COLUMNS = ("events/ts", "events/xs", "events/ys", "events/ps")

_PART = 1 << 20  # events read at once


def read_monash(path: Path, file: h5py.File) -> Recording:
    """Return the recording in an open file of this layout.

    Raises
    ------
    DataError
        Columns of different lengths or kinds, times that are not finite, or a broken image.
    """
    gatherer = Gatherer()
    _gather_events(path, file, gatherer)
    description: dict[str, Any] = {}
    if "adv2e" in file.attrs:
        text = str(file.attrs["adv2e"])
        description = parse_description(text, f"{path}: attribute adv2e", gatherer.problems)
    names = sorted(file["images"]) if "images" in file else []
    times = np.array([_time_ns(path, file["images"], name) for name in names], np.int64)
    geometry, whence = _geometry(file, names), "sensor_resolution"
    if described_geometry(description):
        geometry, whence = described_geometry(description), "the attribute adv2e"
    events, width, height = gatherer.finish(geometry, whence)
    return Recording(
        str(path),
        "monash",
        width,
        height,
        events,
        times if names else None,
        description,
        gatherer.problems,
        lambda: _images(path, names),
    )


def _gather_events(path: Path, file: h5py.File, gatherer: Gatherer) -> None:
    columns = [file[name] for name in COLUMNS]
    if len({column.shape for column in columns}) != 1 or columns[0].ndim != 1:
        shapes = ", ".join(f"{name} {file[name].shape}" for name in COLUMNS)
        raise DataError(f"{path}: columns must be of one length, got {shapes}")
    for name, column, kinds in zip(COLUMNS, columns, ("fiu", "iu", "iu", "biuf"), strict=True):
        if column.dtype.kind not in kinds:
            raise DataError(f"{path}: {name} must hold numbers, not {column.dtype}")
    for begin in range(0, columns[0].size, _PART):
        t, x, y, p = (column[begin : begin + _PART] for column in columns)
        gatherer.add(_microseconds(path, t), x, y, p.astype(np.int8))
    if columns[0].size and columns[0].dtype.kind in "iu":
        gatherer.problems.append("times are whole numbers: taken as microseconds")


def _microseconds(path: Path, t: NDArray[Any]) -> NDArray[np.int64]:
    if t.dtype.kind in "iu":
        return t.astype(np.int64)
    if not np.all(np.isfinite(t)):
        raise DataError(f"{path}: events/ts holds NaN or infinite times")
    whole = np.floor(t.astype(np.float64))
    # the fraction is exact in float64, while t * 1e6 would round a second time
    part = np.rint((t - whole) * 1e6)
    return whole.astype(np.int64) * 1_000_000 + part.astype(np.int64)


def _geometry(file: h5py.File, names: list[str]) -> tuple[int, int] | None:
    """Return (width, height) as the attribute or the first image has it."""
    stated = np.atleast_1d(file.attrs.get("sensor_resolution", ()))
    if stated.size >= 2 and stated.dtype.kind in "iuf" and np.all(stated[:2] > 0):
        return int(stated[1]), int(stated[0])
    if names:
        rows, columns = file["images"][names[0]].shape[:2]
        return columns, rows
    return None


def _time_ns(path: Path, images: h5py.Group, name: str) -> int:
    attributes = images[name].attrs
    if "timestamp_ns" in attributes:
        return int(attributes["timestamp_ns"])
    try:
        return int(seconds_to_ns(np.array([float(attributes["timestamp"])]))[0])
    except (KeyError, ValueError, TypeError):
        raise DataError(f"{path}: images/{name} has no attribute timestamp [s]") from None


def _images(path: Path, names: list[str]) -> Iterator[Image]:
    with h5py.File(path, "r") as file:
        for name in names:
            image = np.asarray(file["images"][name][()])
            if image.ndim == 3 and image.shape[2] == 1:
                image = image[..., 0]
            if image.ndim not in (2, 3) or (image.ndim == 3 and image.shape[2] != 3):
                raise DataError(f"{path}: images/{name} is no image, but of shape {image.shape}")
            yield np.ascontiguousarray(image[..., ::-1]) if image.ndim == 3 else image
