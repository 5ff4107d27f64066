"""Sections of the page on the residual of recordings: maps, signatures, what was left out."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from adv2e.reports.charts.sensor_map import CLIP_SD, Map, colour_bar, map_image
from adv2e.reports.markup import Markup, join, tag
from adv2e.reports.quantities import (
    NOTHING,
    alike_texts,
    number_text,
    percent_text,
    short_text,
    unit_text,
)
from adv2e.reports.result import Detectable, Diagnosis, ResidualMap, Signature
from adv2e.reports.standing_out import LARGE_Z, standing_out
from adv2e.reports.tables import SHOWN, Column, table

_GROUPS = 6
"""Groups that are not folded away."""


def maps(given: Sequence[ResidualMap]) -> Markup:
    """Return the maps before and after, side by side."""
    if not given:
        return Markup()
    parts = []
    for one in given:
        pictures = [_map(one.title, "before (declared model)", one.before)]
        if not np.array_equal(one.before, one.after, equal_nan=True):
            pictures.append(_map(one.title, "after (model found)", one.after))
        parts.append(tag("h3", one.title))
        parts.append(tag("div", *pictures, class_="side"))
    note = (
        "Measured minus simulated, in standard deviations (sd) of chance: red where more was"
        f" measured, blue where less, from {-CLIP_SD:g} or less to {CLIP_SD:g} or more; grey:"
        " pixels that were left out."
    )
    scale = tag("figure", colour_bar(), tag("figcaption", note, class_="note"))
    return tag("div", *parts, scale, class_="maps")


def _map(title: str, model: str, values: Map) -> Markup:
    seen = values[~np.isnan(values)]
    text = "all masked"
    if len(seen):
        far = percent_text(float(np.mean(np.abs(seen) > LARGE_Z)))
        over = percent_text(float(np.mean(np.abs(seen) > CLIP_SD)))
        text = f"{far} beyond ±{LARGE_Z:g} sd, {over} beyond ±{CLIP_SD:g} sd"
    image = map_image(values, f"{title}, {model}: {text}")
    caption = tag("figcaption", model, tag("span", text, class_="meaning"))
    return tag("figure", caption, image)


def groups(diagnosis: Diagnosis) -> Markup:
    """Return what stands out, by group of statistics: what an effect that is missing has to do."""
    if not diagnosis.signatures:
        return Markup()
    left = diagnosis.verdict in ("unexplained", "partly_explained")
    found = standing_out(diagnosis.signatures, left=left)
    if not found:
        return tag("p", f"No number differs by more than {LARGE_Z:g} standard deviations.")
    names = ["measured", "before", "after", "far off before", "far off after"]
    if not diagnosis.effects:  # both are the declared model
        names = ["measured", "simulated", "far off"]
    columns = [Column("what"), *(Column(name, number=True) for name in names)]
    rows = []
    for one in found:
        name = join(one.group, tag("span", one.farthest.meaning, class_="meaning long"))
        values = _values(one.farthest)
        far = [f"{number} of {one.number}" for number in (one.before, one.after)]
        rows.append([name, *values, *far] if diagnosis.effects else [name, *values[:2], far[0]])
    models = ": before with the declared model, after with the model found" * bool(
        diagnosis.effects
    )
    lead = (
        "Many numbers were compared, in groups. Each row shows the number of a group that differs"
        f" most, as measured and as simulated{models}."
        f" Far off: how many of the group differ by more than {LARGE_Z:g} standard deviations."
    )
    caption = "Groups of numbers, on data that was not used for fitting"
    return join(tag("p", lead), table(caption, columns, rows, folded_from=_GROUPS))


def signatures(given: Sequence[Signature]) -> Markup:
    """Return the summary statistics, the most telling ones first."""
    if not given:
        return Markup()
    columns = [Column("number"), Column("group")] + [
        Column(name, number=True) for name in ("measured", "before", "after", "z before", "z after")
    ]
    rows = [_signature(one) for one in sorted(given, key=_rank)]
    far = sum(abs(one.z_before) > LARGE_Z for one in given)
    still = sum(abs(one.z_after) > LARGE_Z for one in given)
    lead = (
        "z: distance of the recording from the simulations, in their standard deviations. Beyond"
        f" ±{LARGE_Z:g} (marked ▲ or ▼): {far} of {len(given)} before, {still} after."
    )
    caption = "Numbers on data that was not used for fitting, those that differed most first"
    return join(tag("p", lead), table(caption, columns, rows, folded_from=SHOWN))


def _rank(signature: Signature) -> tuple[float, float]:
    """Return a number that is least for the largest distance; unknown ones come last."""
    before, after = (
        math.inf if math.isnan(z) else -abs(z) for z in (signature.z_before, signature.z_after)
    )
    return before, after


def _signature(one: Signature) -> tuple[object, ...]:
    name = join(
        tag("span", one.name, title=one.meaning), tag("span", one.meaning, class_="meaning long")
    )
    return name, one.group, *_values(one), _z(one.z_before), _z(one.z_after)


def _values(one: Signature) -> list[str]:
    return alike_texts((one.measured, one.before, one.after))


def _z(z: float) -> Markup | str:
    if math.isnan(z):
        return NOTHING
    text = f"{z:+.1f}" if abs(z) < 1000 else number_text(z)
    if abs(z) <= LARGE_Z:
        return text
    sign = "▲" if z > 0 else "▼"
    return tag("strong", tag("span", sign, aria_hidden="true"), f" {text}", class_="large")


def detectable(given: Sequence[Detectable]) -> Markup:
    """Return how small an effect could have been to be seen."""
    if not given:
        return Markup()
    columns = [Column("effect"), Column("key"), Column("size", number=True), Column("unit")]
    rows = [(one.name, tag("code", one.key), _size(one.size), unit_text(one.unit)) for one in given]
    caption = (
        "An effect of this size would have been seen about 8 times in 10;"
        f" {NOTHING}: no size that is physical would, or the simulations made do not tell"
    )
    return table(caption, columns, rows, folded_from=2 * SHOWN)


def _size(size: float | None) -> str:
    return NOTHING if size is None else short_text(size, 3)


def data(diagnosis: Diagnosis) -> Markup:
    """Return how the data were divided and what was set aside."""
    parts = [tag("p", diagnosis.split)] if diagnosis.split else []
    if diagnosis.masked:
        columns = [Column("set aside"), Column("share of events", number=True)]
        rows = [(one.what, percent_text(one.share)) for one in diagnosis.masked]
        parts.append(table("Data that was not used", columns, rows))
    return join(*parts)
