"""Sections of the page on effects that are not in the model: those as good, those rejected."""

from __future__ import annotations

from collections.abc import Sequence

from adv2e.reports.keys import summary_of, unit_of
from adv2e.reports.markup import Markup, join, tag
from adv2e.reports.quantities import NOTHING, number_text, unit_text, value_text
from adv2e.reports.result import NO_OWN, Diagnosis, Finding, Own, Rejected
from adv2e.reports.separation import separation_of
from adv2e.reports.tables import SHOWN, Column, table


def alternatives(diagnosis: Diagnosis) -> Markup:
    """Return which effects explain the residual as well, and what would separate them."""
    if not diagnosis.alternatives:
        return Markup()
    names = [finding.name for finding in diagnosis.effects] + diagnosis.alternatives
    paths = _paths(diagnosis)
    rows = []
    for name in dict.fromkeys(names):
        role = "explains it as well" if name in diagnosis.alternatives else "in the model found"
        heading = join(name, tag("span", role, class_="meaning"))
        summary = summary_of(name, paths.get(name, []), diagnosis.own)
        rows.append((heading, summary, separation_of(name) or "not known"))
    columns = [Column("effect"), Column("what it is"), Column("what would show it")]
    lead = (
        "These data do not tell the following effects apart; recordings of the kind in the last"
        " column would."
    )
    caption = "Effects that explain the residual, and the recordings that would separate them"
    return join(tag("p", lead), table(caption, columns, rows))


def _paths(diagnosis: Diagnosis) -> dict[str, list[str]]:
    """Return the keys of each effect, as far as the diagnosis names them."""
    paths = {one.name: [one.key] for one in diagnosis.detectable}
    trials: list[Rejected | Finding] = [*diagnosis.rejected, *diagnosis.effects]
    for trial in trials:
        paths.setdefault(trial.name, []).extend(trial.parameters)
    return paths


def rejected(given: Sequence[Rejected], own: Own = NO_OWN) -> Markup:
    """Return what was tried and not added, and why."""
    if not given:
        return Markup()
    columns = [Column("effect"), Column("why not"), Column("tried with")]
    caption = "Effects tried and not added"
    judged = any(one.held_out is not None for one in given)
    if judged:  # none is where each is fitted much worse than what was added
        columns.append(Column("misfit with it", number=True))
        caption += "; misfit on held-out data relative to that before"
    rows = []
    for one in given:
        tried = [
            f"{path} = {value_text(value)} {unit_text(unit_of(path, own))}".rstrip()
            for path, value in one.parameters.items()
        ]
        lines = [tag("span", text, class_="line") for text in tried or [NOTHING]]
        held_out = NOTHING if one.held_out is None else number_text(one.held_out)
        rows.append((one.name, one.reason, join(*lines), *[held_out] * judged))
    return table(caption, columns, rows, folded_from=SHOWN)
