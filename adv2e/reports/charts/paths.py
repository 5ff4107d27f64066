"""Lines and bands through points, as paths of SVG; gaps where there is no number."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from adv2e.reports.charts.axes import Floats


def points_of(x: Floats, values: Floats) -> tuple[Floats, Floats]:
    """Return the points to join, (n,): those given, or, for borders (n + 1,), corners of steps."""
    if len(x) == len(values):
        return x, values
    return np.repeat(x, 2)[1:-1], np.repeat(values, 2)


def line(xs: Floats, ys: Floats) -> str:
    """Return the path through points in the picture; one between gaps becomes a short dash."""
    return "".join(_joined(x, y) for x, y in _runs(xs, ys))


def band(xs: Floats, low: Floats, high: Floats) -> str:
    """Return the closed path around the area from `low` to `high`."""
    paths = []
    for x, below, above in _runs(xs, low, high):
        around = np.concatenate([x, x[::-1]]), np.concatenate([above, below[::-1]])
        paths.append(f"{_joined(*around)}Z")
    return "".join(paths)


def _runs(xs: Floats, *rows: Floats) -> Iterator[tuple[Floats, ...]]:
    """Yield the parts between gaps, a lone point as two that are near."""
    table = np.stack([xs, *rows])
    there = np.isfinite(table).all(axis=0)
    edges = np.flatnonzero(np.diff(np.r_[False, there, False].astype(np.int8)))
    for first, stop in zip(edges[::2], edges[1::2], strict=True):
        run = table[:, first:stop]
        if stop - first == 1:
            run = np.repeat(run, 2, axis=1)
            run[0] += (-2.0, 2.0)
        yield tuple(run)


def _joined(xs: Floats, ys: Floats) -> str:
    return "M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in zip(xs, ys, strict=True))
