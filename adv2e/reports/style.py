"""The looks of the page: light and dark, on screen and on paper.

The colours of the two models are those of Okabe and Ito (jfly.uni-koeln.de/color, 2008), which
colour-blind readers tell apart; in dark, the lighter ones of the same hues.
"""

STYLE = """
:root {
  color-scheme: light dark;
  --ink: #1a1a1a; --soft: #5a5a5a; --paper: #ffffff; --line: #d9d9d9; --panel: #f5f6f8;
  --before: #c25100; --after: #0072b2; --floor: #6b6b6b;
  --good: #00694e; --fair: #8a5a00; --poor: #a3231f;
}
@media screen and (prefers-color-scheme: dark) {
  :root {
    --ink: #e8e8e8; --soft: #a8a8a8; --paper: #16181b; --line: #3b3f45; --panel: #202327;
    --before: #f0a13c; --after: #62bdf2; --floor: #a5a5a5;
    --good: #4fc9a4; --fair: #e6b450; --poor: #ff8a80;
  }
}
* { box-sizing: border-box; }
body {
  margin: 0; background: var(--paper); color: var(--ink);
  font: 15px/1.5 system-ui, -apple-system, "Segoe UI", "Helvetica Neue", Arial, sans-serif;
}
main { max-width: 960px; margin: 0 auto; padding: 24px 20px 48px; }
h1 { font-size: 1.35rem; margin: 0; overflow-wrap: anywhere; }
h2 {
  font-size: 1.2rem; margin: 2.2em 0 0.5em; padding-bottom: 0.2em;
  border-bottom: 1px solid var(--line);
}
h3 { font-size: 1rem; margin: 1.4em 0 0.3em; }
p { margin: 0.5em 0; max-width: 46em; }
p, li { overflow-wrap: anywhere; }
td, th { overflow-wrap: break-word; }
code { font: 0.92em ui-monospace, "SF Mono", Menlo, Consolas, monospace; }
.note, .meaning { color: var(--soft); font-size: 0.87rem; }
.verdict {
  margin: 16px 0; padding: 12px 18px; background: var(--panel);
  border-left: 6px solid var(--mark); border-radius: 4px;
}
.consistent, .explained { --mark: var(--good); }
.partly_explained, .not_identifiable { --mark: var(--fair); }
.unexplained { --mark: var(--poor); }
.badge {
  color: var(--mark); border: 2px solid var(--mark); border-radius: 999px;
  padding: 1px 12px; font-weight: 700; white-space: nowrap;
}
.sentence { font-size: 1.4rem; line-height: 1.35; font-weight: 600; margin: 0.4em 0; }
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
.line { white-space: nowrap; }
.large { color: var(--before); white-space: nowrap; }
details > summary { cursor: pointer; padding: 6px 0; color: var(--after); }
figure { margin: 0; min-width: 0; overflow-x: auto; }
figcaption { font-size: 0.9rem; font-weight: 600; margin: 6px 0; }
figcaption.note { font-weight: 400; }
.side { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(400px, 100%), 1fr)); }
.side { gap: 18px 24px; align-items: start; margin: 10px 0; }
img.map { width: 100%; height: auto; image-rendering: pixelated; display: block; }
svg { display: block; width: 100%; max-width: 560px; height: auto; }
svg.wide { max-width: 100%; min-width: 560px; }
svg text { font-size: 11px; fill: var(--soft); }
svg .label { fill: var(--ink); }
svg text.number { font-size: 12px; fill: var(--ink); }
svg .name {
  font-size: 12.5px; font-weight: 600;
  paint-order: stroke; stroke: var(--paper); stroke-width: 5px; stroke-linejoin: round;
}
svg .grid { stroke: var(--line); stroke-width: 0.7; }
svg .one { stroke: var(--soft); stroke-width: 1; stroke-dasharray: 2 3; }
svg .axis { stroke: var(--soft); stroke-width: 1; }
.before { --role: var(--before); }
.after { --role: var(--after); }
.floor { --role: var(--floor); }
.measured { --role: var(--ink); }
svg .band { fill: var(--role); fill-opacity: 0.2; stroke: none; }
svg .curve { fill: none; stroke: var(--role); stroke-width: 1.6; stroke-linejoin: round; }
svg .curve.before { stroke-dasharray: 5 3; }
svg .curve.measured { stroke-width: 2.2; }
svg .dot { fill: var(--role); }
svg .whisker { stroke: var(--role); stroke-width: 1.6; }
@media print {
  body { font-size: 10.5pt; }
  main { max-width: none; padding: 0; }
  h2, h3, figcaption, caption { break-after: avoid; }
  figure, tr, .verdict { break-inside: avoid; }
  .side { grid-template-columns: 1fr 1fr; }
  svg, img { print-color-adjust: exact; -webkit-print-color-adjust: exact; }
}
"""
