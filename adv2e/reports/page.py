"""``report.html``: everything that was found, in one file that needs no other."""

from __future__ import annotations

from adv2e.reports import findings, residual, trials
from adv2e.reports.charts.curve_chart import curves
from adv2e.reports.markup import Markup, join, tag
from adv2e.reports.result import Diagnosis
from adv2e.reports.style import STYLE

_POLICY = "default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'unsafe-inline'"
_UNFOLD = (
    "addEventListener('beforeprint', () =>"
    " document.querySelectorAll('details').forEach(part => part.open = true))"
)
"""On paper nothing is folded away."""


def page(diagnosis: Diagnosis) -> str:
    """Return the page as HTML: UTF-8, no loads from elsewhere, the same bytes every time.

    Sections that hold nothing are left out.
    """
    pictures = curves(diagnosis.curves, diagnosis.wording), residual.maps(diagnosis.maps)
    sections = {
        "Error before and after": findings.errors(diagnosis),
        "What was added": findings.added(diagnosis),
        "What explains it as well": trials.alternatives(diagnosis),
        "What stands out": residual.groups(diagnosis.signatures),
        "The residual before and after": join(*pictures),
        "Signatures": residual.signatures(diagnosis.signatures),
        "What was rejected": trials.rejected(diagnosis.rejected, diagnosis.own),
        "What could have been seen": residual.detectable(diagnosis.detectable),
        "Data": residual.data(diagnosis),
        "Nuisances": findings.nuisances(diagnosis.nuisances),
        "Notes": findings.notes(diagnosis.notes),
        "Facts": findings.facts(diagnosis.facts),
    }
    title = f"{diagnosis.wording.title} {diagnosis.recording}"
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
        tag("p", "Declared model: ", diagnosis.declared, class_="note"),
        findings.verdict(diagnosis),
        *(
            tag("section", tag("h2", heading), content)
            for heading, content in sections.items()
            if content
        ),
    )
    document = tag("html", head, tag("body", main, tag("script", Markup(_UNFOLD))), lang="en")
    return f"<!DOCTYPE html>\n{document}\n"
