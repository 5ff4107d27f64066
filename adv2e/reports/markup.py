"""HTML and SVG elements as text that is escaped by construction, and tables of them."""

from __future__ import annotations

import html
import re
from collections.abc import Sequence
from dataclasses import dataclass

_NOT_IN_A_TEXT = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\ud800-\udfff\ufffe\uffff]")

_EMPTY = frozenset({"br", "img", "meta"})
"""Elements of HTML that have no end tag."""


class Markup(str):
    """Text that is markup already; any other text is escaped when it is put into an element."""

    __slots__ = ()


def plain(text: object) -> str:
    """Return `text` without what no text file should hold: control characters, half characters.

    File names may hold either; each becomes the replacement character.
    """
    return _NOT_IN_A_TEXT.sub("\ufffd", str(text))


def markup(content: object) -> Markup:
    """Return `content` as markup: escaped, unless it is :class:`Markup`."""
    if isinstance(content, Markup):
        return content
    return Markup(html.escape(plain(content)))


def tag(name: str, /, *content: object, **attributes: object) -> Markup:
    """Return the element `name`.

    Parameters
    ----------
    name : str
    *content : object
        Texts and elements, one after the other.
    **attributes : object
        ``class_`` is *class* and ``aria_label`` is *aria-label*; None leaves the attribute out.
    """
    given = "".join(
        f' {key.rstrip("_").replace("_", "-")}="{html.escape(plain(value))}"'
        for key, value in attributes.items()
        if value is not None
    )
    if name in _EMPTY:
        return Markup(f"<{name}{given}>")
    return Markup(f"<{name}{given}>{join(*content)}</{name}>")


def join(*content: object) -> Markup:
    """Return several texts and elements as one."""
    return Markup("".join(markup(part) for part in content))


# ---- Tables of the page: a caption, headings, rows.


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
