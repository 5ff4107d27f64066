"""Stacks of frames in a ``.npy`` file: (frames, rows, columns) or (frames, rows, columns, 3) RGB.

Frames are read one by one.  Times come from the command line or from beside the file:
``<stem>_ts.npy`` (float64 seconds) or ``<stem>.timestamps.txt`` (one time [s] a line).
"""

from __future__ import annotations

import math
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from adv2e.effects.frames.encoding import full_scale_of
from adv2e.errors import DataError
from adv2e.sources.base import GivenTimes, Image, Light, Selection
from adv2e.sources.listed import ListedSource, Picture, given_shots, listed_shots
from adv2e.sources.times import Stamp, parse_times, read_text, seconds_to_ns

_LIGHT = Light("linear", "a .npy stack")


def open_source(path: Path, given: GivenTimes, selection: Selection) -> ListedSource:
    """Return the frames of a stack.

    Raises
    ------
    DataError
        Not a stack of frames, no times, or another number of times than of frames.
    """
    stack = _open_stack(path)
    found = _found_times(path)
    pictures = [
        Picture(f"{path}: frame {number}", None, partial(_read, path, stack, number))
        for number in range(stack.shape[0])
    ]
    if not pictures:
        raise DataError(f"{path}: no frames in it; at least two are needed")
    if given:
        shots = given_shots(given, pictures, path)
    elif found is not None:
        shots = listed_shots(_read_times(found), str(found), pictures, path)
    else:
        raise DataError(
            f"{path}: when are the frames? give --fps F or --timestamps FILE, or put"
            f" {path.stem}_ts.npy or {path.stem}.timestamps.txt beside it"
        )
    source = ListedSource(path, "npy", shots, selection, has_clock=given.fps is None, light=_LIGHT)
    if found is not None:
        source.notes.append(
            f"{given} replaces the times in {found}" if given else f"times from {found}"
        )
    return source


def _open_stack(path: Path) -> np.memmap[Any, Any]:
    try:
        stack: np.memmap[Any, Any] = np.load(path, mmap_mode="r", allow_pickle=False)
    except (ValueError, EOFError, OSError) as error:
        raise DataError(f"{path}: not a .npy array that can be read, or cut short") from error
    shape = stack.shape
    if not (stack.ndim == 3 or (stack.ndim == 4 and shape[3] == 3)) or 0 in shape[1:]:
        raise DataError(
            f"{path}: an array of shape {shape}; expected (frames, rows, columns) or (frames, rows,"
            " columns, 3)"
        )
    try:
        full_scale_of(stack.dtype)
    except DataError as error:
        raise DataError(f"{path}: {error}") from error
    return stack


def _read(path: Path, stack: np.memmap[Any, Any], number: int) -> Image:
    """Return a frame in the machine's byte order."""
    native = stack.dtype.newbyteorder("=")
    if not stack.flags.c_contiguous:  # frame by frame, it is all over the file
        return np.array(stack[number], dtype=native, order="C")
    # not through the mapping: what was read of it would count as memory of this process
    shape = stack.shape[1:]
    pixels = math.prod(shape)
    offset = stack.offset + number * pixels * stack.itemsize
    try:
        image = np.fromfile(path, stack.dtype, pixels, offset=offset)
    except OSError as error:
        raise DataError(f"{path}: frame {number}: {error.strerror or error}") from error
    if image.size < pixels:
        raise DataError(f"{path}: frame {number}: cut short while it was read")
    return image.reshape(shape).astype(native, copy=False)


def _found_times(path: Path) -> Path | None:
    beside = (path.with_name(f"{path.stem}_ts.npy"), path.with_name(f"{path.stem}.timestamps.txt"))
    return next((file for file in beside if file.is_file()), None)


def _read_times(file: Path) -> list[Stamp]:
    if file.suffix != ".npy":
        return parse_times(read_text(file), str(file))
    try:
        times = np.load(file, allow_pickle=False)
    except (ValueError, EOFError, OSError) as error:
        raise DataError(f"{file}: not a .npy array that can be read, or cut short") from error
    if times.ndim != 1 or times.dtype.kind != "f" or times.dtype.itemsize < 8:
        raise DataError(
            f"{file}: {times.dtype.name} of shape {times.shape}; expected float64 seconds, one a"
            " frame"
        )
    if not np.all(np.isfinite(times)) or np.any(np.abs(times) > 9e9):
        raise DataError(f"{file}: times that are not finite seconds")
    times_ns = seconds_to_ns(times.astype(np.float64)).tolist()
    return [Stamp(t_ns, number, None) for number, t_ns in enumerate(times_ns)]
