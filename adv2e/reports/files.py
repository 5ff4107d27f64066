"""Files of a report: ``report.json``, and all of them in place together or not at all."""

from __future__ import annotations

import json
import math
import tempfile
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from adv2e.errors import OutputError
from adv2e.files.staging import Staging, nearest_there
from adv2e.reports.model_file import model_text
from adv2e.reports.page import page
from adv2e.reports.quantities import native
from adv2e.reports.result import ROLES, Diagnosis

NAMES = ("report.html", "report.json", "model.yaml")


def check_folder(
    folder: str | Path, *, overwrite: bool = False, inputs: Iterable[str | Path] = ()
) -> None:
    """Check before long work that :func:`write_reports` will take `folder`.

    What is there is not touched; a nameless file is made for a moment where the folder would be
    made, as nothing else tells everywhere whether that can be done.

    Raises
    ------
    OutputError
        As :func:`write_reports` raises it; or one of the `inputs` would be lost.
    """
    Staging(overwrite, inputs).folder(Path(folder), _foreign)
    above = nearest_there(Path(folder).absolute())
    try:
        with tempfile.TemporaryFile(dir=above):
            pass
    except OSError as error:
        raise OutputError(f"{folder}: cannot be made in {above}: {error.strerror}") from None


def write_reports(diagnosis: Diagnosis, folder: str | Path, *, overwrite: bool = False) -> None:
    """Write ``report.html``, ``report.json`` and ``model.yaml`` into a new `folder`.

    With `overwrite`, the folder of an earlier report is replaced.

    Raises
    ------
    OutputError
        `folder` exists and is not to be replaced, holds other things than a report, or cannot be
        written.
    """
    texts = (page(diagnosis, folder), record_text(diagnosis), model_text(diagnosis))
    try:
        with Staging(overwrite) as staging:
            unfinished = staging.folder(Path(folder), _foreign)
            staging.prepare()
            unfinished.mkdir()
            for name, text in zip(NAMES, texts, strict=True):
                (unfinished / name).write_text(text, encoding="utf-8", newline="\n")
    except OSError as error:
        raise OutputError(f"{folder}: cannot be written: {error.strerror or error}") from error


def _foreign(folder: Path) -> str | None:
    """Name something in `folder` that no report holds."""
    names = sorted(entry.name for entry in folder.iterdir() if entry.name not in NAMES)
    return names[0] if names else None


# ---- ``report.json``: what a diagnosis found, for programs.


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
