"""``report.json``: what a diagnosis found, for programs."""

from __future__ import annotations

import json
import math
from typing import Any

from adv2e.reports.quantities import native
from adv2e.reports.result import ROLES, Diagnosis


def record(diagnosis: Diagnosis) -> dict[str, Any]:
    """Return the content of ``report.json``.

    The keys up to ``signatures`` are what programs may rely on; those after it hold the rest of
    what the page shows.  Numbers are finite, or None.
    """
    content = {**_fixed(diagnosis), **_further(diagnosis)}
    finite: dict[str, Any] = _finite(native(content))
    return finite


def record_text(diagnosis: Diagnosis) -> str:
    """Return ``report.json`` as text."""
    return json.dumps(record(diagnosis), indent=2, allow_nan=False) + "\n"


def _fixed(diagnosis: Diagnosis) -> dict[str, Any]:
    error: dict[str, Any] = dict.fromkeys(("name", *ROLES))
    for row in diagnosis.errors[:1]:
        error = {"name": row.name, **{role: getattr(row, role).value for role in ROLES}}
    return {
        "verdict": diagnosis.verdict,
        "effects": [vars(one) for one in diagnosis.effects],
        "alternatives": diagnosis.alternatives,
        "nuisances": diagnosis.nuisances,
        "rejected": [{"name": one.name, "reason": one.reason} for one in diagnosis.rejected],
        "error": {**error, "held_out": bool(diagnosis.errors)},
        "global_p": {"before": diagnosis.global_p_before, "after": diagnosis.global_p_after},
        "signatures": [
            {"name": one.name, "z_before": one.z_before, "z_after": one.z_after}
            for one in diagnosis.signatures
        ],
    }


def _further(diagnosis: Diagnosis) -> dict[str, Any]:
    return {
        "sentence": diagnosis.sentence,
        "remark": diagnosis.remark,
        diagnosis.wording.subject: diagnosis.recording,
        "declared": diagnosis.declared,
        "declared_values": diagnosis.declared_values,
        "errors": [
            {"name": row.name, **{role: vars(getattr(row, role)) for role in ROLES}}
            for row in diagnosis.errors
        ],
        "signature_values": [
            {key: value for key, value in vars(one).items() if not key.startswith("z_")}
            for one in diagnosis.signatures
        ],
        "trials": [
            {"name": one.name, "parameters": one.parameters, "held_out": one.held_out}
            for one in diagnosis.rejected
        ],
        "detectable": list(map(vars, diagnosis.detectable)),
        "masked": list(map(vars, diagnosis.masked)),
        "split": diagnosis.split,
        "notes": diagnosis.notes,
        "facts": diagnosis.facts,
    }


def _finite(value: Any) -> Any:
    if isinstance(value, float) and not math.isfinite(value):
        return None
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_finite(item) for item in value]
    return value
