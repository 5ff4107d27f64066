"""The report of a diagnosis of a recording."""

from __future__ import annotations

from pathlib import Path

from adv2e.diagnosis.outcome.report.page import WORDING, page
from adv2e.reports import files
from adv2e.reports.result import Diagnosis


def write_reports(diagnosis: Diagnosis, folder: str | Path, *, overwrite: bool = False) -> None:
    """Write page, record and model into a new `folder`: :func:`adv2e.reports.files.write_reports`.

    Raises
    ------
    OutputError
        As that raises it.
    """
    files.write_reports(diagnosis, folder, page, WORDING, overwrite=overwrite)
