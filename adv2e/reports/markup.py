"""HTML and SVG elements as escaped text, tables of them, and the words that pages use."""

from __future__ import annotations

import html
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from adv2e.config import Config, all_keys
from adv2e.effects import EFFECTS, Effect, label_of
from adv2e.parameters import Parameter

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
        "tr", *(tag("th", column.heading, scope="col", class_=_class(column)) for column in columns)
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


# ---- Wording of reports, where those of recordings and of tables differ.


@dataclass(frozen=True)
class Wording:
    """Words of one kind of report.

    Attributes
    ----------
    title : str
        Of the page, before the name of the input.
    command : str
        What made the report.
    subject : str
        What the input is; its key in ``report.json``.
    error : str
        What an error is relative to.
    floor : str
        What the floor of the errors is.
    intervals : str
        What the lines on the bars of the errors show.
    bands : str
        What the bands of a curve show.
    explained : str
        What share of what each effect that was tried explains.
    others : str
        What the keys of ``model.yaml`` are that are neither added nor nuisances.
    """

    title: str
    command: str
    subject: str
    error: str
    floor: str
    intervals: str
    bands: str
    explained: str
    others: str


OF_RECORDINGS = Wording(
    title="Diagnosis of",
    command="adv2e diagnose",
    subject="recording",
    error="as a share of the measured events: 0 is no difference, 1 as much as with no events",
    floor="two simulations of one model against each other; no model comes nearer",
    intervals="the middle 95 % of simulations",
    bands="the middle 95 % of simulations",
    explained="the share of the declared model's difference (the sum of squares of all numbers that"
    " were compared) that each alone takes away, on data that it was not fitted to",
    others="as declared",
)

OF_TABLES = Wording(
    title="Characterisation of",
    command="adv2e characterise",
    subject="table",
    error="of a natural logarithm: 0.1 is about 10 %",
    floor="the standard errors of the table's rows",
    intervals="the middle 95 %",
    bands="the middle 95 % of fits to tables drawn from the model",
    explained="the share of the declared model's error that each takes away, on light that it was"
    " not fitted to",
    others="as declared; what was not is off, or its default where a table cannot show it",
)


# ---- Names, units and meanings of keys and effects, as reports write them.


@dataclass(frozen=True)
class Own:
    """Declarations of user effects.

    Attributes
    ----------
    keys : mapping of str to Parameter
        Their keys, by path.
    summaries : mapping of str to str
        What each effect is, by name.
    files : mapping of str to str
        Where each effect is written, by name.
    """

    keys: Mapping[str, Parameter] = field(default_factory=dict)
    summaries: Mapping[str, str] = field(default_factory=dict)
    files: Mapping[str, str] = field(default_factory=dict)


NO_OWN = Own()


def known_keys(section: type[Config] = Config) -> Mapping[str, Parameter]:
    """Return the declaration of each key, by its path."""
    return {key.path: key.about for key in all_keys(section)}


BUILT_IN = known_keys()


def _about(path: str, own: Own) -> Parameter | None:
    return BUILT_IN.get(path, own.keys.get(path))


def unit_of(path: str, own: Own = NO_OWN) -> str:
    """Return the unit of the key `path`, empty where it has none or is not known."""
    about = _about(path, own)
    return about.unit if about is not None and about.unit != "-" else ""


def meaning_of(path: str, own: Own = NO_OWN) -> str:
    """Return the meaning of the key `path`, "" where it is not known."""
    about = _about(path, own)
    return about.meaning if about is not None else ""


def summary_of(name: str, paths: Sequence[str] = (), own: Own = NO_OWN) -> str:
    """Return in a line what the effect `name` is; if no module is called that, by its keys."""
    if name in own.summaries:
        return own.summaries[name]
    of_keys = list(map(effect_of, paths))
    found = [one for one in EFFECTS if one.name == name] or [
        one for one in EFFECTS if one in of_keys
    ]
    return found[0].summary() if found else ""


def effect_of(path: str) -> Effect | None:
    """Return the effect that the key `path` belongs to."""
    inside = f"{path}."
    return next(
        (one for one in EFFECTS if inside.startswith(tuple(f"{part}." for part in one.paths))), None
    )


# ---- Names of effects and their keys in sentences for people.


_UNIT = re.compile("_(us|ns|hz|rad|dn|px|ppm|per_s)$")


def heading_of(effect: str) -> str:
    """Return the label of an effect as a heading, with the effect's name where that differs."""
    label = label_of(effect)
    heading = f"{label[:1].upper()}{label[1:]}"
    return heading if label == effect.replace("_", " ") else f"{heading} ({effect})"


def part_of(path: str, *, alone: bool) -> str:
    """Return the name of a key beside its effect, "" if it is the only key, and clear."""
    label = BUILT_IN[path].label if path in BUILT_IN else ""
    if label or alone:
        return label
    return _UNIT.sub("", path.rpartition(".")[2]).replace("_", " ")
