"""What stands out of a residual: of each group of summary statistics, the one farthest off.

Neighbouring statistics of a group tell much the same, so that the groups that stand out, and how,
say more of what is missing than a list of the largest distances.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from adv2e.reports.result import Signature


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
    """Return the groups of which a statistic stands out from either model, the farthest first.

    Those that stand out from the model found come before the others, unless nothing is `left`.
    """
    groups: dict[str, list[Signature]] = {}
    for one in signatures:
        groups.setdefault(one.group, []).append(one)
    found = [_standing(group, members, left) for group, members in groups.items()]
    return [one for _, one in sorted(found, key=lambda pair: pair[0]) if one.before or one.after]


def _standing(
    group: str, members: Sequence[Signature], left: bool
) -> tuple[tuple[bool, float], Standing]:
    """Return the group, after what it is ranked by."""
    before = sum(_size(one.z_before) > LARGE_Z for one in members)
    after = sum(_size(one.z_after) > LARGE_Z for one in members)
    of_found = left and after > 0
    distances = [_size(one.z_after if of_found else one.z_before) for one in members]
    farthest = members[distances.index(max(distances))]
    return (not of_found, -max(distances)), Standing(group, len(members), before, after, farthest)


def _size(z: float) -> float:
    """Return a distance without its sign; one that is not known is none."""
    return 0.0 if math.isnan(z) else abs(z)
