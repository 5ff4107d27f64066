"""What the two drivers of a tile share: frames and scratch memory.

A tile is some strips of pixels over several intervals, those that one call of a driver claims
(:mod:`adv2e.kernel.work_queue`).  :mod:`adv2e.kernel.exact` advances the circuit
that :mod:`adv2e.kernel.screen` covers, :mod:`adv2e.kernel.stepped` all others; both go strip by
strip, and each strip through all of its intervals.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from adv2e.compiled import kernel
from adv2e.kernel import screen
from adv2e.kernel.lanes import rows as lane_rows
from adv2e.kernel.stepped import rows as step_rows
from adv2e.kernel.workspace import STRIP

_f = np.float32


class Scratch(NamedTuple):
    """Memory of whoever works on a tile."""

    rows: NDArray[np.float32]  # of the screen
    lanes: NDArray[np.float64]
    pixels: NDArray[np.int64]  # numbers of the lanes' pixels
    falls: NDArray[np.float64]
    means: NDArray[np.float64]
    stepped: NDArray[np.float64]  # of the stepping path
    normals: NDArray[np.float64]


class Frames(NamedTuple):
    """Frames of all pixels: light, or grey values with the table that decodes them."""

    light: NDArray[np.float32]  # (frames, pixels) [DN]
    codes: NDArray[np.uint8]  # (frames, pixels)
    table: NDArray[np.float32]  # light of each grey value [DN]
    coded: bool  # whether the grey values count
    plain: bool  # whether the light is the grey value itself


def frames_of(frames: NDArray[Any], table: NDArray[np.float32] | None) -> Frames:
    """Return (frames, rows, columns) of light, or of uint8 grey values with their table."""
    flat = frames.reshape(frames.shape[0], -1)
    if table is None:
        light = np.ascontiguousarray(flat, np.float32)
        return Frames(light, np.empty((1, 1), np.uint8), np.empty(256, np.float32), False, False)
    plain = bool(np.array_equal(table, np.arange(256)))
    return Frames(np.empty((1, 1), np.float32), np.ascontiguousarray(flat), table, True, plain)


def scratch() -> Scratch:
    """Return fresh scratch memory."""
    return Scratch(
        rows=screen.scratch(),
        lanes=lane_rows.scratch(),
        pixels=lane_rows.pixel_numbers(),
        falls=np.zeros(STRIP),
        means=np.zeros(STRIP),
        stepped=step_rows.scratch(),
        normals=step_rows.normals(),
    )


@kernel
def load(frames, before, share, first, count, floor, strip):
    """Row LIGHT_1: `share` of the way from frame `before` to the next, for a strip."""
    low, row = _f(floor), screen.LIGHT_1
    now, last = before + 1, first + count
    # slices: indices that count from zero need no test of their sign, which vectors bear ill
    if frames.coded and frames.plain and share == _f(1.0):
        codes = frames.codes[now, first:last]
        for k in range(count):
            strip[row + k] = max(_f(codes[k]), low)
    elif frames.coded and share == _f(1.0):
        codes = frames.codes[now, first:last]
        for k in range(count):
            strip[row + k] = max(frames.table[codes[k]], low)
    elif frames.coded:
        codes = frames.codes[now, first:last]
        codes_before = frames.codes[max(before, 0), first:last]
        for k in range(count):
            a = frames.table[codes_before[k]]
            strip[row + k] = max(a + (frames.table[codes[k]] - a) * share, low)
    elif share == _f(1.0):
        light = frames.light[now, first:last]
        for k in range(count):
            strip[row + k] = max(light[k], low)
    else:
        light, light_before = frames.light[now, first:last], frames.light[before, first:last]
        for k in range(count):
            a = light_before[k]
            strip[row + k] = max(a + (light[k] - a) * share, low)
