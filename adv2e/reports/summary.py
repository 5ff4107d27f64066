"""A diagnosis for the terminal: in a few lines, and all that was tried."""

from __future__ import annotations

import textwrap

from adv2e.reports.headline import compared_text, declared_text, of_each_kind
from adv2e.reports.markup import plain, unit_of
from adv2e.reports.quantities import interval_text, number_text, probability_text, value_text
from adv2e.reports.residual import by_explained
from adv2e.reports.result import Diagnosis, ErrorRow

WIDTH = 100
_MOST_PARAMETERS = 5
_MOST_CHECKS = 2


def summary_text(diagnosis: Diagnosis) -> str:
    """Return finding, verdict, effects, error and p before and after: at most some 15 lines.

    Where there are more parameters than that, it says how many.  Where nothing is named, it says
    what differs most.  What may be wrong with the recording comes last.
    """
    lines = _wrapped(diagnosis.sentence, 3)
    verdict = diagnosis.verdict.replace("_", " ")
    lines += [f"  {line}" for line in _wrapped(f"{verdict}: {diagnosis.remark}", 2)]
    lines += _parameters(diagnosis)
    if diagnosis.verdict == "unexplained":
        lines += _standing(diagnosis)
    if diagnosis.alternatives:
        lines += _wrapped(f"or instead: {', '.join(diagnosis.alternatives)}", 1)
    for row in diagnosis.errors[:1]:
        lines += _error(row)
        if row.after.value > row.before.value:  # by random events, if it is right
            for other in diagnosis.errors:
                lines += _error(other) if other.without_chance else []
    before = probability_text(diagnosis.global_p_before).removeprefix("= ")
    after = probability_text(diagnosis.global_p_after).removeprefix("= ")
    lines.append(f"p {before} -> {after}")
    for line in diagnosis.input_checks[:_MOST_CHECKS]:
        lines += _wrapped(f"note: {line}", 2)
    return "\n".join(lines)


def details_text(diagnosis: Diagnosis) -> str:
    """Return details as text: held-out data, nuisances, rejected effects, notes."""
    lines = [f"held out: {diagnosis.split}"]
    lines += [
        f"nuisance {key} = {value_text(value)} {unit_of(key)}".rstrip()
        for key, value in diagnosis.nuisances.items()
    ]
    lines += [f"rejected {one.name}: {one.reason}" for one in by_explained(diagnosis.rejected)]
    lines += [f"note: {note}" for note in diagnosis.notes]
    return "\n".join(map(plain, lines))


def _error(row: ErrorRow) -> list[str]:
    before, after, floor = (
        number_text(estimate.value) for estimate in (row.before, row.after, row.floor)
    )
    return _wrapped(f"error {before} -> {after} (floor {floor}): {row.name}", 2)


def _wrapped(text: str, most: int) -> list[str]:
    """Return `text` in at most `most` lines; where that cuts it, it ends in dots."""
    return textwrap.wrap(
        plain(text), WIDTH - 2, subsequent_indent="  ", max_lines=most, placeholder=" ..."
    )


def _parameters(diagnosis: Diagnosis) -> list[str]:
    lines = []
    for finding in diagnosis.effects:
        for path, value in finding.parameters.items():
            interval = finding.interval.get(path)
            text = f"{finding.name}: {path} = {value_text(value, interval)} "
            text += unit_of(path, diagnosis.own)
            if interval is not None:
                text = f"{text.rstrip()} ({interval_text(interval)})"
            if path in diagnosis.declared_values:
                text = f"{text.rstrip()}, declared {declared_text(diagnosis, path)}"
            lines += [f"  {line}" for line in _wrapped(text, 2)]
    if len(lines) <= _MOST_PARAMETERS:
        return lines
    more = len(lines) - _MOST_PARAMETERS + 1
    return [*lines[: _MOST_PARAMETERS - 1], f"  and {more} more parameters"]


def _standing(diagnosis: Diagnosis) -> list[str]:
    """Return lines on further residuals, one for each kind after that of the headline."""
    lines = []
    for one in of_each_kind(diagnosis.signatures)[1:]:
        lines += [f"  {line}" for line in _wrapped(compared_text(one.farthest), 2)]
    return lines
