"""Courses: gains, signals, thresholds and events that effects add to the pixels, by time.

Times are in seconds on the recording's clock, that of the frames.  Between the ends of a step every
course is a straight line.  A course gives one value a time, (n, 1), for all pixels alike, or one a
time and pixel, (n, pixels), pixels in row-major order.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.causes import FRAME_COUPLING

LONGEST_US = 100.0
"""Longest step in which the circuit is solved, and courses are followed unless they say more."""

Course = Callable[[NDArray[np.float64]], NDArray[np.float64]]
"""Function from times [s], (n,), to values, (n, 1) or (n, pixels)."""

StepLimit = Callable[[float, float], float]
"""Function from two times [s] to the longest step that resolves the courses between them [us]."""

Injection = Callable[[float, float], NDArray[Any]]
"""Function from t0, t1 [s] to the events in [t0, t1), as INJECTED_DTYPE, sorted by time."""

INJECTED_DTYPE = np.dtype([("t", "<f8"), ("x", "<u2"), ("y", "<u2"), ("p", "u1")])
"""Events to be injected: time [s], column, row, polarity (1 ON, 0 OFF)."""


@dataclass(frozen=True, kw_only=True)
class Additions:
    """Courses that act on all pixels of a camera; None: nothing.

    Attributes
    ----------
    longest_step_us : StepLimit
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
    cause : int
        Cause of events by `signal`.
    """

    longest_step_us: StepLimit
    gain: Course | None = None
    drive: Course | None = None
    signal: Course | None = None
    on: Course | None = None
    off: Course | None = None
    inject: Injection | None = None
    cause: int = FRAME_COUPLING
