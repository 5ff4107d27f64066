"""``report.html``: everything that a diagnosis found, in one file that needs no other."""

from __future__ import annotations

from adv2e.diagnosis.report import findings, residual
from adv2e.diagnosis.report.markup import Markup, join, tag
from adv2e.diagnosis.report.style import STYLE
from adv2e.diagnosis.result import Diagnosis

_POLICY = "default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'unsafe-inline'"
_UNFOLD = (
    "addEventListener('beforeprint', () =>"
    " document.querySelectorAll('details').forEach(part => part.open = true))"
)
"""On paper nothing is folded away."""


def page(diagnosis: Diagnosis) -> str:
    """Return the page as HTML: UTF-8, no loads from elsewhere, the same bytes every time."""
    title = f"Diagnosis of {diagnosis.recording}"
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
        *_sections(diagnosis),
    )
    document = tag("html", head, tag("body", main, tag("script", Markup(_UNFOLD))), lang="en")
    return f"<!DOCTYPE html>\n{document}\n"


def _sections(diagnosis: Diagnosis) -> list[Markup]:
    notes = tag("ul", *(tag("li", note) for note in diagnosis.notes))
    pictures = join(residual.curves(diagnosis.curves), residual.maps(diagnosis.maps))
    if not (diagnosis.curves or diagnosis.maps):
        pictures = tag("p", "No picture was made.")
    sections = (
        ("Error before and after", findings.errors(diagnosis)),
        ("What was added", findings.added(diagnosis)),
        ("What explains it as well", findings.alternatives(diagnosis)),
        ("The residual before and after", pictures),
        ("Signatures", residual.signatures(diagnosis.signatures)),
        ("What was rejected", residual.rejected(diagnosis.rejected)),
        ("What could have been seen", residual.detectable(diagnosis)),
        ("Data", residual.data(diagnosis)),
        ("Nuisances", findings.nuisances(diagnosis.nuisances)),
        ("Notes", notes if diagnosis.notes else tag("p", "None.")),
        ("Facts", residual.facts(diagnosis)),
    )
    return [tag("section", tag("h2", heading), content) for heading, content in sections]
