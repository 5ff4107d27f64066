"""Timestamps as whole numbers of 64 bits, from the number types of files: conversion and check.

Frames are timed in nanoseconds and events in microseconds.  Half of the range of 64 bits is the
limit for both, so that no difference and no offset of two times leaves them.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.errors import DataError

LARGEST_NS = 2**62
"""Largest time, before or after zero: 146 years [ns]."""

NS, US, S = 1, 1000, 10**9
"""Units [ns]."""


def to_ticks(times: NDArray[Any], unit_ns: int, tick_ns: int, label: str) -> NDArray[np.int64]:
    """Return times as whole ticks, to the nearest.

    Parameters
    ----------
    times : array of integers or floats
        In units of `unit_ns`.
    unit_ns, tick_ns : int
        Unit of `times`, and of what is returned [ns]; one is a multiple of the other.
    label : str
        What they are called, for messages: file and column.

    Returns
    -------
    array of int64
        Floats lose no more than they hold: what is behind the point is scaled by itself.

    Raises
    ------
    DataError
        No numbers, NaN, infinite, or more than 146 years before or after zero.
    """
    check_numbers(times, unit_ns, label)
    return in_ticks(times, unit_ns, tick_ns)


def in_ticks(times: NDArray[Any], unit_ns: int, tick_ns: int) -> NDArray[np.int64]:
    """Return the ticks of times that were checked, as :func:`to_ticks` does."""
    if unit_ns < tick_ns:
        ticks = tick_ns // unit_ns
        if times.dtype.kind == "f":
            return np.rint(times.astype(np.float64) / ticks).astype(np.int64)
        return (times.astype(np.int64) + ticks // 2) // ticks
    ticks = unit_ns // tick_ns
    if times.dtype.kind != "f":
        return times.astype(np.int64) * ticks
    wide = times.astype(np.float64)
    whole = np.floor(wide)
    # the fraction is exact in float64, while t * ticks would round a second time
    return whole.astype(np.int64) * ticks + np.rint((wide - whole) * ticks).astype(np.int64)


def check_numbers(times: NDArray[Any], unit_ns: int, label: str) -> None:
    """Raise DataError, which begins with `label`, for what :func:`to_ticks` does not take."""
    if times.dtype.kind not in "iuf":
        raise DataError(f"{label} must hold numbers, not {times.dtype}")
    if times.size:
        for extreme in (times.min(), times.max()):  # NaN, if there is one, is both
            if not np.isfinite(extreme):
                raise DataError(f"{label} holds NaN or infinite times")
            check_time(extreme.item() * unit_ns, label)


def check_time(t_ns: float, label: str) -> None:
    """Raise DataError, which begins with `label`, if a time [ns] is beyond the limit."""
    if abs(t_ns) > LARGEST_NS:
        shown = f"{t_ns / 1e9:.6g}" if abs(t_ns) < 1e300 else "over 1e290"
        raise DataError(
            f"{label}: a time of {shown} s; 146 years before or after zero are the most (is it in"
            " another unit?)"
        )


def check_us(times_us: NDArray[np.int64], label: str) -> None:
    """Apply :func:`check_time` to an array of times [us]."""
    if times_us.size:
        for extreme in (times_us.min(), times_us.max()):
            check_time(int(extreme) * US, label)


def microseconds(t_ns: Any) -> Any:
    """Return times of frames, a number or an array, in the unit of events, rounded as theirs."""
    return (t_ns + 500) // 1000
