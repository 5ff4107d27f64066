"""What sensors do, as :func:`adv2e.sensor` measures it: a page with charts, and text."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from adv2e.config.tree import flat
from adv2e.reports import charts
from adv2e.reports.charts import LEFT, LINE_HEIGHT, RIGHT, WIDTH, wrapped
from adv2e.reports.markup import BUILT_IN, Column, Markup, effect_of, join, table, tag, unit_of
from adv2e.reports.page import document
from adv2e.reports.quantities import interval_text, number_text, value_text
from adv2e.reports.result import Band

Found = Mapping[str, Any]

_HUES = 5


def sensor_page(found: Found) -> str:
    """Return the page of a dictionary of :func:`adv2e.sensor`, as HTML that needs no other file."""
    sensors = found["sensors"]
    names = [one["name"] for one in sensors]
    plots: dict[str, list[Found | None]] = {}
    for k, one in enumerate(sensors):
        for plot in one["plots"]:
            plots.setdefault(plot["key"], [None] * len(sensors))[k] = plot
    figures = (_figure(some, names) for some in plots.values())
    return document(
        f"Sensor {', '.join(names)}",
        tag("p", "Measured on simulated pixels by adv2e ", found["adv2e"], ".", class_="note"),
        _conditions(sensors),
        tag("section", tag("h2", "Numbers"), _numbers(sensors)),
        tag("section", tag("h2", "Curves"), tag("div", *figures, class_="side")),
        *(tag("section", tag("h2", f"Keys of {one['name']}"), _keys(one)) for one in sensors),
    )


def sensor_text(found: Found) -> str:
    """Return the numbers of a dictionary of :func:`adv2e.sensor` as lines for the terminal."""
    lines = []
    for one in found["sensors"]:
        lines.append(one["name"])
        lines += [
            f"  {number['name']:<40} {number_of(number):<40} {number['at']}"
            for number in one["numbers"]
        ]
        lines += [f"  note: {text}" for text in one["conditions"]]
    return "\n".join(lines)


def number_of(number: Found) -> str:
    """Return a measured number with its unit and interval; a threshold also in percent."""
    value, ends, unit = number["value"], (number["low"], number["high"]), number["unit"]
    if value is None:
        return f"above {number_text(ends[0])} {unit}" if ends[0] else "not reached"
    if value == 0.0 and ends[1]:
        return f"below {number_text(ends[1])} {unit}"
    text = f"{number_text(value)} {unit}"
    if None not in ends and ends[0] < ends[1]:
        text += f" ({interval_text(ends)})"
    return f"{text}, {100 * math.expm1(value):.3g} %" if unit == "ln" else text


def _conditions(sensors: Sequence[Found]) -> Markup:
    """Return the conditions once where they are the same, else by sensor."""
    told: dict[str, list[str]] = {}
    for one in sensors:
        told.setdefault(" ".join(one["conditions"]), []).append(one["name"])
    named = len(told) > 1
    lines = [f"{', '.join(of)}: {text}" if named else text for text, of in told.items()]
    return join(*(tag("p", line, class_="note") for line in lines))


def _numbers(sensors: Sequence[Found]) -> Markup:
    cells: dict[str, list[list[Markup]]] = {}
    for k, one in enumerate(sensors):
        for number in one["numbers"]:
            row = cells.setdefault(number["name"], [[] for _ in sensors])
            at = tag("span", f" at {number['at']}", class_="note")
            row[k].append(tag("span", number_of(number), at, class_="value"))
    columns = [Column("quantity"), *(Column(one["name"]) for one in sensors)]
    rows = [[name, *(tag("div", *each or "-") for each in row)] for name, row in cells.items()]
    return table("with 95 % intervals", columns, rows)


def _keys(sensor: Found) -> Markup:
    """Return a table of the configuration's keys of pixel and readout beside what was measured."""
    rows = []
    for path, value in flat(sensor["config"]):
        if value is None or not path.startswith(("pixel.", "readout.", "user.")):
            continue
        effect = effect_of(path)
        of = (one for one in sensor["numbers"] if path in one["keys"])
        texts = (f"{one['name']}, at {one['at']}: {number_of(one)}" for one in of)
        measured = [tag("span", text, class_="meaning") for text in texts]
        meaning = tag("span", BUILT_IN[path].meaning if path in BUILT_IN else "", class_="meaning")
        command = tag("code", f"adv2e effects {effect.name}") if effect else ""
        declared = f"{value_text(value)} {unit_of(path)}".rstrip()
        cell = tag("div", *measured or "-", class_="long")
        rows.append([join(path, meaning), declared, cell, command])
    heads = Column("key"), Column("declared", number=True), Column("measured"), Column("more")
    return table("of the pixel and the readout; effects that are off are left out", heads, rows)


def _figure(plots: Sequence[Found | None], names: Sequence[str]) -> Markup:
    """Return one plot of all sensors: a colour each, or of a single one one for each series."""
    several = len(plots) > 1
    kinds = list(dict.fromkeys(one["name"] for plot in plots if plot for one in plot["series"]))
    drawn: list[tuple[Found, str]] = []
    for k, plot in enumerate(plots):
        for series in plot["series"] if plot else ():
            n = kinds.index(series["name"])
            hue = f"hue{k % _HUES} dash{n % _HUES}" if several else f"hue{n % _HUES}"
            drawn.append((series, hue))
    first = next(plot for plot in plots if plot)
    entries = [(f"hue{k % _HUES}", name) for k, name in enumerate(names if several else kinds)]
    if several and len(kinds) > 1:
        entries += [(f"measured dash{n % _HUES}", name) for n, name in enumerate(kinds)]
    items = [
        tag("li", tag("svg", charts.rule(0, 4, 26, 4, f"curve {hue}"), viewBox="0 0 26 8"), label)
        for hue, label in entries
    ]
    return tag(
        "figure",
        tag("figcaption", first["title"]),
        tag("ul", *items, class_="legend"),
        _chart(first, drawn),
        tag("figcaption", first["definition"], class_="note"),
    )


def _chart(plot: Found, drawn: Sequence[tuple[Found, str]]) -> Markup:
    x_label, y_label = wrapped(plot["x_label"], WIDTH - LEFT), wrapped(plot["y_label"], WIDTH)
    top = 14 + len(y_label) * LINE_HEIGHT
    bottom = top + charts.PLOT_HEIGHT
    keys = ("x", "y", "low", "high")
    rows = [{key: charts.drawable(one[key] or []) for key in keys} for one, _ in drawn]
    marked = charts.drawable([plot["mark"][0]] if plot["mark"] else [])
    ups = [row[key] for row in rows for key in ("y", "low", "high")]
    xs, log = [row["x"] for row in rows], "x" in plot["log"]
    across = charts.axis_over(xs, LEFT, WIDTH - RIGHT, log=log, tight=True)
    up = charts.axis_over([*ups, marked], bottom, top, log="y" in plot["log"])
    if across is None or up is None:
        return tag("p", "There is nothing to draw: no value is known.", class_="note")
    content = [tag("title", plot["title"]), charts.draw_axes(across, up, x_label, y_label)]
    if plot["mark"]:
        y = up.at(plot["mark"][0])
        content.append(charts.rule(LEFT, y, WIDTH - RIGHT, y, "mark"))
        content.append(charts.place_text(WIDTH - RIGHT, y - 4, plot["mark"][1], text_anchor="end"))
    for row, (_, hue) in zip(rows, drawn, strict=True):
        frame = charts.Frame(across, up, across.place(row["x"]))
        if row["low"].size:
            band = Band(row["y"], row["low"], row["high"])
            content.append(tag("path", d=frame.band(band), class_=f"band {hue}"))
        content.append(tag("path", d=frame.line(row["y"]), class_=f"curve {hue}"))
        ys = up.place(row["y"])
        content += [charts.dot(x, y, 2, hue) for x, y in zip(frame.x, ys, strict=True)]
    height = bottom + 26 + len(x_label) * LINE_HEIGHT
    return tag("svg", *content, viewBox=f"0 0 {WIDTH} {height}", role="img")
