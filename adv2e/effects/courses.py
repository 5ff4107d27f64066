"""What effects outside the kernel add to the pixels, as functions of time.

Times are in seconds on the recording's clock, that of the frames.  The pixels go through the
recording in steps of at most ``step_us``; between the ends of a step every course is a straight
line.  A course gives one value a time, (n,), for all pixels alike, or one a time and pixel,
(n, pixels), pixels in row-major order.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.errors import DataError

LONGEST_US = 100.0
"""Longest step in which the circuit is solved, and courses are followed unless they say more."""

Course = Callable[[NDArray[np.float64]], NDArray[np.float64]]
"""From times [s], (n,), to values, (n,) or (n, pixels)."""

StepLimit = Callable[[float, float], float]
"""From two times [s] to the longest step that resolves the courses between them [us]."""

Injection = Callable[[float, float], NDArray[Any]]
"""From t0, t1 [s] to the events in [t0, t1), as INJECTED_DTYPE, sorted by time."""

INJECTED_DTYPE = np.dtype([("t", "<f8"), ("x", "<u2"), ("y", "<u2"), ("p", "u1")])
"""Events to be injected: time [s], column, row, polarity (1 ON, 0 OFF)."""


@dataclass(frozen=True, kw_only=True)
class Additions:
    """Courses that act on all pixels of a camera; None: nothing.

    Attributes
    ----------
    step_us : float or StepLimit
        Longest step that resolves the courses [us].
    gain : Course, optional
        Factors on the light between the frames, above 0; corner, leak and shot noise follow them.
    drive : Course, optional
        Added to the log intensity before the poles [ln units].  The corner of the low-pass, leak
        and shot noise follow the light without it.
    signal : Course, optional
        Added behind all poles [ln units].
    on, off : Course, optional
        Factors on the thresholds, above 0.
    inject : Injection, optional
        Events that fire whenever their pixel is not in its dead time, as those of hot pixels do.
    """

    step_us: float | StepLimit
    gain: Course | None = None
    drive: Course | None = None
    signal: Course | None = None
    on: Course | None = None
    off: Course | None = None
    inject: Injection | None = None

    def __post_init__(self) -> None:
        if not callable(self.step_us) and not self.step_us > 0:
            raise DataError(f"step_us: must be above 0 us, got {self.step_us!r}")

    def longest_step_us(self, start_s: float, stop_s: float) -> float:
        """Return the longest step that resolves the courses between two times [us]."""
        return self.step_us(start_s, stop_s) if callable(self.step_us) else self.step_us


def values_of(
    course: Course, name: str, times_s: NDArray[np.float64], pixels: int, *, above: float = -np.inf
) -> NDArray[np.float64]:
    """Return a course at `times_s` (n,) as a contiguous array, (n, 1) or (n, pixels).

    Raises
    ------
    DataError
        Another shape, numbers that are not finite, or not above `above`.
    """
    values = np.asarray(course(times_s), np.float64)
    n = times_s.size
    if values.shape not in {(n,), (n, pixels)}:
        raise DataError(
            f"{name}: shape {values.shape} at {n} times, must be ({n},) or ({n}, {pixels})"
        )
    if not np.all(np.isfinite(values) & (values > above)):
        limit = f" above {above:g}" if above > -np.inf else ""
        raise DataError(f"{name}: all values must be finite numbers{limit}")
    return np.ascontiguousarray(values.reshape(n, -1))


def injection_complaint(
    found: NDArray[Any], start_s: float, stop_s: float, rows: int, columns: int
) -> str | None:
    """Return what is wrong with events injected from `start_s` to before `stop_s`, or None.

    Parameters
    ----------
    found : array
        What an injection returned.
    start_s, stop_s : float
        [s]
    rows, columns : int
        Of the sensor.
    """
    if found.dtype != INJECTED_DTYPE or found.ndim != 1:
        return f"must be (n,) of INJECTED_DTYPE, got {found.dtype} of shape {found.shape}"
    times = found["t"]
    inside = (times >= start_s) & (times < stop_s)
    if not (np.all(inside) and np.all(times[1:] >= times[:-1])):
        return f"times must be sorted and from {start_s:.6f} s to before {stop_s:.6f} s"
    if np.any(found["x"] >= columns) or np.any(found["y"] >= rows):
        return f"x must be below {columns} and y below {rows}"
    return None
