"""The first half of the page: verdict, errors, what was added and what else would explain it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from adv2e.diagnosis.report.error_chart import error_chart
from adv2e.diagnosis.report.markup import Markup, join, tag
from adv2e.diagnosis.report.quantities import (
    estimate_text,
    interval_text,
    meaning_of,
    probability_text,
    summary_of,
    unit_of,
    value_text,
)
from adv2e.diagnosis.report.separation import separation_of
from adv2e.diagnosis.report.tables import Column, table
from adv2e.diagnosis.result import Diagnosis, Finding, Interval, Rejected

MARKS = {
    "consistent": ("✓", "Consistent", "nothing is missing from the declared model"),
    "explained": ("✓", "Explained", "what was added accounts for the residual"),
    "partly_explained": ("◐", "Partly explained", "some of the residual remains"),
    "not_identifiable": ("≟", "Not identifiable", "several effects explain the residual as well"),
    "unexplained": ("✗", "Unexplained", "nothing in the library accounts for the residual"),
}
"""Sign, word and meaning of each verdict."""


def unit_text(unit: str) -> str:
    """Return a unit as people write it."""
    return {"us": "µs", "-": ""}.get(unit, unit)


def verdict(diagnosis: Diagnosis) -> Markup:
    """Return the verdict in a sentence, marked by sign, word and colour."""
    sign, word, meaning = MARKS[diagnosis.verdict]
    badge = tag("span", tag("span", sign, aria_hidden="true"), f" {word}", class_="badge")
    return tag(
        "div",
        tag("p", badge, tag("span", f" {meaning}", class_="note")),
        tag("p", diagnosis.sentence, class_="sentence"),
        class_=f"verdict {diagnosis.verdict}",
    )


def errors(diagnosis: Diagnosis) -> Markup:
    """Return the errors before and after, beside the floor, as a picture and a table."""
    names = ("measure", "before", "after", "floor")
    columns = [Column(name, number=name != "measure") for name in names]
    rows = [
        (row.name, estimate_text(row.before), estimate_text(row.after), estimate_text(row.floor))
        for row in diagnosis.errors
    ]
    parts: list[Markup] = []
    if rows:
        parts.append(tag("figure", error_chart(diagnosis.errors)))
        parts.append(table("Errors on held-out data, with 95 % intervals", columns, rows))
    else:
        parts.append(tag("p", "No error was measured."))
    before, after = diagnosis.global_p_before, diagnosis.global_p_after
    parts.append(
        tag(
            "p",
            "Probability of a residual as large if nothing were missing: ",
            tag("strong", f"p {probability_text(before)}"),
            " before, ",
            tag("strong", f"p {probability_text(after)}"),
            " after.",
        )
    )
    explained = (
        "Before: the declared model. After: the model found. Floor: independent draws of the"
        " model found against each other: as near as it comes to itself."
    )
    parts.append(tag("p", explained, class_="note"))
    return join(*parts)


def added(diagnosis: Diagnosis) -> Markup:
    """Return what was added to the declared model."""
    if not diagnosis.effects:
        return tag("p", "Nothing.")
    parts = []
    for finding in diagnosis.effects:
        summary = summary_of(finding.name, list(finding.parameters))
        parts.append(tag("h3", finding.name))
        if summary:
            parts.append(tag("p", summary))
        if finding.parameters:
            parts.append(_parameters(finding))
    return join(*parts)


def _parameters(finding: Finding) -> Markup:
    columns = [
        Column("key"),
        Column("value", number=True),
        Column("95 % interval", number=True),
        Column("unit"),
        Column("meaning"),
    ]
    rows = []
    for path, value in finding.parameters.items():
        interval = finding.interval.get(path)
        texts = _cell(value, interval), interval_text(interval), unit_text(unit_of(path))
        rows.append((tag("code", path), *texts, meaning_of(path)))
    return table(f"Parameters of {finding.name}", columns, rows)


def alternatives(diagnosis: Diagnosis) -> Markup:
    """Return which effects explain the residual as well, and what would separate them."""
    if not diagnosis.alternatives:
        return tag("p", "None.")
    names = [finding.name for finding in diagnosis.effects] + diagnosis.alternatives
    paths = _paths(diagnosis)
    rows = []
    for name in dict.fromkeys(names):
        role = "explains it as well" if name in diagnosis.alternatives else "in the model found"
        heading = join(name, tag("span", role, class_="meaning"))
        summary = summary_of(name, paths.get(name, []))
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


def _cell(value: Any, interval: Interval | None = None) -> Markup | str:
    """Return a value; a text may take several lines, a number may not."""
    text = value_text(value, interval)
    return tag("span", text, class_="text") if isinstance(value, str) else text


def nuisances(values: Mapping[str, Any]) -> Markup:
    """Return the keys that were fitted because nothing was declared of them."""
    if not values:
        return tag("p", "None was fitted.")
    columns = [Column("key"), Column("value", number=True), Column("unit"), Column("meaning")]
    rows = [
        (tag("code", path), _cell(value), unit_text(unit_of(path)), meaning_of(path))
        for path, value in values.items()
    ]
    return table("Keys that were not declared, with fitted values", columns, rows)
