"""Frames and intervals as compiled code takes them, and the light of a strip of pixels."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from adv2e.compiled import kernel

_f = np.float32


class FrameStack(NamedTuple):
    """Frames of all pixels: light, or grey values with the table that decodes them."""

    light: NDArray[np.float32]  # (frames, pixels) [DN]
    codes: NDArray[np.uint8]  # (frames, pixels)
    table: NDArray[np.float32]  # light of each grey value [DN]
    coded: bool  # whether the grey values count
    plain: bool  # whether the light is the grey value itself


class Schedule(NamedTuple):
    """Frames, and the intervals that a call advances over."""

    frames: FrameStack
    before: NDArray[np.int64]  # the light at each end of the intervals is `share` of the way from
    share: NDArray[np.float32]  # frame `before` to the next; one more looks ahead, where printed
    starts: NDArray[np.float64]  # (intervals + 1,): ends, since the recording's start [us]
    begins: bool  # whether the recording begins here
    # (intervals + 1,), with the paper's last interval as printed: which of them are the last of an
    # input interval (the final entry looks ahead); else all False
    last: NDArray[np.bool_]


class Interval(NamedTuple):
    """One of the intervals [us]."""

    f: int  # its number in the call
    origin: float  # start of the call, from which due times count
    start: float
    length: float


def frames_of(frames: NDArray[Any], table: NDArray[np.float32] | None) -> FrameStack:
    """Return (frames, rows, columns) of light, or of uint8 grey values with their table."""
    flat = frames.reshape(frames.shape[0], -1)
    if table is None:
        light = np.ascontiguousarray(flat, np.float32)
        return FrameStack(
            light, np.empty((1, 1), np.uint8), np.empty(256, np.float32), False, False
        )
    plain = bool(np.array_equal(table, np.arange(256)))
    return FrameStack(np.empty((1, 1), np.float32), np.ascontiguousarray(flat), table, True, plain)


@kernel
def load(frames, before, share, first, floor, out):
    """Fill `out` with the light of the pixels first.., `share` of the way from `before` on."""
    low = _f(floor)
    now, last = before + 1, first + out.shape[0]
    # slices: indices that count from zero need no test of their sign, which vectors bear ill
    if frames.coded and frames.plain and share == _f(1.0):
        codes = frames.codes[now, first:last]
        for k in range(out.shape[0]):
            out[k] = max(_f(codes[k]), low)
    elif frames.coded and share == _f(1.0):
        codes = frames.codes[now, first:last]
        for k in range(out.shape[0]):
            out[k] = max(frames.table[codes[k]], low)
    elif frames.coded:
        codes = frames.codes[now, first:last]
        codes_before = frames.codes[max(before, 0), first:last]
        for k in range(out.shape[0]):
            a = frames.table[codes_before[k]]
            out[k] = max(a + (frames.table[codes[k]] - a) * share, low)
    elif share == _f(1.0):
        light = frames.light[now, first:last]
        for k in range(out.shape[0]):
            out[k] = max(light[k], low)
    else:
        light, light_before = frames.light[now, first:last], frames.light[before, first:last]
        for k in range(out.shape[0]):
            a = light_before[k]
            out[k] = max(a + (light[k] - a) * share, low)
