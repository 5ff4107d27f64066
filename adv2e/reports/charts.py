"""Charts (SVG): curves of the recording and both models, errors, and the axes of both."""

from __future__ import annotations

import base64
import math
import textwrap
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from adv2e.rendering.rate import linear_ticks, tick_labels
from adv2e.rendering.styles import COLOURS
from adv2e.reports.markup import Markup, Wording, join, tag
from adv2e.reports.quantities import estimate_text
from adv2e.reports.result import ROLES, Band, Curve, ErrorRow, Estimate, Snapshot

WIDTH, PLOT_HEIGHT = 360, 160
LEFT, RIGHT = 58, 14
_FEW_POINTS = 40
"""Up to as many, points of a line are marked."""

_SHOWN = 4
"""Curves that are not folded away."""


@dataclass(frozen=True)
class Frame:
    """The axes and the places of the points across."""

    across: Axis
    up: Axis
    x: Floats

    def line(self, values: Floats) -> str:
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
    x_label = wrapped(curve.x_label, WIDTH - LEFT)
    y_label = wrapped(curve.y_label, WIDTH)
    top = 14 + len(y_label) * LINE_HEIGHT
    bottom = top + PLOT_HEIGHT
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
        r = 2.5 if joined else 3.5
        content += [dot(x, y, r) for x, y in zip(frame.x, ys, strict=True)]
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


def _frame_of(curve: Curve, top: float, bottom: float) -> Frame | None:
    x = drawable(curve.x)
    if curve.x_log and len(x) > len(curve.measured) and len(x) > 2 and x[0] <= 0 < x[1]:
        # bins that begin at zero: the first is drawn as wide as the second
        x = np.r_[x[1] ** 2 / x[2], x[1:]]
    rows = [curve.measured]
    for band in (curve.before, curve.after):
        rows += [band.middle, band.low, band.high]
    tight = curve.x_log or len(x) > len(curve.measured)  # points may have room, bins need none
    across = axis_over([x], LEFT, WIDTH - RIGHT, log=curve.x_log, tight=tight)
    up = axis_over([drawable(row) for row in rows], bottom, top, log=curve.y_log)
    if across is None or up is None:
        return None
    if curve.x_names:
        middles = 0.5 * (x[1:] + x[:-1])
        across = replace(across, names=list(zip(middles, curve.x_names, strict=True)))
    return Frame(across, up, across.place(x))


def dot(x: float, y: float, r: float, kind: str = "measured") -> Markup:
    if not (np.isfinite(x) and np.isfinite(y)):
        return Markup()
    return tag("circle", cx=f"{x:.1f}", cy=f"{y:.1f}", r=r, class_=f"dot {kind}")


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


# ---- The errors before and after, beside the floor, as bars that are as wide as the page.


_MEANINGS = {"before": "declared model", "after": "model found", "floor": "chance alone"}
"""Meaning of each bar: its model, or chance."""


def error_chart(row: ErrorRow, *, changed: bool = True) -> Markup:
    """Return a bar of each role of an error, from zero on, with its interval and its number.

    What is not finite, or below zero, has no bar.  `changed`: the model found is not the declared
    one.
    """
    meanings = _MEANINGS if changed else {**_MEANINGS, "after": "the same model"}
    given: dict[str, Estimate] = {role: getattr(row, role) for role in ROLES}
    ends = [number for one in given.values() for number in (one.value, *(one.interval or ()))]
    longest = max((end for end in ends if math.isfinite(end)), default=0.0)
    bars = [
        tag(
            "div",
            tag("span", tag("strong", role), f" {meanings[role]}", class_="role"),
            tag("span", _bar(one, longest), class_="track", aria_hidden="true"),
            tag("span", estimate_text(one), class_="number"),
            class_=f"bar {role}",
        )
        for role, one in given.items()
    ]
    return tag("div", *bars, class_="bars")


def _bar(estimate: Estimate, longest: float) -> Markup:
    parts = []
    if math.isfinite(estimate.value) and estimate.value > 0.0 and longest > 0.0:
        width = f"width:{_percent(estimate.value, longest)}"
        parts.append(tag("span", class_="fill", style=width))
    if parts and estimate.interval is not None and np.isfinite(estimate.interval).all():
        low, high = (max(end, 0.0) for end in estimate.interval)
        place = f"left:{_percent(low, longest)};width:{_percent(high - low, longest)}"
        parts.append(tag("span", class_="whisker", style=place))
    return join(*parts)


def _percent(part: float, whole: float) -> str:
    return f"{100.0 * part / whole:.1f}%"


# ---- Axes: from values to places in a picture, their ticks and labels, and how they are drawn.


def log_ticks(low: float, high: float) -> list[float]:
    """Return ticks of a logarithmic axis: powers of ten, with 2 and 5 times those if few.

    At most seven powers of ten; `low`, above zero, is below `high`.
    """
    first, last = math.floor(math.log10(low)), math.ceil(math.log10(high))
    every = max(1, math.ceil((last - first + 1) / 7))
    decades = [n for n in range(first, last + 1) if n % every == 0]
    for exponents, digits in ((decades, (1,)), (range(first, last + 1), (1, 2, 5))):
        found = [float(f"{digit}e{n}") for n in exponents for digit in digits]
        ticks = [tick for tick in found if low <= tick <= high]
        if len(ticks) >= 3:
            return ticks
    return linear_ticks(low, high)


Floats = NDArray[np.float64]

_LARGEST = 1e250
"""Larger numbers are not drawn, and smaller ones than its inverse are zero: sums stay finite."""
LINE_HEIGHT = 14
"""Distance of lines of text in a picture."""
_CHARACTER = 5.9
"""Mean width of a character of the labels."""


def drawable(values: ArrayLike) -> Floats:
    """Return `values` as floats, those that cannot be drawn as NaN."""
    values = np.asarray(values, dtype=np.float64)
    sizes = np.abs(values)
    kept = np.where(sizes < 1 / _LARGEST, 0.0, values)
    return np.where(sizes <= _LARGEST, kept, np.nan)


@dataclass(frozen=True)
class Axis:
    """An axis from `low` to `high`, which lie at `start` and `end` in the picture.

    `names`: of values, in the place of numbers at round ones.
    """

    low: float
    high: float
    start: float
    end: float
    log: bool = False
    names: Sequence[tuple[float, str]] = ()

    def place(self, values: Floats) -> Floats:
        """Return the positions of `values` on the axis; NaN where they have none, as log of 0."""
        low, high = (self._scaled(np.float64(end)) for end in (self.low, self.high))
        share = (self._scaled(values) - low) / (high - low)
        places: Floats = self.start + share * (self.end - self.start)
        return places

    def at(self, value: float) -> float:
        return float(self.place(np.asarray(value, dtype=np.float64)))

    def ticks(self) -> list[tuple[float, str]]:
        if self.names:
            return [(self.at(value), name) for value, name in self.names]
        ticks = log_ticks(self.low, self.high) if self.log else linear_ticks(self.low, self.high)
        return [
            (self.at(tick), label) for tick, label in zip(ticks, tick_labels(ticks), strict=True)
        ]

    def _scaled(self, values: Floats | np.float64) -> Floats:
        if not self.log:
            return np.asarray(values, dtype=np.float64)
        with np.errstate(divide="ignore", invalid="ignore"):
            logarithm = np.log10(values)
        return np.where(np.isfinite(logarithm), logarithm, np.nan)


def axis_over(
    values: Iterable[Floats], start: float, end: float, *, log: bool, tight: bool = False
) -> Axis | None:
    """Return an axis that shows all `values`, or None if there is nothing to show.

    They are :func:`drawable`; a logarithm shows only those above zero.  An axis begins at zero
    where no value is below, so that heights compare as numbers do; a `tight` one at the values.
    """
    shown = np.concatenate([np.ravel(part) for part in values] or [np.empty(0)])
    shown = shown[np.isfinite(shown) & ((shown > 0) | (not log))]
    if not len(shown):
        return None
    low, high = float(shown.min()), float(shown.max())
    if log:
        return _log_axis(low, high, start, end, tight)
    if not tight and low > 0:
        low = 0.0
    room = 0.0 if tight else 0.05 * (high - low)
    size = max(abs(low), abs(high))
    if high - low <= 1e-6 * size:  # neighbouring numbers are no axis
        room = 0.5 * size or 0.5
    begins = low == 0 and (high > 0 or not tight)
    return Axis(low if begins else low - room, high + room, start, end)


def _log_axis(low: float, high: float, start: float, end: float, tight: bool) -> Axis:
    decades = math.log10(high) - math.log10(low)
    if decades < 1e-3:
        return Axis(low / 2, high * 2, start, end, log=True)
    room = 1.0 if tight else 10.0 ** (0.05 * decades)
    return Axis(low / room, high * room, start, end, log=True)


def wrapped(text: str, width: float) -> list[str]:
    return textwrap.wrap(text, max(8, int(width / _CHARACTER))) or [""]


def place_text(x: float, y: float, content: str, **attributes: object) -> Markup:
    return tag("text", content, x=f"{x:.1f}", y=f"{y:.1f}", **attributes)


def rule(x0: float, y0: float, x1: float, y1: float, class_: str) -> Markup:
    return tag(
        "line", x1=f"{x0:.1f}", y1=f"{y0:.1f}", x2=f"{x1:.1f}", y2=f"{y1:.1f}", class_=class_
    )


def draw_axes(across: Axis, up: Axis, x_label: list[str], y_label: list[str]) -> Markup:
    """Return grid, ticks and labels; `up` starts at the bottom of the picture.

    The label of the vertical axis stands above it, where it can be read without turning the head.
    """
    left, right, bottom, top = across.start, across.end, up.start, up.end
    parts = []
    for y, label in up.ticks():
        parts.append(rule(left, y, right, y, "grid"))
        parts.append(place_text(left - 6, y + 4, label, text_anchor="end"))
    for x, label in _apart(across.ticks()):
        parts.append(rule(x, bottom, x, bottom + 4, "axis"))
        parts.append(place_text(x, bottom + 17, label, text_anchor="middle"))
    parts.append(rule(left, bottom, right, bottom, "axis"))
    for number, line in enumerate(x_label):
        y = bottom + 34 + number * LINE_HEIGHT
        parts.append(place_text((left + right) / 2, y, line, text_anchor="middle", class_="label"))
    for number, line in enumerate(reversed(y_label)):
        parts.append(place_text(4, top - 10 - number * LINE_HEIGHT, line, class_="label"))
    return join(*parts)


def _apart(ticks: list[tuple[float, str]]) -> list[tuple[float, str]]:
    """Return the ticks whose labels do not touch the label before."""
    kept: list[tuple[float, str]] = []
    free = -math.inf
    for x, label in ticks:
        half = len(label) * _CHARACTER / 2
        if x - half >= free:
            kept.append((x, label))
            free = x + half + 6
    return kept


# ---- Events of a short time as pictures (PNG inside the page), in colours that compare.


_FAINTEST = 0.4
"""Strength of the colour of a single event, where full colour is more."""
_LOUD = 0.99
"""Share of the pixels with events that are not brighter than full colour."""


def top_of(snapshot: Snapshot) -> int:
    """Return the number of events of a pixel that has full colour in all pictures."""
    every = np.array([snapshot.measured, snapshot.before, snapshot.after])
    some = every[every > 0]
    return int(np.quantile(some, _LOUD, method="lower")) if some.size else 1


def event_colours(number: NDArray[Any], top: int) -> NDArray[np.uint8]:
    """Return the colour (RGB) of numbers of OFF and ON events, (2, ...), as (..., 3) uint8.

    White without any, red with ON, blue with OFF, purple with both; the more, the stronger, up to
    `top`.
    """
    share = np.minimum(number, top) / top
    strength = np.where(number > 0, _FAINTEST + (1.0 - _FAINTEST) * share, 0.0)[..., None]
    inks = [1.0 - np.array(COLOURS[name]) / 255.0 for name in ("blue", "red")]
    light = np.prod([1.0 - one * ink for one, ink in zip(strength, inks, strict=True)], axis=0)
    return np.asarray(np.rint(255.0 * light), np.uint8)


# ---- Residuals over the sensor as pictures (PNG inside the page).


Map = NDArray[np.float64]
Picture = NDArray[np.uint8]

CLIP_SD = 5.0
"""Standard deviations at which the colours end."""
_WIDTH = 440
"""Width that pictures are enlarged to, at least [pixels]."""

_RDBU = "053061 2166ac 4393c3 92c5de d1e5f0 f7f7f7 fddbc7 f4a582 d6604d b2182b 67001f"
_ANCHORS = np.array([tuple(bytes.fromhex(colour)) for colour in _RDBU.split()], np.float64)
"""ColorBrewer's RdBu turned round: blue below zero, red above; safe for colour-blind readers."""
_LEVELS = 129
"""Colours in all, an odd number: the middle one is zero."""
_MASKED = (128, 128, 128)


def colours(values: Map) -> Picture:
    """Return the colour (RGB) of each of `values` [standard deviations], (..., 3) uint8.

    Clipped at +-:data:`CLIP_SD`; NaN is grey.
    """
    places = np.linspace(0, _LEVELS - 1, len(_ANCHORS))
    levels = np.arange(_LEVELS)
    table = np.column_stack([np.interp(levels, places, part) for part in _ANCHORS.T])
    table = np.vstack([np.rint(table), _MASKED]).astype(np.uint8)
    share = np.clip(values, -CLIP_SD, CLIP_SD) / (2 * CLIP_SD) + 0.5
    masked = np.isnan(share)
    index = np.rint(np.where(masked, 0.0, share) * (_LEVELS - 1)).astype(np.intp)
    picture: Picture = table[np.where(masked, _LEVELS, index)]
    return picture


def map_image(values: Map, description: str) -> Markup:
    """Return the picture of a map as an ``img`` element that holds its data.

    `values`, (rows, columns): residual in standard deviations, NaN: masked; row 0 is at the top.
    """
    return image_of(colours(values), description)


def image_of(picture: Picture, description: str) -> Markup:
    """Return a picture of a sensor, RGB (rows, columns, 3), enlarged, as an ``img`` element."""
    factor = max(1, -(-_WIDTH // max(picture.shape[:2])))
    picture = picture.repeat(factor, axis=0).repeat(factor, axis=1)
    done, data = cv2.imencode(".png", picture[:, :, ::-1], [cv2.IMWRITE_PNG_COMPRESSION, 9])
    assert done
    encoded = base64.b64encode(data.tobytes()).decode("ascii")
    rows, columns = picture.shape[:2]
    source = f"data:image/png;base64,{encoded}"
    return tag("img", src=source, alt=description, width=columns, height=rows, class_="map")


def colour_bar() -> Markup:
    scale = np.linspace(-CLIP_SD, CLIP_SD, _LEVELS)[None].repeat(6, axis=0)
    return map_image(scale, f"Colours from -{CLIP_SD:g} to +{CLIP_SD:g} standard deviations")
