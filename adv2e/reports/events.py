"""Section of the page on the events themselves: those of a short time as pictures, and totals."""

from __future__ import annotations

from collections.abc import Sequence

from adv2e.reports.charts import event_colours, image_of, top_of
from adv2e.reports.markup import Column, Markup, table, tag
from adv2e.reports.quantities import estimate_text, number_text
from adv2e.reports.result import Diagnosis, Snapshot, Total

_NAMES = ("measured", "as declared (before)", "with what was found (after)")


def events(diagnosis: Diagnosis) -> Markup:
    """Return measured events beside those of either model; of one where nothing was found."""
    names = _NAMES[: 2 + bool(diagnosis.effects)]
    parts = [_pictures(diagnosis.snapshot, names)] if diagnosis.snapshot is not None else []
    if diagnosis.totals:
        parts.append(_totals(diagnosis.totals, names))
    return tag("figure", *parts, class_="events") if parts else Markup()


def _pictures(seen: Snapshot, names: Sequence[str]) -> Markup:
    top, figures = top_of(seen), []
    for name, number in zip(names, (seen.measured, seen.before, seen.after), strict=False):
        off, on = (int(one.sum()) for one in number)
        told = f"{on + off:,} event{'s' * (on + off != 1)}"
        split = tag("span", f"{on:,} ON, {off:,} OFF", class_="meaning")
        caption = tag("figcaption", tag("span", name, class_="line"), told, split)
        picture = image_of(event_colours(number, top), f"{name}: {told}")
        figures.append(tag("figure", caption, picture))
    first, last = seen.start_s, seen.start_s + seen.length_s
    title = f"Events of {1e3 * seen.length_s:.4g} ms: {first:.3f} to {last:.3f} s after the start"
    most = f", in full colour from {top} events of a pixel on" * (top > 1)
    note = (
        f"White: no event; red: ON; blue: OFF; purple: both{most}; the same in all pictures. This"
        " is the busiest time; of either model, one simulation is shown."
    )
    return tag(
        "div",
        tag("figcaption", title),
        tag("div", *figures, class_="three"),
        tag("p", note, class_="note"),
    )


def _totals(given: Sequence[Total], names: Sequence[str]) -> Markup:
    columns = [Column("all events"), *(Column(name, number=True) for name in names)]
    rows = []
    for one in given:
        values = [number_text(one.measured), *map(estimate_text, (one.before, one.after))]
        rows.append([one.name, *values[: len(names)], one.unit])
    caption = "All events of the recording, and of simulations: mean (the middle 95 %)"
    return table(caption, [*columns, Column("unit")], rows)
