"""Sections of the page on the residual, on what was left out, and on rejected effects."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from adv2e.effects import separated_by
from adv2e.reports.charts import CLIP_SD, Map, colour_bar, map_image
from adv2e.reports.headline import LARGE_Z, kind_rank, standing_out
from adv2e.reports.markup import SHOWN, Column, Markup, join, summary_of, table, tag, unit_of
from adv2e.reports.quantities import (
    NO_UNIT,
    NOTHING,
    alike_texts,
    number_text,
    percent_text,
    short_text,
    unit_text,
    value_text,
)
from adv2e.reports.result import Detectable, Diagnosis, Finding, Rejected, ResidualMap, Signature

_CHANCE = math.erfc(LARGE_Z / math.sqrt(2.0))
"""Share that a normal deviation has beyond :data:`LARGE_Z`."""

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
        " pixels that were left out. Here, look for a pattern (single pixels, rows, edges of the"
        f" scene) where far more than the {_CHANCE:.1%} of chance is beyond ±{LARGE_Z:g} sd."
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
    """Return the table of the largest residuals, by group of statistics."""
    if not diagnosis.signatures:
        return Markup()
    left = diagnosis.verdict in ("unexplained", "partly_explained")
    found = standing_out(diagnosis.signatures, left=left)
    if not found:
        nothing = f"No number differs by more than {LARGE_Z:g} standard deviations"
        return tag("p", f"{nothing}: here, the simulation is as the recording is.")
    names, counted = ["measured", "before", "after"], ["far off before", "far off after"]
    if not diagnosis.effects:  # both are the declared model
        names, counted = ["measured", "simulated"], ["far off"]
    numbers, far_off = ([Column(name, number=True) for name in some] for some in (names, counted))
    columns = [Column("what"), *numbers, Column("unit"), *far_off]
    rows = []
    for one in found:
        name = join(one.group, tag("span", one.farthest.meaning, class_="meaning long"))
        values, unit = _values(one.farthest)[: len(names)], unit_text(one.farthest.unit)
        far = [f"{number} of {one.number}" for number in (one.before, one.after)]
        rows.append([name, *values, unit, *far[: len(counted)]])
    models = ": before with the declared model, after with the model found" * bool(
        diagnosis.effects
    )
    lead = (
        "Many numbers were compared, in groups: first numbers of events, then their times, then all"
        " else. Each row shows the number of a group that differs most, as measured and as"
        f" simulated{models}. Far off: how many of the group differ by more than {LARGE_Z:g}"
        f" standard deviations (sd) of chance. {_meaning(diagnosis, left)}"
    )
    caption = f"Groups of numbers, {diagnosis.compared}"
    return join(tag("p", lead), table(caption, columns, rows, folded_from=_GROUPS))


def _meaning(diagnosis: Diagnosis, left: bool) -> str:
    """Return the meaning of the large residuals for this recording, in words."""
    if diagnosis.verdict == "unfinished":
        return "Here, what makes these differences is looked for."
    if left:
        return "Here, something that the library lacks makes these differences."
    if not diagnosis.effects:
        return "Here, these few are what chance makes of so many numbers."
    return "Here, these are the marks of what was found: after it, they should be near."


def signatures(diagnosis: Diagnosis) -> Markup:
    """Return all statistics by kind, numbers of events first; of one kind, the farthest first."""
    given = diagnosis.signatures
    if not given:
        return Markup()
    columns = [
        *(Column("number"), Column("group")),
        *(Column(name, number=True) for name in ("measured", "before", "after")),
        Column("unit"),
        *(Column(name, number=True) for name in ("z before [sd]", "z after [sd]")),
    ]
    rows = [_signature(one) for one in sorted(given, key=_rank)]
    far = sum(abs(one.z_before) > LARGE_Z for one in given)
    still = sum(abs(one.z_after) > LARGE_Z for one in given)
    lead = (
        "z: distance of the recording from the simulations, in their standard deviations (sd)."
        f" Beyond ±{LARGE_Z:g} (marked ▲ or ▼): {far} of {len(given)} before, {still} after."
    )
    caption = (
        f"Numbers {diagnosis.compared}: numbers of events, then times, then all else; of each,"
        " those that differed most first"
    )
    return join(tag("p", lead), table(caption, columns, rows, folded_from=SHOWN))


def _rank(signature: Signature) -> tuple[float, ...]:
    """Return the sort key of a statistic: by kind, then the largest z-score first, NaN last."""
    before, after = (
        math.inf if math.isnan(z) else -abs(z) for z in (signature.z_before, signature.z_after)
    )
    return kind_rank(signature), before, after


def _signature(one: Signature) -> tuple[object, ...]:
    name = join(
        tag("span", one.name, title=one.meaning), tag("span", one.meaning, class_="meaning long")
    )
    z = _z(one.z_before), _z(one.z_after)
    return name, one.group, *_values(one), unit_text(one.unit), *z


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
    """Return the table of detection limits: smallest detectable size of each effect."""
    if not given:
        return Markup()
    columns = [Column("effect"), Column("key"), Column("size", number=True), Column("unit")]
    rows = [
        (one.name, tag("code", one.key), _size(one.size), unit_text(one.unit) or NO_UNIT)
        for one in given
    ]
    caption = (
        "An effect of this size would have been seen about 8 times in 10;"
        f" {NOTHING}: no size that is physical would, or the simulations made do not tell"
    )
    return table(caption, columns, rows, folded_from=2 * SHOWN)


def _size(size: float | None) -> str:
    return NOTHING if size is None else short_text(size, 3)


def data(diagnosis: Diagnosis) -> Markup:
    """Return the section on the split of the data, and on masked data."""
    parts = [tag("p", diagnosis.split)] if diagnosis.split else []
    if diagnosis.masked:
        columns = [Column("set aside"), Column("share of events", number=True)]
        rows = [(one.what, percent_text(one.share)) for one in diagnosis.masked]
        parts.append(table("Data that was not used", columns, rows))
    return join(*parts)


# ---- Sections of the page on effects that are not in the model: those as good, those rejected.


def alternatives(diagnosis: Diagnosis) -> Markup:
    """Return the table of alternatives: effects that fit as well, and how to tell them apart."""
    if not diagnosis.alternatives:
        return Markup()
    names = [finding.name for finding in diagnosis.effects] + diagnosis.alternatives
    paths = _paths(diagnosis)
    rows = []
    for name in dict.fromkeys(names):
        role = "fits as well" if name in diagnosis.alternatives else "in the model found"
        heading = join(name, tag("span", role, class_="meaning"))
        summary = summary_of(name, paths.get(name, []), diagnosis.own)
        rows.append((heading, summary, separated_by(name) or "not known"))
    columns = [Column("effect"), Column("what it is"), Column("what would show it")]
    lead = (
        "These data do not tell the following effects apart; recordings of the kind in the last"
        " column would."
    )
    caption = "Effects that fit these data as well, and the recordings that would tell them apart"
    return join(tag("p", lead), table(caption, columns, rows))


def _paths(diagnosis: Diagnosis) -> dict[str, list[str]]:
    """Return the keys of each effect, as far as the diagnosis names them."""
    paths = {one.name: [one.key] for one in diagnosis.detectable}
    trials: list[Rejected | Finding] = [*diagnosis.rejected, *diagnosis.effects]
    for trial in trials:
        paths.setdefault(trial.name, []).extend(trial.parameters)
    return paths


def rejected(diagnosis: Diagnosis) -> Markup:
    """Return the table of rejected effects, with the reasons."""
    given = by_explained(diagnosis.rejected)
    if not given:
        return Markup()
    columns = [
        Column("effect, and the values it was tried with"),
        Column("explains", number=True),
        Column("why not"),
    ]
    caption = (
        "Effects tried and not added, those that explain most first. Explains:"
        f" {diagnosis.wording.explained}; below 0: it adds to it; {NOTHING}: not known"
    )
    rows = []
    for one in given:
        tried = [
            f"{path} = {value_text(value)} {unit_text(unit_of(path, diagnosis.own))}".rstrip()
            for path, value in one.parameters.items()
        ]
        lines = [tag("span", text, class_="meaning") for text in tried]
        rows.append((join(one.name, *lines), _explained(one), one.reason))
    return table(caption, columns, rows, folded_from=SHOWN)


def by_explained(given: Sequence[Rejected]) -> list[Rejected]:
    """Return effects sorted by what they explain, most first; unknown shares come last."""
    return sorted(given, key=lambda one: math.inf if _is_unknown(one) else one.held_out or 0.0)


def _is_unknown(one: Rejected) -> bool:
    return one.held_out is None or math.isnan(one.held_out)


def _explained(one: Rejected) -> str:
    if one.held_out is None or not math.isfinite(one.held_out):
        return NOTHING
    return f"{round(100.0 * (1.0 - one.held_out), 1) + 0.0:,.1f} %"
