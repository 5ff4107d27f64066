"""The errors before and after, beside the floor, as bars that are as wide as the page."""

from __future__ import annotations

import math

import numpy as np

from adv2e.reports.markup import Markup, join, tag
from adv2e.reports.quantities import estimate_text
from adv2e.reports.result import ROLES, ErrorRow, Estimate

_MEANINGS = {
    "before": "declared model",
    "after": "model found",
    "floor": "chance alone",
}
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
