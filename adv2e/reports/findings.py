"""Sections of the page on what was found: verdict, errors, what was added, nuisances, notes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from adv2e.reports.charts.error_chart import error_chart
from adv2e.reports.keys import meaning_of, summary_of, unit_of
from adv2e.reports.markup import Markup, join, tag
from adv2e.reports.quantities import (
    estimate_text,
    interval_text,
    probability_text,
    unit_text,
    value_text,
)
from adv2e.reports.result import NO_OWN, Diagnosis, Interval, ListInterval, Own
from adv2e.reports.tables import Column, table

MARKS = {
    "consistent": ("✓", "Consistent", "nothing is missing from the declared model"),
    "explained": ("✓", "Explained", "what was added accounts for the residual"),
    "partly_explained": ("◐", "Partly explained", "some of the residual remains"),
    "not_identifiable": ("≟", "Not identifiable", "several effects explain the residual as well"),
    "unexplained": ("✗", "Unexplained", "nothing in the library accounts for the residual"),
}
"""Sign, word and meaning of each verdict."""


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
        given = any(row.before.interval or row.after.interval for row in diagnosis.errors)
        caption = f"Errors on held-out data{', with 95 % intervals' if given else ''}"
        parts.append(table(caption, columns, rows))
    before, after = (
        tag("strong", f"p {probability_text(p)}")
        for p in (diagnosis.global_p_before, diagnosis.global_p_after)
    )
    lead = "Probability of a residual as large if nothing were missing: "
    parts.append(tag("p", lead, before, " before, ", after, " after."))
    roles = "Before: the declared model. After: the model found. Floor: "
    parts.append(tag("p", f"{roles}{diagnosis.wording.floor}.", class_="note"))
    return join(*parts)


def added(diagnosis: Diagnosis) -> Markup:
    """Return what was added to the declared model."""
    if not diagnosis.effects:
        return tag("p", "Nothing.")
    parts = []
    for finding in diagnosis.effects:
        summary = summary_of(finding.name, list(finding.parameters), diagnosis.own)
        parts.append(tag("h3", finding.name))
        if summary:
            parts.append(tag("p", summary))
        if finding.parameters:
            caption = f"Parameters of {finding.name}"
            parts.append(_keys(caption, finding.parameters, finding.interval, diagnosis.own))
    return join(*parts)


def _keys(
    caption: str,
    values: Mapping[str, Any],
    intervals: Mapping[str, Interval | ListInterval] | None = None,
    own: Own = NO_OWN,
) -> Markup:
    """Return a table of keys with their values, and with intervals where any are known."""
    columns = [Column("key"), Column("value", number=True)]
    columns += [Column("95 % interval", number=True)] * (intervals is not None)
    columns += [Column("unit"), Column("meaning")]
    rows: list[list[object]] = []
    for path, value in values.items():
        interval = (intervals or {}).get(path)
        text = value_text(value, interval)
        # a text may take several lines, a number may not
        shown = tag("span", text, class_="text") if isinstance(value, str) else text
        rows.append(
            [tag("code", path), shown, unit_text(unit_of(path, own)), meaning_of(path, own)]
        )
        if intervals is not None:
            rows[-1].insert(2, interval_text(interval))
    return table(caption, columns, rows)


def nuisances(values: Mapping[str, Any]) -> Markup:
    """Return the keys that were fitted because nothing was declared of them."""
    caption = "Keys that were not declared, with fitted values"
    return _keys(caption, values) if values else Markup()


def notes(texts: Sequence[str]) -> Markup:
    """Return what the reader should know besides."""
    return tag("ul", *(tag("li", text) for text in texts)) if texts else Markup()


def facts(given: Mapping[str, str]) -> Markup:
    """Return the small things."""
    columns = [Column("what"), Column("value")]
    rows = list(given.items())
    return table("Sizes, seeds, times and versions", columns, rows) if rows else Markup()
