"""Lines and bands through points, as paths of SVG; gaps where there is no number."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from adv2e.reports.charts.axes import Floats

_MOST_POINTS = 1000
"""Longer curves are thinned to what a picture of this size can show."""
_COLUMN = 0.5
"""Width of the columns that they are thinned to."""


def points_of(x: Floats, values: Floats) -> tuple[Floats, Floats]:
    """Return the points to join: those given, or, for borders of bins, the corners of steps.

    Parameters
    ----------
    x : (n,) or (n + 1,)
    values : (n,)
    """
    if len(x) == len(values):
        return x, values
    return np.repeat(x, 2)[1:-1], np.repeat(values, 2)


def line(xs: Floats, ys: Floats) -> str:
    """Return the path through the points; a point between gaps becomes a short dash.

    Parameters
    ----------
    xs, ys : (n,)
        Places in the picture; where one is NaN, there is a gap.
    """
    if len(xs) > _MOST_POINTS:
        columns, starts = _columns(xs)
        low, high = np.fmin.reduceat(ys, starts), np.fmax.reduceat(ys, starts)
        xs, ys = np.repeat(columns, 2), np.ravel(np.column_stack([low, high]))
    return "".join(_joined(x, y) if len(x) > 1 else _dash(x[0], y[0]) for x, y in _runs(xs, ys))


def band(xs: Floats, low: Floats, high: Floats) -> str:
    """Return the closed path around the area from `low` to `high`; (n,) each, as in `line`."""
    if len(xs) > _MOST_POINTS:
        xs, starts = _columns(xs)
        # upwards is towards smaller numbers in a picture, so neither end is the lesser one
        ends = np.stack([low, high])
        low = np.fmax.reduceat(np.fmax(*ends), starts)
        high = np.fmin.reduceat(np.fmin(*ends), starts)
    paths = []
    for x, below, above in _runs(xs, low, high):
        if len(x) == 1:
            x = x[0] + np.array([-2.0, 2.0])  # noqa: PLW2901 - a lone point is a narrow band
            below, above = np.repeat(below, 2), np.repeat(above, 2)  # noqa: PLW2901
        around = np.concatenate([x, x[::-1]]), np.concatenate([above, below[::-1]])
        paths.append(f"{_joined(*around)}Z")
    return "".join(paths)


def _columns(xs: Floats) -> tuple[Floats, np.ndarray[tuple[int], np.dtype[np.intp]]]:
    """Return the places of the columns that hold points, and the first point of each."""
    column = np.floor(xs / _COLUMN)
    starts = np.flatnonzero(np.r_[True, column[1:] != column[:-1]])
    return (column[starts] + 0.5) * _COLUMN, starts


def _runs(xs: Floats, *rows: Floats) -> Iterator[tuple[Floats, ...]]:
    """Yield the parts between gaps."""
    table = np.stack([xs, *rows])
    there = np.isfinite(table).all(axis=0)
    edges = np.flatnonzero(np.diff(np.r_[False, there, False].astype(np.int8)))
    for first, stop in zip(edges[::2], edges[1::2], strict=True):
        yield tuple(table[:, first:stop])


def _joined(xs: Floats, ys: Floats) -> str:
    return "M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in zip(xs, ys, strict=True))


def _dash(x: float, y: float) -> str:
    return f"M{x - 2:.1f} {y:.1f}L{x + 2:.1f} {y:.1f}"
