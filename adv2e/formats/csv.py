"""Events as CSV: a heading that names the columns, then a line for each event.

========= =====================================
written   meaning
========= =====================================
t         time [us]
x         column, from the left
y         row, from the top
p         polarity, 1 is ON and 0 is OFF
cause     with causes: see adv2e.causes
========= =====================================

pandas and faery take this with their defaults.  Read are the columns that
:mod:`adv2e.formats.columns` names, in any order and among others, between commas, semicolons
or tabs.  faery's heading names the size, too: ``t,x@640,y@480,on``.  A line ``%geometry:640,480``
is of Metavision, which writes ``x, y, p, t`` without a heading; both have times in microseconds.
Any other file of four columns without a heading is read if its columns tell what they are.

References
----------
.. [1] Y. Shafranovich, RFC 4180, "Common format and MIME type for comma-separated values", 2005.
.. [2] pandas, ``pandas.read_csv``; faery, ``faery.events_stream_from_file``.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.causes import has_causes
from adv2e.errors import DataError
from adv2e.events import Events
from adv2e.formats.columns import find_columns, geometry_in, stated_unit, told_order
from adv2e.formats.event_file import EventFile, Facts
from adv2e.formats.text import Form, events_of_lines
from adv2e.formats.writing import Request, Writer
from adv2e.label import guessed

_HEADING = b"t,x,y,p"
_CAUSE = "cause"
_MOST_HEADING = 1 << 16  # bytes that a heading lies within

_BETWEEN = re.compile(r"\s*[,;\t]\s*|\s+")
_BLANK = bytes.maketrans(b',;\t"', b"    ")
_TRUTH = ((b"True", b"1"), (b"False", b"0"), (b"true", b"1"), (b"false", b"0"))
"""Spellings of boolean polarities, as pandas and others write them, and their numbers."""

_BLOCK = 1 << 15  # events formatted at once


def open_csv(path: Path, facts: Facts) -> EventFile:
    """Open a CSV of events.

    Raises
    ------
    DataError
        There is no heading, and the columns do not tell what they are; or one is missing.  From
        `parts`: a line that cannot be read.
    """
    with path.open("rb") as file:
        begin = file.read(_MOST_HEADING)
    names, skipped, lines = _heading(path, begin)
    if not re.search(rb"[a-zA-Z]", begin[:skipped]):
        taken = ",".join(names)
        told = f"no line names the columns: they are taken as {taken}, as they tell"
        facts.tell(guessed(told, "columns", taken, "put a line that names them before the events"))
    comments = begin[:skipped].decode("utf-8", "replace")
    facts.state(geometry_in("".join(re.findall("^#.*\n", comments, re.M)))[1], "a comment")
    found = find_columns(names, str(path))
    size = re.search(rb"%geometry:(\d{1,5}),(\d{1,5})\s|x@(\d{1,5})\W+y@(\d{1,5})", begin[:skipped])
    if size is not None:
        width, height = (int(side) for side in size.groups() if side is not None)
        facts.state_by_names({"width": width, "height": height}, "its heading")
    # of what was written here, the description beside it tells: t is in us
    facts.stated_unit = "us" if facts.description and found[0] == "t" else None
    facts.time_unit = facts.time_unit or stated_unit(found[0])
    form = Form(
        f"the {len(names)} numbers that the heading names",
        len(names),
        tuple(names.index(name) for name in found),
        _cleaned,
    )
    total, head = path.stat().st_size, (skipped, lines)
    opened = events_of_lines(lambda: path.open("rb"), total, str(path), facts, head, form)
    return replace(opened, layout="csv")


def _heading(path: Path, begin: bytes) -> tuple[list[str], int, int]:
    """Return the names of the columns, and the bytes and lines before the first event."""
    at = 3 if begin.startswith(b"\xef\xbb\xbf") else 0
    lines = 0
    of_metavision = False
    while at < len(begin):
        end = begin.find(b"\n", at) + 1 or len(begin)
        text = begin[at:end].decode("utf-8", "replace").strip()
        names = [name.strip("\"'").lower() for name in _BETWEEN.split(text.lstrip("# "))]
        if len(names) >= 4 and not any(map(_is_number, names)):
            in_us = of_metavision or any("@" in name for name in names)
            names = [name.partition("@")[0] for name in names]
            return ["t_us" if in_us and n == "t" else n for n in names], end, lines + 1
        if of_metavision and (not text or _is_number(names[0])):
            return ["x", "y", "p", "t_us"], at, lines
        of_metavision |= text.startswith("%geometry:")
        if text and not text.startswith(("#", "%")):
            if order := told_order(_rows(begin[at:])):
                return [*order], at, lines
            break
        at, lines = end, lines + 1
    else:
        if of_metavision:
            return ["x", "y", "p", "t_us"], at, lines
    raise DataError(
        f"{path}: must begin with a line that names the columns, such as t,x,y,p (t in"
        " microseconds; t_s,x,y,p in seconds); files of Metavision need x,y,p,t_us"
    )


def _rows(begin: bytes) -> NDArray[np.float64]:
    lines = _cleaned(begin[: begin.rfind(b"\n") + 1]).splitlines()
    try:
        rows = np.array([line.split() for line in lines if line.strip()], np.float64)
    except ValueError:
        return np.empty((0, 4))
    return rows if rows.ndim == 2 and rows.shape[1] == 4 else np.empty((0, 4))


def causes_of(path: Path) -> Callable[[], NDArray[Any]] | None:
    """Return a function that reads the column of causes; None without one as written here."""
    with path.open("rb") as file:
        begin = file.read(_MOST_HEADING)
    names, skipped, lines = _heading(path, begin)
    # of others, such a column may be anything
    ours = begin[:skipped].rstrip().endswith(_HEADING + f",{_CAUSE}".encode())
    return partial(_read_causes, path, skipped, lines) if ours and len(names) == 5 else None


def _read_causes(path: Path, skipped: int, lines: int) -> NDArray[Any]:
    if path.stat().st_size <= skipped:  # of which NumPy warns
        return np.empty(0, np.int64)
    try:
        return np.loadtxt(path, np.int64, None, ",", None, lines, 4, ndmin=1)
    except ValueError as error:
        raise DataError(f"{path}: {_CAUSE}: {error}") from None


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _cleaned(block: bytes) -> bytes:
    """Return lines of numbers and blanks."""
    if b"e" in block:
        for word, number in _TRUTH:
            block = block.replace(word, number)
    return block.translate(_BLANK)


class CsvWriter(Writer):
    """Writes a CSV of events."""

    def __init__(self, request: Request, stack: ExitStack, path: Path) -> None:
        self._file = stack.enter_context(path.open("wb"))
        self._file.write(_HEADING + (f",{_CAUSE}\n".encode() if request.causes else b"\n"))

    def write_events(self, events: Events) -> None:
        """Append events."""
        for begin in range(0, events.size, _BLOCK):
            self._file.write(_lines(events[begin : begin + _BLOCK]))


def _lines(events: Events) -> bytes:
    numbers, triples = _tables()
    t = events["t"]
    left = np.abs(t)
    groups = [left % 1000]  # of three digits, the last first
    while (left := left // 1000).any():
        groups.append(left % 1000)
    comma = 1 + 3 * len(groups)
    table = np.zeros((events.size, comma + 17), np.uint8)  # zeros are left out
    table[:, 0] = np.where(t < 0, ord("-"), 0)
    begun = np.zeros(events.size, np.bool_)
    for k, group in enumerate(reversed(groups)):
        table[:, 1 + 3 * k : 4 + 3 * k] = triples[group + 1000 * begun]
        begun |= group > 0
    table[~begun, comma - 1] = ord("0")
    table[:, comma] = ord(",")
    table[:, comma + 1 : comma + 7] = numbers[events["x"]]
    table[:, comma + 7 : comma + 13] = numbers[events["y"]]
    table[:, comma + 13] = events["p"] + ord("0")
    if has_causes(events):
        table[:, comma + 14] = ord(",")
        table[:, comma + 15] = events["cause"] + ord("0")
    table[:, comma + 16] = ord("\n")
    return table[table > 0].tobytes()


@cache
def _tables() -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """Return all 16-bit numbers, each with a comma, and triples of digits, zeros behind them.

    Of the triples, first those that begin a number, then those within.
    """
    numbers = b"".join(b"%d," % n + bytes(5 - len(str(n))) for n in range(1 << 16))
    begin = b"".join(b"%d" % n + bytes(3 - len(str(n))) for n in range(1, 1000))
    within = b"".join(b"%03d" % n for n in range(1000))
    return (
        np.frombuffer(numbers, np.uint8).reshape(-1, 6),
        np.frombuffer(bytes(3) + begin + within, np.uint8).reshape(-1, 3),
    )
