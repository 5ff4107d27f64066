"""The finding of a diagnosis in one sentence, with its numbers."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from adv2e.effects import label_of
from adv2e.reports.markup import part_of, unit_of
from adv2e.reports.quantities import (
    beside,
    interval_text,
    number_text,
    readable,
    scaled,
    value_text,
)
from adv2e.reports.standing_out import compared_text, standing_out

if TYPE_CHECKING:
    from adv2e.reports.result import Diagnosis, Finding

OFF = "off"
"""Stands for the value of a key whose effect the declared model does not have."""

_MOST_KEYS = 2


def sentence_of(found: Diagnosis) -> str:
    """Return the headline: effects found with values and intervals; or the largest difference.

    Both the page and the summary in the terminal begin with it.
    """
    if found.verdict == "consistent":
        return f"Nothing is missing that these data show{_errors(found)}."
    if found.verdict == "unexplained" or not found.effects:
        return f"Something is missing that no known effect explains{_most(found)}."
    text = "; ".join(_finding(one, found) for one in found.effects)
    if found.alternatives:
        text += f"; or instead: {' or '.join(map(label_of, found.alternatives))}"
    return f"{text[:1].upper()}{text[1:]}."


def declared_text(found: Diagnosis, path: str) -> str:
    """Return the declared value of a key, in its own unit, for tables."""
    if path not in found.declared_values:
        return ""
    return _with_default(_declared(found, path), found, path)


def _declared(found: Diagnosis, path: str, factor: float = 1.0, interval: Any = None) -> str:
    value = found.declared_values[path]
    return OFF if value is None else beside(scaled(value, factor), interval)


def _with_default(text: str, found: Diagnosis, path: str) -> str:
    return f"{text} (default)" if path in found.defaults else text


def _finding(one: Finding, found: Diagnosis) -> str:
    """Return an effect with the keys that were fitted, or, if none was, those that were set."""
    paths = [path for path in one.parameters if path in one.interval] or list(one.parameters)
    shown = paths[:_MOST_KEYS]
    parts = [_value(path, one, found, alone=len(shown) == 1) for path in shown]
    label = label_of(one.name)
    return f"{label}: {', and '.join(parts)}" if parts else label


def _value(path: str, one: Finding, found: Diagnosis, *, alone: bool) -> str:
    value = one.parameters[path]
    factor, unit = readable(path, value, unit_of(path, found.own))
    interval = scaled(one.interval.get(path), factor)
    text = value_text(scaled(value, factor), interval)
    text = f"{part_of(path, alone=alone)} {text} {unit}".strip()
    if interval is not None:
        text += f" ({interval_text(interval)})"
    if path in found.declared_values:
        declared = _declared(found, path, factor, interval)
        if declared != OFF:
            declared = f"{declared} {unit}".rstrip()
        text += f", declared {_with_default(declared, found, path)}"
    return text


def _errors(found: Diagnosis) -> str:
    """Return the error of the declared model and its floor, in words."""
    for row in found.errors[:1]:
        near, floor = (number_text(one.value) for one in (row.before, row.floor))
        return f": the error of the declared model is {near}, and chance alone makes {floor}"
    return ""


def _most(found: Diagnosis) -> str:
    """Return the largest residual in numbers, numbers of events first; else the errors."""
    for one in standing_out(found.signatures)[:1]:
        return f"; it shows in the {compared_text(one.farthest)}"
    return _errors(found)
