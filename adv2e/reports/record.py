"""``report.json``: what a diagnosis found, for programs."""

from __future__ import annotations

import json
import math
from typing import Any

from adv2e.reports.quantities import native
from adv2e.reports.result import Diagnosis, Estimate


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
    error: dict[str, Any] = {"name": None, "before": None, "after": None, "floor": None}
    for row in diagnosis.errors[:1]:
        values = row.before.value, row.after.value, row.floor.value
        error = dict(zip(error, (row.name, *values), strict=True))
    return {
        "verdict": diagnosis.verdict,
        "effects": [
            {"name": one.name, "parameters": one.parameters, "interval": one.interval}
            for one in diagnosis.effects
        ],
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
        diagnosis.wording.subject: diagnosis.recording,
        "declared": diagnosis.declared,
        "errors": [
            {
                "name": row.name,
                "before": _estimate(row.before),
                "after": _estimate(row.after),
                "floor": _estimate(row.floor),
            }
            for row in diagnosis.errors
        ],
        "signature_values": [
            {
                "name": one.name,
                "group": one.group,
                "meaning": one.meaning,
                "measured": one.measured,
                "before": one.before,
                "after": one.after,
            }
            for one in diagnosis.signatures
        ],
        "trials": [
            {"name": one.name, "parameters": one.parameters, "held_out": one.held_out}
            for one in diagnosis.rejected
        ],
        "detectable": [
            {"name": one.name, "key": one.key, "size": one.size, "unit": one.unit}
            for one in diagnosis.detectable
        ],
        "masked": [{"what": one.what, "share": one.share} for one in diagnosis.masked],
        "split": diagnosis.split,
        "notes": diagnosis.notes,
        "facts": diagnosis.facts,
    }


def _estimate(estimate: Estimate) -> dict[str, Any]:
    return {"value": estimate.value, "interval": estimate.interval}


def _finite(value: Any) -> Any:
    if isinstance(value, float) and not math.isfinite(value):
        return None
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_finite(item) for item in value]
    return value
