"""Stacks of frames in a ``.npy`` file: (frames, rows, columns) or (frames, rows, columns, 3) RGB.

Times come from the command line or from beside the file:
``<stem>_ts.npy`` or ``<stem>.timestamps.txt`` (one time a line).
"""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from decimal import Decimal
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.effects.frames.encoding import full_scale_of
from adv2e.errors import DataError
from adv2e.files.regular import reading
from adv2e.files.zips import Header, read_array, read_header
from adv2e.sources.base import GivenTimes, Selection
from adv2e.sources.frame import Frame, check_pixels
from adv2e.sources.listed import ListedSource, Picture, Timed, timed
from adv2e.sources.times.lists import FrameList, read_list
from adv2e.sources.times.rates import Stamp, frame_unit
from adv2e.ticks import NS, to_ticks


def open_source(path: Path, given: GivenTimes, selection: Selection) -> ListedSource:
    """Return the frames of a stack.

    Raises
    ------
    DataError
        Not a stack of frames, no times, or another number of times than of frames.
    """
    stack = _open_stack(path)
    pictures = [
        Picture(f"{path}: frame {number}", None, partial(stack.read, number))
        for number in range(stack.count)
    ]
    if not pictures:
        raise DataError(f"{path}: no frames in it; at least two are needed")
    times = timed_beside(path, given, pictures)
    return ListedSource(path, "npy", times, selection, has_clock=given.fps is None)


def timed_beside(path: Path, given: GivenTimes, pictures: Sequence[Picture]) -> Timed:
    """Return the frames of a file at the times given, or at those in a file beside it."""
    beside = f"{path.stem}_ts.npy", f"{path.stem}.timestamps.txt"
    found = next((f for f in map(path.with_name, beside) if f.is_file()), None)
    label = None if found is None else str(found)
    missing = f"{' or '.join(beside)} beside it"
    return timed(given, pictures, path, label, partial(_read_times, given), missing)


def _open_stack(path: Path) -> _Stack:
    with reading(path), path.open("rb") as file:
        header = read_header(file, os.fstat(file.fileno()).st_size, str(path))
    shape = header.shape
    if len(shape) not in (3, 4) or (len(shape) == 4 and shape[3] != 3) or 0 in shape[1:]:
        raise DataError(
            f"{path}: an array of shape {shape}; expected (frames, rows, columns) or (frames, rows,"
            " columns, 3), without alpha"
        )
    check_pixels(shape[2], shape[1], str(path))
    try:
        full_scale_of(header.dtype)
    except DataError as error:
        raise DataError(f"{path}: {error}") from error
    return _Stack(path, header)


class _Stack:
    """The frames of a file, read one by one, or all at once where their pixels lie apart.

    Not through a mapping: what was read of it would count as memory of this process, and a file
    that is cut short meanwhile would end the program.
    """

    def __init__(self, path: Path, header: Header) -> None:
        self.count, *self._shape = header.shape
        self._path, self._header = path, header
        self._whole: NDArray[Any] | None = None

    def read(self, number: int) -> Frame:
        """Return a frame in the machine's byte order; DataError if it is not there."""
        header, label = self._header, f"{self._path}: frame {number}"
        with reading(label):
            if header.fortran:
                if self._whole is None:
                    self._whole = _read_whole(self._path)
                image = self._whole[number]
            else:
                size = math.prod(self._shape)
                begin = header.begin + number * size * header.dtype.itemsize
                image = np.fromfile(self._path, header.dtype, size, offset=begin)
                if image.size < size:
                    raise DataError(f"{label}: cut short while it was read")
        native = header.dtype.newbyteorder("=")
        return Frame(np.require(image.reshape(self._shape), native, ["C"]))


def _read_whole(path: Path) -> NDArray[Any]:
    with path.open("rb") as file:
        return read_array(file, os.fstat(file.fileno()).st_size, str(path))


def _read_times(given: GivenTimes, name: str) -> FrameList:
    file = Path(name)
    if file.suffix != ".npy":
        return read_list(file, time_unit=given.time_unit)
    with reading(file):
        times = _read_whole(file)
    if times.ndim != 1 or times.dtype.kind not in "iuf" or times.dtype.itemsize < 8:
        raise DataError(
            f"{file}: {times.dtype.name} of shape {times.shape}; expected float64 or int64, one"
            " time a frame"
        )
    if not np.all(np.isfinite(times)):
        raise DataError(f"{file} holds NaN or infinite times")
    unit = frame_unit([Decimal(time) for time in times.tolist()], given=given.time_unit)
    times_ns = to_ticks(times, unit.ns, NS, f"{file}").tolist()
    stamps = [Stamp(t_ns, number, None) for number, t_ns in enumerate(times_ns)]
    return FrameList(stamps, f"time [{unit.name}]", unit)
