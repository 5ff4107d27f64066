"""The report of a table: page, record and model found, and what the terminal says."""

from __future__ import annotations

from pathlib import Path

from adv2e.reports import files, findings, trials
from adv2e.reports.charts.curve_chart import curves
from adv2e.reports.keys import unit_of
from adv2e.reports.markup import plain, tag
from adv2e.reports.page import page_of
from adv2e.reports.quantities import value_text
from adv2e.reports.result import Diagnosis
from adv2e.reports.summary import summary_text
from adv2e.reports.wording import Wording

WORDING = Wording(
    title="Characterisation of",
    command="adv2e characterise",
    subject="table",
    floor="the standard errors of the table's rows",
    bands="the middle 95 % of fits to tables drawn from the model",
    others="as declared; what was not is off, or its default where a table cannot show it",
)


def write_reports(found: Diagnosis, folder: str | Path, *, overwrite: bool = False) -> None:
    """Write page, record and model into a new `folder`: :func:`adv2e.reports.files.write_reports`.

    Raises
    ------
    OutputError
        As that raises it.
    """
    files.write_reports(found, folder, page, WORDING, overwrite=overwrite)


def page(found: Diagnosis) -> str:
    """Return ``report.html`` of a table."""
    sections = (
        ("Error before and after", findings.errors(found, WORDING)),
        ("What was added", findings.added(found)),
        ("What explains it as well", trials.alternatives(found)),
        ("Measured and predicted", curves(found.curves, WORDING)),
        ("What was rejected", trials.rejected(found.rejected)),
        ("Data", tag("p", f"Held out: {found.split}.")),
        ("Nuisances", findings.nuisances(found.nuisances)),
        ("Notes", findings.notes(found.notes)),
        ("Facts", findings.facts(found.facts)),
    )
    return page_of(found, WORDING, sections)


def summary(found: Diagnosis) -> str:
    """Return the report for a terminal, where it may be all that is asked for."""
    lines = [f"held out: {found.split}"]
    lines += [
        f"nuisance {key} = {value_text(value)} {unit_of(key)}".rstrip()
        for key, value in found.nuisances.items()
    ]
    lines += [f"rejected {item.name}: {item.reason}" for item in found.rejected]
    lines += [f"note: {note}" for note in found.notes]
    return "\n".join([summary_text(found), *map(plain, lines)])
