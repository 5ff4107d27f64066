"""Sections of the page on the findings: finding, error, next steps, values, notes."""

from __future__ import annotations

import math
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from adv2e.effects import label_of, separated_by
from adv2e.reports.charts import error_chart
from adv2e.reports.headline import declared_text, of_each_kind
from adv2e.reports.markup import (
    OF_TABLES,
    Column,
    Markup,
    heading_of,
    join,
    meaning_of,
    summary_of,
    table,
    tag,
    unit_of,
)
from adv2e.reports.quantities import (
    NO_UNIT,
    interval_text,
    native,
    percent_text,
    probability_text,
    unit_text,
    value_text,
)
from adv2e.reports.result import Diagnosis, Interval, ListInterval

_LEAST_P = 0.01
"""Probability from which on chance may make what is left."""

MARKS = {
    "consistent": ("✓", "Consistent"),
    "explained": ("✓", "Explained"),
    "partly_explained": ("◐", "Partly explained"),
    "not_identifiable": ("≟", "Not identifiable"),
    "unexplained": ("✗", "Unexplained"),
    "unfinished": ("…", "Not finished"),
}
"""Sign and word of each verdict."""


def finding(diagnosis: Diagnosis) -> Markup:
    """Return the finding in a sentence, and the verdict marked by sign, word and colour."""
    sign, word = MARKS[diagnosis.verdict]
    badge = tag("span", tag("span", sign, aria_hidden="true"), f" {word}", class_="badge")
    return tag(
        "div",
        tag("p", diagnosis.sentence, class_="sentence"),
        tag("p", badge, f" {diagnosis.remark}"),
        class_=f"verdict {diagnosis.verdict}",
    )


def main_error(diagnosis: Diagnosis) -> Markup:
    """Return the error before and after, beside its floor: that which ``report.json`` gives."""
    parts: list[object] = []
    for row in diagnosis.errors[:1]:
        words = diagnosis.wording
        lines = f" Lines: {words.intervals}." if row.before.interval else ""
        about = f"Error: {row.name}; {words.error}. Floor: {words.floor}.{lines}"
        heading = "Error on data that was not used for fitting"
        parts.append(tag("figcaption", heading))
        parts += [error_chart(row, changed=bool(diagnosis.effects)), tag("p", about, class_="note")]
    before, after = (
        tag("strong", f"p {probability_text(p)}", class_="line")
        for p in (diagnosis.global_p_before, diagnosis.global_p_after)
    )
    chance: list[object] = ["Probability that chance alone differs as much: ", before]
    if diagnosis.effects:
        chance += [" before, ", after, " after"]
    parts.append(tag("p", *chance, f". {_meaning(diagnosis)}", class_="note"))
    return tag("figure", *parts, class_="main")


def _meaning(diagnosis: Diagnosis) -> str:
    """Return the meaning of p, and of the error beside its floor, for this recording."""
    p = diagnosis.global_p_after
    if math.isnan(p):
        return "Here, nobody knows."
    text = f"Here, chance {'does not' if p < _LEAST_P else 'may'} make all that is left"
    for row in diagnosis.errors[:1]:
        after, floor = row.after.value, row.floor
        most = floor.value if floor.interval is None else floor.interval[1]
        if after <= max(most, floor.value):
            text += ", and the error is at its floor"
        elif floor.value > 0.0 and math.isfinite(after):
            text += f", and the error is {percent_text(after / floor.value - 1.0)} above its floor"
    return f"{text}."


def other_errors(diagnosis: Diagnosis) -> Markup:
    figures = []
    for row in diagnosis.errors[1:]:
        chart = error_chart(row, changed=bool(diagnosis.effects))
        figures.append(tag("figure", tag("figcaption", row.name), chart))
    return join(*figures)


def what_next(diagnosis: Diagnosis, folder: str | Path) -> Markup:
    """Return the section on next steps, with command lines to copy."""
    parts = []
    for step in next_steps(diagnosis, folder):
        parts.append(tag("p", step.text))
        if step.line:
            parts.append(tag("pre", tag("code", step.line), class_="copy"))
    return tag("div", tag("h2", "What to do next"), *parts, class_="next")


def added(diagnosis: Diagnosis) -> Markup:
    """Return the effects that were found, with their values and the declared ones."""
    parts = []
    for one in diagnosis.effects:
        summary = summary_of(one.name, list(one.parameters), diagnosis.own)
        parts.append(tag("h3", heading_of(one.name)))
        if summary:
            parts.append(tag("p", summary))
        if one.parameters:
            caption = f"Values of {one.name}"
            parts.append(_keys(caption, one.parameters, diagnosis, one.interval))
    return join(*parts)


def _keys(
    caption: str,
    values: Mapping[str, Any],
    diagnosis: Diagnosis,
    intervals: Mapping[str, Interval | ListInterval] | None = None,
) -> Markup:
    """Return a table of keys with their values, and with intervals where any are known."""
    columns = [Column("key"), Column("found", number=True)]
    columns += [Column("95 % interval", number=True)] * (intervals is not None)
    columns += [Column("declared", number=True), Column("unit"), Column("meaning")]
    rows: list[list[object]] = []
    for path, value in values.items():
        interval = (intervals or {}).get(path)
        unit, meaning = unit_of(path, diagnosis.own), meaning_of(path, diagnosis.own)
        row = [tag("code", path), _value(value, interval)]
        row += [interval_text(interval)] * (intervals is not None)
        if not unit and isinstance(native(value), (int, float)):
            unit = NO_UNIT
        row += [declared_text(diagnosis, path), unit_text(unit), meaning]
        rows.append(row)
    return table(caption, columns, rows)


def _value(value: Any, interval: Sequence[Any] | None) -> object:
    """Return a value; a text may take several lines, a number may not."""
    text = value_text(value, interval)
    return tag("span", text, class_="text") if isinstance(value, str) else text


def nuisances(diagnosis: Diagnosis) -> Markup:
    """Return the keys that were fitted because nothing was declared of them."""
    values = diagnosis.nuisances
    return _keys("Keys that were not declared", values, diagnosis) if values else Markup()


def view(diagnosis: Diagnosis) -> Markup:
    """Return how the camera saw a known film, as it was fitted."""
    columns = [Column("number"), Column("fitted", number=True), Column("sought", number=True)]
    columns += [Column("unit"), Column("meaning")]
    rows: list[list[object]] = [
        [one.name, value_text(one.value), interval_text(one.bounds), one.unit, one.meaning]
        for one in diagnosis.view
        if not isinstance(one.value, list)
    ]
    return table("View of the film", columns, rows) if rows else Markup()


def notes(texts: Sequence[str]) -> Markup:
    return tag("ul", *(tag("li", text) for text in texts)) if texts else Markup()


def facts(given: Mapping[str, str]) -> Markup:
    text = "; ".join(f"{what}: {value}" for what, value in given.items())
    return tag("p", text) if given else Markup()


# ---- Next steps after a diagnosis: use the model, check the recording, record more.


_OWN_EFFECT = "adv2e diagnose RECORDING -c DECLARED.yaml --effect my_effect.py"
_WHAT_FOR = {
    "consistent": "The declared model is good as it is. Make events from another video with it:",
    "explained": "Make events from another video with the model found:",
    "partly_explained": "Make events from another video with the model found, as far as it goes:",
    "not_identifiable": "Make events from another video with the best of these models:",
}


@dataclass(frozen=True)
class Step:
    """Next step: advice, and a command line to copy, if there is one."""

    text: str
    line: str = ""


def next_steps(found: Diagnosis, folder: str | Path) -> list[Step]:
    """Return the next steps, the most useful first; `folder`: of the report."""
    if found.verdict == "unfinished":
        return [Step("Load this page again: it is written anew after each stage.")]
    if found.verdict == "unexplained":
        # mistakes are likelier than unknown effects
        checks = [Step(f"First check the recording: {note}.") for note in found.input_checks[:1]]
        return [*checks, _own_effect(found)]
    steps = [Step(_WHAT_FOR[found.verdict], convert_line(found, folder))]
    if found.verdict == "not_identifiable":
        steps.append(_separate(found))
    if found.verdict == "partly_explained":
        steps.append(_own_effect(found))
    return steps


def convert_line(found: Diagnosis, folder: str | Path) -> str:
    """Return the command that makes events with the model found."""
    line = f"adv2e convert -c {shlex.quote(str(Path(folder) / 'model.yaml'))}"
    own = found.model.get("user") or {}
    for name in own:
        line += f" --effect {shlex.quote(found.own.files.get(name, f'{name}.py'))}"
    return f"{line} VIDEO"


def _own_effect(found: Diagnosis) -> Step:
    if found.wording is OF_TABLES:  # no own effects compete there
        text = "Check whether the errors of the rows are larger than stated, for example 10 %:"
        return Step(text, "adv2e characterise TABLE -c DECLARED.yaml --error 0.1")
    groups = [one.group for one in of_each_kind(found.signatures) if one.after]
    why = f" It has to change what differs here: {', '.join(groups)}." if groups else ""
    text = "Write the effect that you suspect as a class of your own, and let it compete."
    return Step(f"{text}{why}", _OWN_EFFECT)


def _separate(found: Diagnosis) -> Step:
    names = [one.name for one in found.effects[-1:]] + found.alternatives
    known = [f"{label_of(name)}: {way}" for name in names if (way := separated_by(name))]
    if not known:
        return Step("Record a scene in which these effects differ.")
    return Step(f"Record what tells them apart. For {known[0]}.")
