"""Which differences between configurations the seeds of their trainings carry.

Two configurations differ where chance alone would hardly part their seeds so far: by the exact test
of all ways to deal the values out to both, of the difference of the means, two-sided, at 5 % over
all pairs together (Holm).  Five seeds a configuration are the least with which six pairs can pass.
What it cannot see: it is about other seeds with the same test data, not about other test data.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from itertools import combinations
from typing import Any

import numpy as np
from writing import table

LEVEL = 0.05
Values = Mapping[str, Sequence[float]]
"""One value a seed, by configuration."""


def values_of(found: Iterable[Mapping[str, Any]], name: str) -> dict[str, list[float]]:
    """Return one measure, a value a seed, by configuration."""
    values: dict[str, list[float]] = {}
    for one in found:
        values.setdefault(one["settings"]["simulator"], []).append(one["measures"][name])
    return values


def p_value(a: Sequence[float], b: Sequence[float]) -> float:
    """Return the share of all deals whose means are as far apart at least."""
    both, total = np.array([*a, *b]), len(a) + len(b)
    apart = abs(np.mean(a) - np.mean(b))
    first = both[np.array(list(combinations(range(total), len(a))))].sum(1)
    differences = first / len(a) - (both.sum() - first) / len(b)
    return float(np.mean(np.abs(differences) >= apart - 1e-12))


def parted(values: Values, level: float = LEVEL) -> list[tuple[str, str]]:
    """Return the pairs that differ, the one with the larger mean first."""
    pairs = list(combinations(values, 2))
    chances = sorted((p_value(values[a], values[b]), (a, b)) for a, b in pairs)
    found = []
    for left, (chance, (a, b)) in zip(range(len(pairs), 0, -1), chances, strict=True):
        if chance * left > level:
            break
        found.append((a, b) if np.mean(values[a]) > np.mean(values[b]) else (b, a))
    return found


def sentence(name: str, values: Values, larger_is_better: bool) -> str:
    """Return in words which configurations a measure puts apart."""
    found = [pair if larger_is_better else pair[::-1] for pair in parted(values)]
    if not found:
        return f"{name}: the seeds do not part any two configurations: no ranking."
    rest = len(list(combinations(values, 2))) - len(found)
    said = "; ".join(f"{better} is better than {worse}" for better, worse in found)
    return f"{name}: {said}. The other pairs ({rest}) are not parted by their seeds."


def report(
    found: Sequence[Mapping[str, Any]],
    measures: Mapping[str, bool],
    beside: Mapping[str, Mapping[str, float]],
) -> str:
    """Return the table of all measures and what their spread carries, in Markdown.

    `measures` tells of each whether larger is better; those that were not taken are left out.
    `beside` holds measures of what was not trained, which get a table of their own.
    """
    taken = {name: larger for name, larger in measures.items() if name in found[0]["measures"]}
    rows, said = [], []
    for name, larger in taken.items():
        values = values_of(found, name)
        for configuration, each in values.items():
            spread = f"{np.std(each, ddof=1):.4f}" if len(each) > 1 else ""
            seeds = " ".join(f"{one:.4f}" for one in each)
            rows.append([configuration, name, f"{np.mean(each):.4f}", spread, seeds])
        said.append(f"- {sentence(name, values, larger)}")
    natures = {one["settings"]["simulator"]: one["settings"]["nature"] for one in found}
    about = [f"- {name}: {nature}" for name, nature in natures.items()]
    head = ["configuration", "measure", "mean", "deviation", "each seed"]
    about_level = f"At {LEVEL:.0%} over all pairs of a measure, by the exact test of all deals:"
    lines = [table(head, rows), "", about_level, "", *said, "", *about]
    if beside:
        names = list(next(iter(beside.values())))
        cells = [[label, *(f"{each[k]:.4f}" for k in names)] for label, each in beside.items()]
        lines += ["", table(["beside", *names], cells)]
    return "\n".join(lines)
