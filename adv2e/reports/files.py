"""Files of a report, ``report.json`` and ``model.yaml`` among them: all in place, or none.

A report that is not finished may always be replaced.
"""

from __future__ import annotations

import json
import os
import tempfile
import textwrap
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from adv2e.config.yaml12 import scalar_text
from adv2e.errors import Adv2eWarning, DataError, OutputError
from adv2e.files.regular import read_text, shown
from adv2e.files.staging import Staging, nearest_there
from adv2e.label import report_of
from adv2e.process import signals
from adv2e.reports.markup import plain, unit_of
from adv2e.reports.page import page
from adv2e.reports.quantities import interval_text, native
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
    _placed(Staging(overwrite or is_unfinished(folder), inputs), Path(folder))
    above = nearest_there(Path(folder).absolute())
    try:
        with tempfile.TemporaryFile(dir=above):
            pass
    except OSError as error:
        raise OutputError(f"{folder}: cannot be made in {above}: {error.strerror}") from None


def write_reports(diagnosis: Diagnosis, folder: str | Path, *, overwrite: bool = False) -> None:
    """Write ``report.html``, ``report.json`` and ``model.yaml`` into a new `folder`.

    With `overwrite`, the folder of an earlier report is replaced.  One that is not finished always
    is; what somebody laid beside it meanwhile stays.

    Raises
    ------
    OutputError
        `folder` exists and is not to be replaced, holds other things than a report, or cannot be
        written.
    """
    texts = (page(diagnosis, folder), record_text(diagnosis), model_text(diagnosis))
    try:
        with Staging(overwrite or is_unfinished(folder)) as staging:
            paths = _placed(staging, Path(folder))
            staging.prepare()
            for path, text in zip(paths, texts, strict=True):
                path.parent.mkdir(exist_ok=True)
                path.write_text(text, encoding="utf-8", newline="\n")
    except OSError as error:
        raise OutputError(f"{folder}: cannot be written: {error.strerror or error}") from error


def _placed(staging: Staging, folder: Path) -> list[Path]:
    """Return the temporary names of the files of a report in a folder."""
    if is_unfinished(folder) and _foreign(folder):
        return [staging.file(folder / name) for name in NAMES]
    unfinished = staging.folder(folder, _foreign)
    return [unfinished / name for name in NAMES]


def _foreign(folder: Path) -> str | None:
    """Name something in `folder` that no report holds."""
    names = sorted(entry.name for entry in folder.iterdir() if entry.name not in NAMES)
    return names[0] if names else None


def is_unfinished(folder: str | Path) -> bool:
    """Tell whether a folder holds the report of a diagnosis that is not finished."""
    with suppress(DataError, ValueError, AttributeError):
        return json.loads(read_text(Path(folder) / NAMES[1])).get("complete") is False
    return False


@contextmanager
def so_far(
    folder: str | Path, *, overwrite: bool = False, inputs: Iterable[str | Path] = ()
) -> Iterator[Callable[[Diagnosis], None]]:
    """Check `folder`, and give what writes reports on what is known so far, until one is finished.

    They stand in `folder`; while an older finished report does, in ``FOLDER.unfinished`` beside it.
    What interrupts the body leaves them, and an error does not.  Where one cannot be written, a
    warning says so, and the work goes on.

    Raises
    ------
    OutputError
        As :func:`check_folder` raises it, of either folder.
    """
    check_folder(folder, overwrite=overwrite, inputs=inputs)
    place, written = Path(folder), False
    if os.path.lexists(folder) and not is_unfinished(folder):
        older = Path(os.path.realpath(folder))
        place = older.with_name(f"{older.name}.unfinished")
        check_folder(place)

    def last_words() -> str:
        page = place / NAMES[0]
        return f"; what was known by then: {shown(page)}" if page.exists() else ""

    def write(diagnosis: Diagnosis) -> None:
        nonlocal written
        signals.say_at_end(last_words)
        try:
            write_reports(diagnosis, place)
        except OutputError as error:
            warnings.warn(f"what is known so far cannot be kept: {error}", Adv2eWarning, 2)
            return
        written = True

    def ended() -> None:
        signals.say_at_end(str)
        if written and is_unfinished(place):
            with suppress(OSError):  # something else may lie there by now
                for name in NAMES:
                    (place / name).unlink()
                place.rmdir()

    try:
        yield write
    except BaseException as error:
        if isinstance(error, Exception):
            ended()
        raise
    ended()


# ---- ``report.json``: what a diagnosis found, for programs.


def record(diagnosis: Diagnosis) -> dict[str, Any]:
    """Return the content of ``report.json``.

    The keys up to ``signatures`` are what programs may rely on; those after it hold the rest of
    what the page shows.  Numbers are finite, or None.
    """
    text = json.dumps({**_fixed(diagnosis), **_further(diagnosis)}, default=native)
    finite: dict[str, Any] = json.loads(text, parse_constant=lambda constant: None)
    return finite


def record_text(diagnosis: Diagnosis) -> str:
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
        "complete": diagnosis.verdict != "unfinished",
        "sentence": diagnosis.sentence,
        "remark": diagnosis.remark,
        diagnosis.wording.subject: diagnosis.recording,
        "declared": diagnosis.declared,
        "declared_values": diagnosis.declared_values,
        "view": [vars(one) for one in diagnosis.view],
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
        "label": report_of({}, diagnosis.notes),
        "facts": diagnosis.facts,
    }


# ---- ``model.yaml``: the configuration found, with what is known of each key as comments.


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
            yield f"{start} {scalar_text(value)}{comment(full)}"
