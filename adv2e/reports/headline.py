"""The finding of a diagnosis in one sentence, with its numbers."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from adv2e.effects import label_of
from adv2e.reports.markup import part_of, unit_of
from adv2e.reports.quantities import (
    NO_UNIT,
    alike_texts,
    beside,
    interval_text,
    number_text,
    readable,
    scaled,
    unit_text,
    value_text,
)

if TYPE_CHECKING:
    from adv2e.reports.result import Diagnosis, Finding, Signature


OFF = "off"
"""Stands for the value of a key whose effect the declared model does not have."""

_MOST_KEYS = 2


def sentence_of(found: Diagnosis) -> str:
    """Return the headline: effects found with values and intervals; or the largest difference.

    Both the page and the summary in the terminal begin with it.
    """
    if found.verdict == "consistent":
        return f"Nothing is missing that these data show{_errors(found)}."
    if found.verdict == "unfinished":
        so_far = "; ".join(_finding(one, found) for one in found.effects) or "no effect is named"
        return f"Not finished, still {found.still}. So far: {so_far}."
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


# ---- Largest residuals: of each group of summary statistics, the one with the largest z-score.
#
# Numbers of events come first, then their times, then all else: so engineers look at a residual.
# Neighbouring statistics of a group show much the same, so that groups tell more of the missing
# effect than a list of the largest z-scores.


_KINDS = ("count", "time", "other")
LARGE_Z = 3.0
"""Distances in standard deviations from here on stand out."""


@dataclass(frozen=True)
class Standing:
    """A group of so many statistics, and how many stand out from the declared model and the other.

    `farthest` is farthest from the model found, if any stands out there, or from the declared one.
    """

    group: str
    number: int
    before: int
    after: int
    farthest: Signature


def standing_out(signatures: Sequence[Signature], *, left: bool = True) -> list[Standing]:
    """Return the groups of which a statistic stands out from either model.

    Those that stand out from the model found come before the others, unless nothing is `left`; of
    either, they are sorted by kind, and of one kind, the farthest comes first.
    """
    groups: dict[str, list[Signature]] = {}
    for one in signatures:
        groups.setdefault(one.group, []).append(one)
    found = [_standing(group, members, left) for group, members in groups.items()]
    return [one for _, one in sorted(found, key=lambda pair: pair[0]) if one.before or one.after]


def _standing(
    group: str, members: Sequence[Signature], left: bool
) -> tuple[tuple[bool, int, float], Standing]:
    """Return the group, after what it is ranked by."""
    before = sum(_size(one.z_before) > LARGE_Z for one in members)
    after = sum(_size(one.z_after) > LARGE_Z for one in members)
    of_found = left and after > 0
    distances = [_size(one.z_after if of_found else one.z_before) for one in members]
    farthest = members[distances.index(max(distances))]
    rank = not of_found, kind_rank(farthest), -max(distances)
    return rank, Standing(group, len(members), before, after, farthest)


def of_each_kind(signatures: Sequence[Signature]) -> list[Standing]:
    """Return the first group of each kind of those that stand out: for a few lines, not a table."""
    found: dict[str, Standing] = {}
    for one in standing_out(signatures):
        found.setdefault(one.farthest.kind, one)
    return list(found.values())


def kind_rank(signature: Signature) -> int:
    """Return the rank of the kind of a statistic: 0 for numbers of events, which come first."""
    return _KINDS.index(signature.kind)


def compared_text(signature: Signature) -> str:
    """Return a statistic with its measured value and that of the model found, and their unit."""
    measured, expected = alike_texts((signature.measured, signature.after))
    unit = unit_text(signature.unit) if signature.unit != NO_UNIT else f"({NO_UNIT})"
    return f"{signature.meaning}: {measured} {unit} measured, {expected} simulated"


def _size(z: float) -> float:
    """Return a distance without its sign; one that is not known is none."""
    return 0.0 if math.isnan(z) else abs(z)
