"""A curve as SVG: points measured, lines and bands of two models, over logarithmic axes."""

from __future__ import annotations

import math
from collections.abc import Callable
from html import escape

import numpy as np
from numpy.typing import NDArray

from adv2e.diagnosis.result import Band, Curve

Array = NDArray[np.float64]
Scale = Callable[[float], float]

WIDTH, HEIGHT = 520, 340
_LEFT, _RIGHT, _TOP, _BOTTOM = 70, 14, 34, 48
BEFORE, AFTER, MEASURED = "#b85c00", "#0b6e99", "#111111"


def curve_svg(curve: Curve) -> str:
    """Return one ``<svg>`` element; readable without colour (dashes, filled points)."""
    x, order = curve.x, np.argsort(curve.x, kind="stable")
    values = [curve.measured, curve.before.middle, curve.after.middle]
    values += [curve.after.low, curve.after.high]
    across = _scale(x, curve.x_log, _LEFT, WIDTH - _RIGHT)
    up = _scale(np.concatenate(values), curve.y_log, HEIGHT - _BOTTOM, _TOP)
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" role="img"'
        f' width="{WIDTH}" height="{HEIGHT}" font-family="sans-serif" font-size="12">',
        f"<title>{escape(curve.title)}</title>",
        '<rect width="100%" height="100%" fill="white"/>',
        f'<text x="{_LEFT}" y="20" font-size="14">{escape(curve.title)}</text>',
    ]
    parts += _axis(x, curve.x_log, across, horizontal=True)
    parts += _axis(np.concatenate(values), curve.y_log, up, horizontal=False)
    middle = (_LEFT + WIDTH - _RIGHT) / 2
    parts.append(
        f'<text x="{middle:.0f}" y="{HEIGHT - 8}" text-anchor="middle">'
        f"{escape(curve.x_label)}</text>"
    )
    parts.append(
        f'<text transform="translate(14 {HEIGHT / 2:.0f}) rotate(-90)" text-anchor="middle">'
        f"{escape(curve.y_label)}</text>"
    )
    parts += _model(x[order], curve.before, order, across, up, BEFORE, ' stroke-dasharray="6 4"')
    parts += _model(x[order], curve.after, order, across, up, AFTER, "")
    for at, value in zip(x, curve.measured, strict=True):
        if math.isfinite(value):
            parts.append(
                f'<circle cx="{across(at):.1f}" cy="{up(value):.1f}" r="3.5" fill="{MEASURED}"/>'
            )
    parts.append("</svg>")
    return "\n".join(parts)


def _scale(values: Array, logarithmic: bool, low: float, high: float) -> Scale:
    first, last = _range(values, logarithmic)
    change = math.log10 if logarithmic else float

    def to_pixels(value: float) -> float:
        share = (change(value) - change(first)) / (change(last) - change(first))
        return low + share * (high - low)

    return to_pixels


def _range(values: Array, logarithmic: bool) -> tuple[float, float]:
    finite = values[np.isfinite(values) & ((values > 0) | (not logarithmic))]
    if not finite.size:
        return (1.0, 10.0) if logarithmic else (0.0, 1.0)
    low, high = float(finite.min()), float(finite.max())
    if logarithmic:
        return low / 1.3, high * 1.3
    margin = 0.05 * (high - low) or 1.0
    return low - margin, high + margin


def _ticks(values: Array, logarithmic: bool) -> list[float]:
    low, high = _range(values, logarithmic)
    if not logarithmic:
        return [float(tick) for tick in np.linspace(low, high, 5)]
    span = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    steps = (1,) if len(span) > 5 else (1, 2, 5)
    return [s * 10.0**k for k in span for s in steps if low <= s * 10.0**k <= high]


def _axis(values: Array, logarithmic: bool, scale: Scale, *, horizontal: bool) -> list[str]:
    parts = []
    for tick in _ticks(values, logarithmic):
        at = scale(tick)
        if horizontal:
            line = f'x1="{at:.1f}" x2="{at:.1f}" y1="{_TOP}" y2="{HEIGHT - _BOTTOM}"'
            text = f'x="{at:.1f}" y="{HEIGHT - _BOTTOM + 16}" text-anchor="middle"'
        else:
            line = f'x1="{_LEFT}" x2="{WIDTH - _RIGHT}" y1="{at:.1f}" y2="{at:.1f}"'
            text = f'x="{_LEFT - 6}" y="{at + 4:.1f}" text-anchor="end"'
        parts.append(f'<line {line} stroke="#dddddd"/><text {text}>{tick:.4g}</text>')
    return parts


def _model(
    x: Array, band: Band, order: NDArray[np.int64], across: Scale, up: Scale, colour: str, dash: str
) -> list[str]:
    def path(values: Array) -> str:
        return " ".join(
            f"{across(a):.1f},{up(b):.1f}" for a, b in zip(x, values, strict=True) if b > 0
        )

    edges = path(band.low[order]) + " " + " ".join(reversed(path(band.high[order]).split()))
    line = path(band.middle[order])
    return [
        f'<polygon points="{edges}" fill="{colour}" opacity="0.15"/>',
        f'<polyline points="{line}" fill="none" stroke="{colour}" stroke-width="1.8"{dash}/>',
    ]
