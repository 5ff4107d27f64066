"""Tables of the page: a caption, headings, rows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from adv2e.reports.markup import Markup, join, tag

SHOWN = 12
"""Rows of a long table that are not folded away."""


@dataclass(frozen=True)
class Column:
    """One column: its heading, and whether it holds numbers, which stand at the right."""

    heading: str
    number: bool = False


def table(
    caption: str, columns: Sequence[Column], rows: Sequence[Sequence[object]], folded_from: int = 0
) -> Markup:
    """Return a table whose first column names the rows.

    Parameters
    ----------
    caption : str
    columns : sequence of Column
    rows : sequence of sequences
        Texts or markup, one for each column.
    folded_from : int
        Rows from there on are folded away, unless they are few; 0: none are.
    """
    shown = len(rows)
    if folded_from and len(rows) > folded_from + 3:
        shown = folded_from
    parts = [_one(caption, columns, rows[:shown])]
    if shown < len(rows):
        more = f"{len(rows) - shown} more"
        rest = _one(f"{caption} (continued)", columns, rows[shown:])
        parts.append(tag("details", tag("summary", more), rest))
    return join(*parts)


def _one(caption: str, columns: Sequence[Column], rows: Sequence[Sequence[object]]) -> Markup:
    head = tag(
        "tr",
        *(tag("th", column.heading, scope="col", class_=_class(column)) for column in columns),
    )
    body = [_row(columns, row) for row in rows]
    content = tag("table", tag("caption", caption), tag("thead", head), tag("tbody", *body))
    return tag("div", content, class_="scroll")


def _row(columns: Sequence[Column], row: Sequence[object]) -> Markup:
    cells = [
        tag(
            "td" if number else "th",
            cell,
            scope=None if number else "row",
            class_=_class(column),
            data_label=column.heading if number else None,
        )
        for number, (column, cell) in enumerate(zip(columns, row, strict=True))
    ]
    return tag("tr", *cells)


def _class(column: Column) -> str | None:
    return "number" if column.number else None
