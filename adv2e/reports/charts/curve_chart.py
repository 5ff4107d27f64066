"""A curve of the recording with the two models around it, as a picture (SVG)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from adv2e.reports.charts.axes import (
    LINE_HEIGHT,
    Axis,
    Floats,
    axis_over,
    draw_axes,
    drawable,
    wrapped,
)
from adv2e.reports.markup import Markup, join, tag
from adv2e.reports.result import Band, Curve
from adv2e.reports.wording import Wording

WIDTH, _PLOT_HEIGHT = 360, 160
_LEFT, _RIGHT = 58, 14
_FEW_POINTS = 40
"""Up to as many, points of a line are marked."""

_SHOWN = 4
"""Curves that are not folded away."""


@dataclass(frozen=True)
class _Frame:
    """The axes and the places of the points across."""

    across: Axis
    up: Axis
    x: Floats

    def line(self, values: Floats) -> str:
        """Return the path of a curve."""
        xs, ys = points_of(self.x, self.up.place(values))
        return line_path(xs, ys)

    def band(self, band: Band) -> str:
        """Return the path around a band; ends beyond every number are at the picture's border."""
        low = np.where(np.isneginf(band.low), self.up.low, drawable(band.low))
        high = np.where(np.isposinf(band.high), self.up.high, drawable(band.high))
        if self.up.log:
            low = np.where(low <= 0, self.up.low, low)
        xs, lows = points_of(self.x, self.up.place(low))
        _, highs = points_of(self.x, self.up.place(high))
        return band_path(xs, lows, highs)


def curves(given: Sequence[Curve], wording: Wording) -> Markup:
    """Return the curves side by side, under their legend: those that differ most, the rest folded.

    They differ by how far the recording is from the declared model, where that is no chance.
    """
    if not given:
        return Markup()
    ranked = _ranked(given)
    key = _legend(wording, two=any(not _is_one(curve) for curve in given))
    parts: list[Markup] = [key, _side_by_side(ranked[:_SHOWN])]
    rest = ranked[_SHOWN:]
    if rest:
        summary = tag("summary", f"{len(rest)} more curves, which differ less")
        parts.append(tag("details", summary, key, _side_by_side(rest), class_="screen"))
    return join(*parts)


def _ranked(given: Sequence[Curve]) -> list[Curve]:
    """Return the curves that differ most first; of those of one kind, the others come later."""
    seen: dict[str, int] = {}
    turns: list[tuple[int, int, Curve]] = []
    for curve in sorted(given, key=lambda curve: -_unlike(curve)):
        kind = curve.title.partition(",")[0]
        turns.append((seen.setdefault(kind, 0), len(turns), curve))
        seen[kind] += 1
    return [curve for *_, curve in sorted(turns, key=lambda turn: turn[:2])]


def _side_by_side(given: Sequence[Curve]) -> Markup:
    figures = [tag("figure", tag("figcaption", curve.title), curve_chart(curve)) for curve in given]
    return tag("div", *figures, class_="side")


def _is_one(curve: Curve) -> bool:
    """Tell whether both models are the same: no effect was found, and one curve is drawn."""
    pairs = zip(vars(curve.before).values(), vars(curve.after).values(), strict=True)
    return all(np.array_equal(a, b, equal_nan=True) for a, b in pairs)


def _unlike(curve: Curve) -> float:
    """Return the share of a curve by which it is beside the declared model, outside its band."""
    middle, measured = drawable(curve.before.middle), drawable(curve.measured)
    outside = (measured < curve.before.low) | (measured > curve.before.high)
    size = float(np.nansum(np.maximum(np.abs(measured), np.abs(middle))))
    apart = float(np.nansum(np.where(outside, np.abs(measured - middle), 0.0)))
    return apart / size if 0.0 < size < np.inf else 0.0


def _legend(wording: Wording, *, two: bool) -> Markup:
    """Return the legend of all curves: lines and bands."""
    entries = [("measured", "measured"), ("before", "before: the declared model")]
    if two:
        entries.append(("after", "after: the model found"))
    items = [tag("li", tag("span", class_=f"swatch {name}"), text) for name, text in entries]
    band = f"shaded: {wording.bands}{', greyish where both overlap' * two}"
    return tag("ul", *items, tag("li", tag("span", class_="swatch shaded"), band), class_="legend")


def curve_chart(curve: Curve) -> Markup:
    """Return the picture of `curve`: measured, and median and 95 % band of either model.

    Borders of bins are drawn as steps; values at the same place are points without a line.  What
    cannot be drawn (no number, or none that the logarithm has) leaves a gap.
    """
    x_label = wrapped(curve.x_label, WIDTH - _LEFT)
    y_label = wrapped(curve.y_label, WIDTH)
    top = 14 + len(y_label) * LINE_HEIGHT
    bottom = top + _PLOT_HEIGHT
    frame = _frame_of(curve, top, bottom)
    if frame is None:
        return tag("p", "There is nothing to draw: no value is known.", class_="note")
    measured = drawable(curve.measured)
    joined = bool((np.diff(curve.x) > 0).all())
    dots = len(frame.x) == len(measured) and (len(measured) <= _FEW_POINTS or not joined)
    content = [
        tag("title", _description(curve)),
        draw_axes(frame.across, frame.up, x_label, y_label),
    ]
    models = [("before", curve.before), ("after", curve.after)]
    if _is_one(curve):
        models.pop()
    for name, band in models:
        content.append(tag("path", d=frame.band(band), class_=f"band {name}"))
    if joined:
        content.append(tag("path", d=frame.line(measured), class_="curve measured"))
    if dots:
        ys = frame.up.place(measured)
        content += [_dot(x, y, joined) for x, y in zip(frame.x, ys, strict=True)]
    for name, band in reversed(models):
        content.append(tag("path", d=frame.line(drawable(band.middle)), class_=f"curve {name}"))
    height = bottom + 26 + len(x_label) * LINE_HEIGHT
    return tag("svg", *content, viewBox=f"0 0 {WIDTH} {height}", role="img")


def _description(curve: Curve) -> str:
    """Return the alternative text of a curve, for screen readers."""
    known = np.isfinite(curve.measured)
    inside = [
        int(np.sum(known & (curve.measured >= band.low) & (curve.measured <= band.high)))
        for band in (curve.before, curve.after)
    ]
    return (
        f"{curve.title}: {curve.y_label} against {curve.x_label}. Of {known.sum()} measured values"
        f" {inside[0]} lie in the band of the declared model, {inside[1]} in that of the model"
        " found."
    )


def _frame_of(curve: Curve, top: float, bottom: float) -> _Frame | None:
    x = drawable(curve.x)
    if curve.x_log and len(x) > len(curve.measured) and len(x) > 2 and x[0] <= 0 < x[1]:
        # bins that begin at zero: the first is drawn as wide as the second
        x = np.r_[x[1] ** 2 / x[2], x[1:]]
    rows = [curve.measured]
    for band in (curve.before, curve.after):
        rows += [band.middle, band.low, band.high]
    tight = curve.x_log or len(x) > len(curve.measured)  # points may have room, bins need none
    across = axis_over([x], _LEFT, WIDTH - _RIGHT, log=curve.x_log, tight=tight)
    up = axis_over([drawable(row) for row in rows], bottom, top, log=curve.y_log)
    if across is None or up is None:
        return None
    if curve.x_names:
        middles = 0.5 * (x[1:] + x[:-1])
        across = replace(across, names=list(zip(middles, curve.x_names, strict=True)))
    return _Frame(across, up, across.place(x))


def _dot(x: float, y: float, joined: bool) -> Markup:
    if not (np.isfinite(x) and np.isfinite(y)):
        return Markup()
    r = 2.5 if joined else 3.5
    return tag("circle", cx=f"{x:.1f}", cy=f"{y:.1f}", r=r, class_="dot measured")


def points_of(x: Floats, values: Floats) -> tuple[Floats, Floats]:
    """Return the points to join, (n,): those given, or, for borders (n + 1,), corners of steps."""
    if len(x) == len(values):
        return x, values
    return np.repeat(x, 2)[1:-1], np.repeat(values, 2)


def line_path(xs: Floats, ys: Floats) -> str:
    """Return the path through points in the picture; one between gaps becomes a short dash."""
    return "".join(_joined(x, y) for x, y in _runs(xs, ys))


def band_path(xs: Floats, low: Floats, high: Floats) -> str:
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
