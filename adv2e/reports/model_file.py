"""``model.yaml``: the configuration found, with what is known of each key as comments."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from adv2e.config.yaml12 import scalar_text
from adv2e.reports.keys import unit_of
from adv2e.reports.markup import plain
from adv2e.reports.quantities import interval_text, native
from adv2e.reports.result import Diagnosis, Own

_WIDTH = 100


def model_text(diagnosis: Diagnosis) -> str:
    """Return the configuration found as YAML that ``adv2e convert -c`` takes.

    Keys that were added, and nuisances, say so; every key that has a unit names it.
    """
    origins = _origins(diagnosis)
    lines = list(_lines(native(diagnosis.model), "", 0, _Notes(origins, diagnosis.own)))
    return "\n".join([*_head(diagnosis), "", *(lines or ["{}"]), ""])


def _head(diagnosis: Diagnosis) -> list[str]:
    wording = diagnosis.wording
    texts = [
        f"Model found by {wording.command} in {diagnosis.recording},"
        f" on top of {diagnosis.declared}: {diagnosis.verdict}.",
        diagnosis.sentence,
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


def _lines(values: Mapping[str, Any], path: str, depth: int, notes: _Notes) -> Iterator[str]:
    for name, value in values.items():
        full = f"{path}.{name}" if path else name
        start = f"{'  ' * depth}{scalar_text(name)}:"
        if isinstance(value, dict) and value:
            yield f"{start}{notes.comment(full)}"
            yield from _lines(value, full, depth + 1, notes)
        else:
            yield f"{start} {_flow(value)}{notes.comment(full)}"


def _flow(value: Any) -> str:
    if isinstance(value, dict):
        return (
            f"{{{', '.join(f'{scalar_text(key)}: {_flow(item)}' for key, item in value.items())}}}"
        )
    if isinstance(value, list):
        return f"[{', '.join(_flow(item) for item in value)}]"
    return scalar_text(value)


@dataclass(frozen=True)
class _Notes:
    """What is said of keys: where values that were not declared are from, and units."""

    origins: Mapping[str, str]
    own: Own

    def comment(self, path: str) -> str:
        unit = unit_of(path, self.own)
        notes = [f"[{unit}]"] if unit else []
        if path in self.origins:
            notes.append(self.origins[path])
        return f"  # {' '.join(plain(' '.join(notes)).split())}" if notes else ""
