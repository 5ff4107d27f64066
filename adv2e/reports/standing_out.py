"""Largest residuals: of each group of summary statistics, the one with the largest z-score.

Numbers of events come first, then their times, then all else: so engineers look at a residual.
Neighbouring statistics of a group show much the same, so that groups tell more of the missing
effect than a list of the largest z-scores.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from adv2e.reports.quantities import NO_UNIT, alike_texts, unit_text

if TYPE_CHECKING:
    from adv2e.reports.result import Signature


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
