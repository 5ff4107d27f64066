"""``report.html``: everything that was found and its looks, in one file that needs no other."""

from __future__ import annotations

from pathlib import Path

from adv2e.reports import findings, residual
from adv2e.reports.charts import curves
from adv2e.reports.events import events
from adv2e.reports.markup import Markup, tag
from adv2e.reports.result import Diagnosis

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
        "Effects that fit as well": residual.alternatives(found),
        "What differs most": residual.groups(found),
        "Curves: measured and simulated": curves(found.curves, found.wording),
        "Values that were not declared and were fitted": findings.nuisances(found),
        "View of the film, which was fitted": findings.view(found),
        "Notes": findings.notes(found.notes),
    }
    # those for paper are unfolded before printing
    folded = {
        "Pixels with too many or too few events": (residual.maps(found.maps), "paper"),
        "Effects that were tried and not added": (residual.rejected(found), "paper"),
        "Which data were used": (residual.data(found), "paper"),
        "Other measures of the error": (findings.other_errors(found), "screen"),
        "All numbers that were compared": (residual.signatures(found), "screen"),
        "How large an effect must be to be seen": (residual.detectable(found.detectable), "screen"),
        "Sizes, seeds, times and versions": (findings.facts(found.facts), "paper"),
    }
    return document(
        f"{found.wording.title} {found.recording}",
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
            tag("details", tag("summary", tag("h2", heading)), content, class_=medium)
            for heading, (content, medium) in folded.items()
            if content
        ),
    )


def document(title: str, *content: object) -> str:
    """Return a whole page with a title, and content below it."""
    head = tag(
        "head",
        tag("meta", charset="utf-8"),
        tag("meta", http_equiv="Content-Security-Policy", content=_POLICY),
        tag("meta", name="viewport", content="width=device-width, initial-scale=1"),
        tag("title", title),
        tag("style", Markup(STYLE)),
    )
    main = tag("main", tag("h1", title), *content)
    whole = tag("html", head, tag("body", main, tag("script", Markup(_UNFOLD))), lang="en")
    return f"<!DOCTYPE html>\n{whole}\n"


# ---- The looks of the page: light and dark, on screen and on paper.
#
# The colours of the two models are those of Okabe and Ito (jfly.uni-koeln.de/color, 2008), which
# colour-blind readers tell apart; in dark, the lighter ones of the same hues.


STYLE = """
:root {
  color-scheme: light dark;
  --ink: #1a1a1a; --soft: #5a5a5a; --paper: #ffffff; --line: #d9d9d9; --panel: #f5f6f8;
  --before: #c25100; --after: #0072b2; --floor: #6b6b6b;
  --good: #00694e; --fair: #8a5a00; --poor: #a3231f; --fifth: #7d4698;
}
@media screen and (prefers-color-scheme: dark) {
  :root {
    --ink: #e8e8e8; --soft: #a8a8a8; --paper: #16181b; --line: #3b3f45; --panel: #202327;
    --before: #f0a13c; --after: #62bdf2; --floor: #a5a5a5;
    --good: #4fc9a4; --fair: #e6b450; --poor: #ff8a80; --fifth: #cfa1e6;
  }
}
* { box-sizing: border-box; }
body {
  margin: 0; background: var(--paper); color: var(--ink);
  font: 15px/1.5 system-ui, -apple-system, "Segoe UI", "Helvetica Neue", Arial, sans-serif;
}
main { max-width: 960px; margin: 0 auto; padding: 20px 20px 48px; }
h1 { font-size: 1.2rem; margin: 0; }
h1 + .note { margin: 0; }
h2 {
  font-size: 1.2rem; margin: 2.2em 0 0.5em; padding-bottom: 0.2em;
  border-bottom: 1px solid var(--line);
}
h3 { font-size: 1rem; margin: 1.4em 0 0.3em; }
p { margin: 0.5em 0; max-width: 46em; }
p, li, h1, h2, td::before { overflow-wrap: anywhere; }
td, th { overflow-wrap: break-word; }
code { font: 0.92em ui-monospace, "SF Mono", Menlo, Consolas, monospace; }
.note, .meaning { color: var(--soft); font-size: 0.87rem; }
.verdict {
  margin: 12px 0; padding: 8px 18px; background: var(--panel);
  border-left: 6px solid var(--mark); border-radius: 4px;
}
.consistent, .explained { --mark: var(--good); }
.partly_explained, .not_identifiable, .unfinished { --mark: var(--fair); }
.unexplained { --mark: var(--poor); }
.badge {
  color: var(--mark); border: 2px solid var(--mark); border-radius: 999px;
  padding: 1px 12px; margin-right: 6px; font-weight: 700; white-space: nowrap;
}
.sentence { font-size: 1.4rem; line-height: 1.35; font-weight: 600; margin: 0.3em 0; }
.next h2 { margin-top: 1em; }
.copy {
  margin: 6px 0; padding: 8px 12px; background: var(--panel); border: 1px solid var(--line);
  border-radius: 4px; white-space: pre-wrap; overflow-wrap: anywhere; user-select: all;
}
.scroll { overflow-x: auto; }
table { border-collapse: collapse; width: 100%; margin: 10px 0 16px; font-size: 0.9rem; }
caption { text-align: left; color: var(--soft); padding: 4px 0; }
th, td {
  text-align: left; vertical-align: top; padding: 5px 10px 5px 0;
  border-bottom: 1px solid var(--line);
}
thead th { border-bottom: 2px solid var(--line); }
tbody th { font-weight: 600; min-width: 9em; }
.number { text-align: right; font-variant-numeric: tabular-nums; white-space: nowrap; }
td.number, th.number { padding-left: 10px; }
.number + td:not(.number), .number + th:not(.number) { padding-left: 10px; }
td { min-width: 3em; }
.number .text { white-space: normal; overflow-wrap: anywhere; }
.meaning, .line { display: block; font-weight: 400; }
.long { min-width: 15em; }
thead th.number { white-space: normal; }
.line { white-space: nowrap; }
strong.line { display: inline; font-weight: 700; }
.large { color: var(--before); white-space: nowrap; }
details > summary { cursor: pointer; padding: 6px 0; color: var(--after); }
summary h2 { display: inline; border: 0; margin: 0; padding: 0; }
main > details { border-bottom: 1px solid var(--line); margin-top: 6px; padding: 4px 0; }
section + details { margin-top: 2em; }
.bars { display: grid; gap: 7px; margin: 6px 0; }
.bar {
  display: grid; grid-template-columns: 15.5em 1fr 11.5em; gap: 2px 10px; align-items: center;
}
.bar .role { font-size: 0.9rem; }
.bar .role strong { color: var(--role); }
.bar .number { text-align: left; }
.track { position: relative; height: 16px; }
.fill { position: absolute; inset: 0 auto 0 0; background: var(--role); opacity: 0.55; }
.whisker { position: absolute; top: 7px; height: 2px; min-width: 2px; background: var(--ink); }
.legend {
  display: flex; flex-wrap: wrap; gap: 4px 18px; margin: 8px 0; padding: 0; list-style: none;
  font-size: 0.87rem;
}
.swatch { display: inline-block; width: 24px; margin-right: 6px; vertical-align: middle; }
.swatch { border-top: 2px solid var(--role); }
.swatch.before { border-top-style: dashed; }
.swatch.shaded {
  height: 12px; border: 0; background: linear-gradient(90deg, var(--before), var(--after));
  opacity: 0.3;
}
figure { margin: 0; min-width: 0; overflow-x: auto; }
figcaption { font-size: 0.9rem; font-weight: 600; margin: 6px 0; }
figcaption.note { font-weight: 400; }
.side { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(340px, 100%), 1fr)); }
.side { gap: 18px 24px; align-items: start; margin: 10px 0; }
.three { display: grid; grid-template-columns: repeat(3, minmax(0, 1fr)); gap: 6px 12px; }
.three figure { align-self: end; }
.three img.map { border: 1px solid var(--line); }
img.map { width: 100%; height: auto; image-rendering: pixelated; display: block; }
svg { display: block; width: 100%; max-width: 560px; height: auto; }
svg text { font-size: 11px; fill: var(--soft); }
svg .label { fill: var(--ink); }
svg .grid { stroke: var(--line); stroke-width: 0.7; }
svg .axis { stroke: var(--soft); stroke-width: 1; }
.before { --role: var(--before); }
.after { --role: var(--after); }
.floor { --role: var(--floor); }
.measured { --role: var(--ink); }
.hue0 { --role: var(--after); }
.hue1 { --role: var(--before); }
.hue2 { --role: var(--good); }
.hue3 { --role: var(--fifth); }
.hue4 { --role: var(--floor); }
.dash1 { stroke-dasharray: 7 3; }
.dash2 { stroke-dasharray: 2 3; }
.dash3, .dash4 { stroke-dasharray: 9 3 2 3; }
.value { display: block; }
.legend svg { display: inline-block; width: 26px; margin-right: 6px; vertical-align: middle; }
svg .mark { stroke: var(--soft); stroke-width: 1; stroke-dasharray: 2 2; }
svg .band { fill: var(--role); fill-opacity: 0.2; stroke: none; }
svg .curve { fill: none; stroke: var(--role); stroke-width: 1.6; stroke-linejoin: round; }
svg .curve.before { stroke-dasharray: 5 3; }
svg .curve.measured { stroke-width: 2.2; }
svg .dot { fill: var(--role); }
@media screen and (max-width: 600px) {
  main { padding: 10px 12px 32px; }
  h1 { font-size: 1rem; }
  .verdict { padding: 6px 12px; }
  .sentence { font-size: 1.15rem; }
  .bar { grid-template-columns: 1fr auto; }
  .bar .track { grid-column: 1 / -1; grid-row: 2; }
  /* rows of tables become blocks, a line for each cell */
  thead { display: none; }
  .long { min-width: 0; }
  table, caption, tbody, tr, th, td { display: block; }
  tr { padding: 6px 0; border-bottom: 1px solid var(--line); }
  th, td { border: 0; padding: 1px 0; }
  td, td.number, .number + td:not(.number) { display: flex; gap: 12px; padding-left: 0; }
  td.number { text-align: left; white-space: normal; }
  td::before { content: attr(data-label); flex: 0 0 7.5em; color: var(--soft); }
}
@media print {
  @page { size: A4; margin: 14mm; }
  body { font-size: 9.5pt; line-height: 1.35; }
  main, p { max-width: none; }
  main { padding: 0; }
  h2 { margin-top: 1.2em; }
  h2, h3, figcaption, caption, summary { break-after: avoid; }
  figure, tr, .verdict, .next { break-inside: avoid; }
  .side { grid-template-columns: 1fr 1fr; }
  thead { break-after: avoid; }
  th, td { padding-top: 3px; padding-bottom: 3px; }
  .long { min-width: 11em; }
  .maps { display: grid; grid-template-columns: 1fr 1fr; gap: 0 24px; }
  .maps > h3 { grid-row: 1; }
  .maps > .side { grid-row: 2; }
  .maps > figure { grid-column: 1 / -1; }
  details.screen { display: none; }
  svg, img, .bars, .swatch, .verdict {
    print-color-adjust: exact; -webkit-print-color-adjust: exact;
  }
}
"""
