"""``model.yaml``: the configuration found, with what is known of each key as comments."""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Iterator, Mapping
from typing import Any

from adv2e.config.yaml12 import scalar_text
from adv2e.reports.keys import unit_of
from adv2e.reports.markup import plain
from adv2e.reports.quantities import interval_text, native
from adv2e.reports.result import Diagnosis

_WIDTH = 100

Comment = Callable[[str], str]
"""Comment on a key by its path: its unit, and the origin of a value that was not declared."""


def model_text(diagnosis: Diagnosis) -> str:
    """Return the configuration found as YAML that ``adv2e convert -c`` takes.

    Keys that were added, and nuisances, say so; every key that has a unit names it.
    """
    origins = _origins(diagnosis)

    def comment(path: str) -> str:
        unit = unit_of(path, diagnosis.own)
        notes = f"{f'[{unit}] ' * bool(unit)}{origins.get(path, '')}"
        return f"  # {' '.join(plain(notes).split())}" if notes else ""

    lines = list(_lines(native(diagnosis.model), "", 0, comment))
    return "\n".join([*_head(diagnosis), "", *(lines or ["{}"]), ""])


def _head(diagnosis: Diagnosis) -> list[str]:
    wording = diagnosis.wording
    texts = [
        f"Model found by {wording.command} in {diagnosis.recording},"
        f" on top of {diagnosis.declared}: {diagnosis.verdict}.",
        f"{diagnosis.sentence} {diagnosis.remark}",
        "Keys marked 'added' belong to effects that the declared model lacked; those marked"
        f" 'nuisance' were not declared and were fitted; all others are {wording.others}.",
    ]
    return [
        line
        for text in texts
        for line in textwrap.wrap(
            plain(text), _WIDTH, initial_indent="# ", subsequent_indent="# ", break_on_hyphens=False
        )
    ]


def _origins(diagnosis: Diagnosis) -> dict[str, str]:
    """Return for each key that was not declared where its value is from."""
    origins = dict.fromkeys(diagnosis.nuisances, "nuisance")
    for finding in diagnosis.effects:
        for path in finding.parameters:
            interval = finding.interval.get(path)
            text = f"added: {finding.name}"
            if interval is not None:
                text += f", 95 % interval {interval_text(interval)}"
            origins[path] = text
    return origins


def _lines(values: Mapping[str, Any], path: str, depth: int, comment: Comment) -> Iterator[str]:
    for name, value in values.items():
        full = f"{path}.{name}" if path else name
        start = f"{'  ' * depth}{scalar_text(name)}:"
        if isinstance(value, dict) and value:
            yield f"{start}{comment(full)}"
            yield from _lines(value, full, depth + 1, comment)
        else:
            yield f"{start} {_flow(value)}{comment(full)}"


def _flow(value: Any) -> str:
    if isinstance(value, dict):
        return (
            f"{{{', '.join(f'{scalar_text(key)}: {_flow(item)}' for key, item in value.items())}}}"
        )
    if isinstance(value, list):
        return f"[{', '.join(_flow(item) for item in value)}]"
    return scalar_text(value)
