"""The folder of a report: all its files come into place together, or not at all."""

from __future__ import annotations

import tempfile
from collections.abc import Iterable
from pathlib import Path

from adv2e.errors import OutputError
from adv2e.files.staging import Staging, nearest_there
from adv2e.reports.model_file import model_text
from adv2e.reports.page import page
from adv2e.reports.record import record_text
from adv2e.reports.result import Diagnosis

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
