"""What the solvers are given: the circuit, frames, and intervals; and the light of a strip.

All are named tuples of the same types whatever is switched on, so that switching an effect compiles
nothing.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from adv2e.compiled import kernel

_f = np.float32
_BLOCK = 256

# codes of the update forms
EXACT, FIRST_ORDER_HOLD, ZERO_ORDER_HOLD, EULER, PAPER = range(5)


class Circuit(NamedTuple):
    """Parameters that all pixels and intervals share.  Times in us, rates in 1/us, light in DN."""

    update: int  # EXACT ... PAPER
    steps: int  # K
    printed: bool  # whether the last interval is sampled as the paper prints it
    filtered: bool  # whether there is a low-pass
    dark: float  # 2 pi dark_cutoff
    per_dn: float  # 2 pi (cutoff - dark_cutoff) / 255
    slew: float  # fastest change of the first pole a us; 0: no limit
    follower: float  # 2 pi cutoff of the second pole; 0: none
    high: float  # 2 pi cutoff of the high-pass behind both; 0: none
    knee: float  # log intensity at the knee; below it, light = slope x
    slope: float  # d light / d x below the knee; 0: no knee
    floor: float  # least light where there is no knee
    dead_time: float  # 0: none
    overshoot: float  # share of the threshold by which the reference goes on at an event
    leak: float  # leak events a us from junction leakage
    photo_leak: float  # the same a us and DN
    leak_jitter: float
    shot_rate: float  # candidates a us
    shot_fall: float  # share of them that is lost, a DN
    hot_rate: float  # events of the median hot pixel a us
    hot_spread: float  # standard deviation of the logarithm of that over the hot pixels
    hot_off: float  # share of them whose events are OFF
    noise_rms: float  # photoreceptor noise
    noise_step: float
    causes: bool  # whether events know their causes
    added: int  # cause of events by what is added to the signal
    seed: np.uint64


def fastest_corner(circuit: Circuit, brightest: float = 255.0) -> float:
    """Return the fastest corner of the low-pass, `brightest` [DN] being the most light [rad/us]."""
    return max(circuit.dark + brightest * circuit.per_dn, circuit.dark)


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


@kernel
def _alike(a, b):
    """Tell whether two rows of whole numbers are equal."""
    changes = a.dtype.type(0)
    for k in range(a.shape[0]):
        # narrow on purpose: as many at a time as there are in a vector
        changes = a.dtype.type(changes | a.dtype.type(a[k] ^ b[k]))
    return changes == 0


@kernel
def rests(schedule, at, first, count):
    """Tell whether the frames on both sides of an instant are the same for a strip."""
    frames, before = schedule.frames, schedule.before[at]
    for lo in range(first, first + count, _BLOCK):
        hi = min(lo + _BLOCK, first + count)
        # slices: indices that count from zero need no test of their sign, which vectors bear ill
        if frames.coded:
            same = _alike(frames.codes[before, lo:hi], frames.codes[before + 1, lo:hi])
        else:
            a, b = frames.light[before, lo:hi], frames.light[before + 1, lo:hi]
            same = _alike(a.view(np.int32), b.view(np.int32))
        if not same:
            return False
    return True
