"""``report.html``: everything that was found, in one file that needs no other."""

from __future__ import annotations

from pathlib import Path

from adv2e.reports import findings, residual, trials
from adv2e.reports.charts.curve_chart import curves
from adv2e.reports.events import events
from adv2e.reports.markup import Markup, tag
from adv2e.reports.result import Diagnosis
from adv2e.reports.style import STYLE

_POLICY = "default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'unsafe-inline'"
_UNFOLD = (
    "addEventListener('beforeprint', () =>"
    " document.querySelectorAll('details.paper').forEach(part => part.open = true))"
)
"""Script that unfolds sections marked for paper before printing; other folded ones are left out."""


def page(diagnosis: Diagnosis, folder: str | Path = ".") -> str:
    """Return the page as HTML: UTF-8, no loads from elsewhere, the same bytes every time.

    It begins with the finding, the error, the events, and what to do next; `folder` is where
    ``model.yaml`` lies.  Sections that hold nothing are left out.
    """
    found = diagnosis
    sections = {
        "What was found": findings.added(found),
        "Effects that fit as well": trials.alternatives(found),
        "What differs most": residual.groups(found),
        "Curves: measured and simulated": curves(found.curves, found.wording),
        "Values that were not declared and were fitted": findings.nuisances(found),
        "Notes": findings.notes(found.notes),
    }
    folded = {
        "Pixels with too many or too few events": (residual.maps(found.maps), True),
        "Effects that were tried and not added": (trials.rejected(found), True),
        "Which data were used": (residual.data(found), True),
        "Other measures of the error": (findings.other_errors(found), False),
        "All numbers that were compared": (residual.signatures(found.signatures), False),
        "How large an effect must be to be seen": (residual.detectable(found.detectable), False),
        "Sizes, seeds, times and versions": (findings.facts(found.facts), True),
    }
    title = f"{found.wording.title} {found.recording}"
    head = tag(
        "head",
        tag("meta", charset="utf-8"),
        tag("meta", http_equiv="Content-Security-Policy", content=_POLICY),
        tag("meta", name="viewport", content="width=device-width, initial-scale=1"),
        tag("title", title),
        tag("style", Markup(STYLE)),
    )
    main = tag(
        "main",
        tag("h1", title),
        tag("p", "Declared model: ", found.declared, class_="note"),
        findings.finding(found),
        findings.main_error(found),
        events(found),
        findings.what_next(found, folder),
        *(
            tag("section", tag("h2", heading), content)
            for heading, content in sections.items()
            if content
        ),
        *(
            _folded(heading, content, on_paper=on_paper)
            for heading, (content, on_paper) in folded.items()
            if content
        ),
    )
    document = tag("html", head, tag("body", main, tag("script", Markup(_UNFOLD))), lang="en")
    return f"<!DOCTYPE html>\n{document}\n"


def _folded(heading: str, content: Markup, *, on_paper: bool) -> Markup:
    """Return a section that opens when its heading is clicked."""
    summary = tag("summary", tag("h2", heading))
    return tag("details", summary, content, class_="paper" if on_paper else "screen")
