"""The report of a diagnosis of a recording: page, record and model found."""

from __future__ import annotations

from pathlib import Path

from adv2e.diagnosis.outcome import residual
from adv2e.reports import files, findings, trials
from adv2e.reports.charts.curve_chart import curves
from adv2e.reports.markup import join, tag
from adv2e.reports.page import page_of
from adv2e.reports.result import Diagnosis
from adv2e.reports.wording import Wording

WORDING = Wording(
    title="Diagnosis of",
    command="adv2e diagnose",
    subject="recording",
    floor="independent draws of the model found against each other: as near as it comes to itself",
    bands="the middle 95 % of simulations",
    others="as declared",
)


def write_reports(diagnosis: Diagnosis, folder: str | Path, *, overwrite: bool = False) -> None:
    """Write page, record and model into a new `folder`: :func:`adv2e.reports.files.write_reports`.

    Raises
    ------
    OutputError
        As that raises it.
    """
    files.write_reports(diagnosis, folder, page, WORDING, overwrite=overwrite)


def page(diagnosis: Diagnosis) -> str:
    """Return ``report.html`` of the diagnosis of a recording."""
    pictures = join(curves(diagnosis.curves, WORDING), residual.maps(diagnosis.maps))
    sections = (
        ("Error before and after", findings.errors(diagnosis, WORDING)),
        ("What was added", findings.added(diagnosis)),
        ("What explains it as well", trials.alternatives(diagnosis)),
        ("What stands out", residual.groups(diagnosis.signatures)),
        ("The residual before and after", pictures or tag("p", "No picture was made.")),
        ("Signatures", residual.signatures(diagnosis.signatures)),
        ("What was rejected", trials.rejected(diagnosis.rejected, diagnosis.own)),
        ("What could have been seen", residual.detectable(diagnosis)),
        ("Data", residual.data(diagnosis)),
        ("Nuisances", findings.nuisances(diagnosis.nuisances)),
        ("Notes", findings.notes(diagnosis.notes)),
        ("Facts", findings.facts(diagnosis.facts)),
    )
    return page_of(diagnosis, WORDING, sections)
