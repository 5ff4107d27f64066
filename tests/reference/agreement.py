"""Compare the events of two solvers, pixel by pixel."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from reference.circuit import Array


class Agreement(NamedTuple):
    """How two solvers' events differ.

    Attributes
    ----------
    count_a, count_b : int
        Events compared.
    left_out : int
        Events of b that were not compared, as they come after their pixel's `until`.
    differing : list of int
        Pixels with another number of events or another sequence of polarities.
    max_dt_us : float
        Largest time difference [us] over the other pixels (0 without events).
    mean_dt_us : float
        Mean of the absolute time difference [us] over the other pixels (0 without events).
    worst_pixel : int
        Where the largest one is; -1 without events.
    """

    count_a: int
    count_b: int
    left_out: int
    differing: list[int]
    max_dt_us: float
    mean_dt_us: float
    worst_pixel: int


def count_and_time_errors(
    events_a: Sequence[Array], events_b: Sequence[Array], until: ArrayLike | None = None
) -> Agreement:
    """Compare two lists of events, one array a pixel.

    Parameters
    ----------
    events_a, events_b : per pixel, (events, 2)
        Time [s] and polarity (above 0 is ON), in order of time; b is the truth.
    until : (pixels,), optional
        Only events before this time [s] are compared (``valid_until`` of the dense ODE's truth).
    """
    assert len(events_a) == len(events_b), "different numbers of pixels"
    limits = np.broadcast_to(np.inf if until is None else until, len(events_a))
    differing: list[int] = []
    count_a = count_b = left_out = compared = 0
    total = worst = 0.0
    worst_pixel = -1
    for i, (a, b, limit) in enumerate(zip(events_a, events_b, limits, strict=True)):
        a, kept = a[a[:, 0] < limit], b[b[:, 0] < limit]  # noqa: PLW2901
        count_a, count_b = count_a + len(a), count_b + len(kept)
        left_out += len(b) - len(kept)
        if not np.array_equal(a[:, 1] > 0, kept[:, 1] > 0):
            differing.append(i)
        elif len(a):
            dt = np.abs(a[:, 0] - kept[:, 0]) * 1e6
            total, compared = total + dt.sum(), compared + len(dt)
            if dt.max() >= worst:
                worst, worst_pixel = float(dt.max()), i
    mean = float(total) / compared if compared else 0.0
    return Agreement(count_a, count_b, left_out, differing, worst, mean, worst_pixel)


def split_by_pixel(
    t_s: ArrayLike, pixel: ArrayLike, polarity: ArrayLike, pixels: int
) -> list[Array]:
    """Turn columns of events into one (events, 2) array a pixel, each in order of time.

    Parameters
    ----------
    t_s, pixel, polarity : (events,)
        Time [s], index of the pixel, polarity (above 0 is ON); in any order.
    pixels : int
        Number of pixels.
    """
    t, index = np.asarray(t_s, np.float64), np.asarray(pixel, np.int64)
    sign = np.where(np.asarray(polarity, np.float64) > 0, 1.0, -1.0)
    order = np.lexsort((t, index))
    rows = np.column_stack([t, sign])[order]
    return np.split(rows, np.searchsorted(index[order], np.arange(1, pixels)))


def split_events(events: Any, width: int, pixels: int) -> list[Array]:
    """Turn structured events (t [us], x, y, p) into one (events, 2) array a pixel."""
    index = events["y"].astype(np.int64) * width + events["x"]
    return split_by_pixel(events["t"] * 1e-6, index, events["p"], pixels)
