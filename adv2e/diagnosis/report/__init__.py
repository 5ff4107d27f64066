"""A diagnosis written out: a page, a record for programs, the model found, a summary."""

from __future__ import annotations

from pathlib import Path

from adv2e.diagnosis.report.model_file import model_text
from adv2e.diagnosis.report.page import page
from adv2e.diagnosis.report.record import record, record_text
from adv2e.diagnosis.report.summary import summary_text
from adv2e.diagnosis.result import Diagnosis
from adv2e.errors import OutputError
from adv2e.sinks.staging import Staging

__all__ = ["FILES", "check_folder", "record", "summary_text", "write_reports"]

FILES = {"report.html": page, "report.json": record_text, "model.yaml": model_text}
"""The files that are written, and what makes each."""


def check_folder(folder: str | Path, *, overwrite: bool = False) -> None:
    """Check before long work that :func:`write_reports` will take `folder`; nothing is touched.

    Raises
    ------
    OutputError
        As :func:`write_reports` raises it.
    """
    Staging(overwrite).folder(Path(folder), _foreign)


def write_reports(diagnosis: Diagnosis, folder: str | Path, *, overwrite: bool = False) -> None:
    """Write ``report.html``, ``report.json`` and ``model.yaml`` into a new `folder`.

    They come into place together, or not at all.

    Parameters
    ----------
    diagnosis : Diagnosis
    folder : str or Path
    overwrite : bool
        Replace a folder of an earlier diagnosis.

    Raises
    ------
    OutputError
        `folder` exists and is not to be replaced, holds other things than a diagnosis writes, or
        cannot be written.
    """
    texts = {name: text(diagnosis) for name, text in FILES.items()}
    staging = Staging(overwrite)
    unfinished = staging.folder(Path(folder), _foreign)
    try:
        staging.prepare()
        unfinished.mkdir()
        for name, text in texts.items():
            (unfinished / name).write_text(text, encoding="utf-8", newline="\n")
        staging.commit()
    except OSError as error:
        staging.discard()
        raise OutputError(f"{folder}: cannot be written: {error.strerror or error}") from error
    except BaseException:
        staging.discard()
        raise


def _foreign(folder: Path) -> str | None:
    """Name something in `folder` that no diagnosis writes."""
    names = sorted(entry.name for entry in folder.iterdir() if entry.name not in FILES)
    return names[0] if names else None
