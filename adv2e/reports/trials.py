"""Sections of the page on effects that are not in the model: those as good, those rejected."""

from __future__ import annotations

import math
from collections.abc import Sequence

from adv2e.effects import separated_by
from adv2e.reports.keys import summary_of, unit_of
from adv2e.reports.markup import SHOWN, Column, Markup, join, table, tag
from adv2e.reports.quantities import NOTHING, unit_text, value_text
from adv2e.reports.result import Diagnosis, Finding, Rejected


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
