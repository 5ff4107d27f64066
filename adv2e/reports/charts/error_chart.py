"""The errors before and after, beside the floor, as a picture (SVG): dots and intervals."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from adv2e.reports.charts.axes import LINE_HEIGHT, Axis, place_text, rule, wrapped
from adv2e.reports.charts.ticks import linear_ticks, tick_labels
from adv2e.reports.markup import Markup, join, tag
from adv2e.reports.quantities import estimate_text
from adv2e.reports.result import ROLES, ErrorRow, Estimate

WIDTH = 720
_START, _END, _VALUES = 130, 520, 536
_LINE = 17
_SHAPES = {
    "before": "M0 -6L6 0L0 6L-6 0Z",
    "after": "M-5 0A5 5 0 1 1 5 0A5 5 0 1 1 -5 0Z",
    "floor": "M-4.5 -4.5H4.5V4.5H-4.5Z",
}


def error_chart(rows: Sequence[ErrorRow]) -> Markup:
    """Return one row a measure: error before, after, and floor, relative to the one before.

    Measures have units of their own, so that only shares compare; the numbers stand beside them.
    """
    largest = max((_largest(row) for row in rows if _has_scale(row)), default=math.nan)
    if math.isnan(largest):
        return Markup()
    axis = Axis(0.0, 1.04 * largest, _START, _END)
    parts, y = [], 6.0
    for row in rows:
        row_parts, y = _row(row, axis, y)
        parts.append(row_parts)
    ticks = linear_ticks(axis.low, axis.high)
    grid = []
    for tick, label in zip(ticks, tick_labels(ticks), strict=True):
        x = axis.at(tick)
        grid.append(rule(x, 6, x, y + 4, "one" if tick == 1 else "grid"))
        grid.append(place_text(x, y + 18, label, text_anchor="middle"))
    middle = (_START + _END) / 2
    caption = "error relative to that of the declared model"
    grid.append(place_text(middle, y + 36, caption, text_anchor="middle", class_="label"))
    title = tag("title", "Errors before and after, and floor; the numbers stand below")
    view = f"0 0 {WIDTH} {y + 44:.0f}"
    return tag("svg", title, *grid, *parts, viewBox=view, role="img", class_="wide")


def _row(row: ErrorRow, axis: Axis, y: float) -> tuple[Markup, float]:
    """Return one measure and where the next begins."""
    parts = []
    for line in wrapped(row.name, WIDTH):
        y += LINE_HEIGHT
        parts.append(place_text(0, y, line, class_="label name"))
    for role in ROLES:
        y += _LINE
        estimate: Estimate = getattr(row, role)
        parts.append(place_text(_START - 14, y, role, text_anchor="end"))
        parts.append(place_text(_VALUES, y, estimate_text(estimate), class_="number"))
        if _has_scale(row):
            parts.append(_mark(estimate, row.before.value, axis, y - 4, role))
    if not _has_scale(row):
        parts.append(place_text(_START, y - _LINE, "not drawn: there is no error before"))
    return join(*parts), y + 12


def _mark(estimate: Estimate, unit: float, axis: Axis, y: float, role: str) -> Markup:
    parts = []
    if estimate.interval is not None and np.isfinite(estimate.interval).all():
        ends = [axis.at(min(max(0.0, end / unit), axis.high)) for end in estimate.interval]
        parts.append(rule(ends[0], y, ends[1], y, f"whisker {role}"))
        parts += [rule(end, y - 4, end, y + 4, f"whisker {role}") for end in ends]
    if 0 <= estimate.value / unit <= axis.high:
        place = f"translate({axis.at(estimate.value / unit):.1f} {y:.1f})"
        parts.append(tag("path", d=_SHAPES[role], transform=place, class_=f"dot {role}"))
    return join(*parts)


def _has_scale(row: ErrorRow) -> bool:
    """Tell whether the error before can be the unit of the others."""
    return math.isfinite(row.before.value) and row.before.value > 0


def _largest(row: ErrorRow) -> float:
    """Return the largest number to be drawn, relative to the error before."""
    shares = [1.0]
    for estimate in (row.before, row.after, row.floor):
        numbers = (estimate.value, *(estimate.interval or ()))
        shares += [number / row.before.value for number in numbers]
    return max(share for share in shares if math.isfinite(share))
