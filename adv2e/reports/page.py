"""``report.html``: everything that was found, in one file that needs no other."""

from __future__ import annotations

from collections.abc import Iterable

from adv2e.reports.findings import verdict
from adv2e.reports.markup import Markup, tag
from adv2e.reports.result import Diagnosis
from adv2e.reports.style import STYLE
from adv2e.reports.wording import Wording

_POLICY = "default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'unsafe-inline'"
_UNFOLD = (
    "addEventListener('beforeprint', () =>"
    " document.querySelectorAll('details').forEach(part => part.open = true))"
)
"""On paper nothing is folded away."""


def page_of(diagnosis: Diagnosis, wording: Wording, sections: Iterable[tuple[str, Markup]]) -> str:
    """Return the page as HTML: UTF-8, no loads from elsewhere, the same bytes every time.

    Parameters
    ----------
    diagnosis : Diagnosis
    wording : Wording
    sections : iterable of (heading, content)
        What stands below the verdict.
    """
    title = f"{wording.title} {diagnosis.recording}"
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
        verdict(diagnosis),
        *(tag("section", tag("h2", heading), content) for heading, content in sections),
    )
    document = tag("html", head, tag("body", main, tag("script", Markup(_UNFOLD))), lang="en")
    return f"<!DOCTYPE html>\n{document}\n"
