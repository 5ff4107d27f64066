"""The columns of a list of frames: which is the time, which the name of the image.

A list has a line for each frame.  Its columns are separated by commas, semicolons, tabs or blanks,
and what each of them means is settled once for the whole file:

- a heading (``timestamp,filename``; ``# id timestamp image_name``; ``#timestamp [ns],filename``)
  says it;
- else the only column that is no number is the name, and the only column of numbers the time.

What that leaves open is an error that shows the line.  Names that hold separators are quoted;
backslashes in them separate folders on every system.  Lines that begin with ``#`` or ``%`` are
comments.
"""

from __future__ import annotations

import csv
import re
from collections import Counter
from dataclasses import dataclass

from adv2e.errors import DataError
from adv2e.sources.times.instants import NUMBER

_TIME = re.compile(
    r"(time|times|timestamp|timestamps|time ?stamp|stamp|ts|t|timecode|sec|secs|seconds)"
    r"([\s_(\[-].*)?|s|ms|us|ns|[mun]secs?|(?:milli|micro|nano)seconds"
)
_NAME = re.compile(
    r"(image|img|frame|rgb|color|colour)?[\s_-]?(file|name|filename|image|img|path|filepath)"
    r"([\s_-]?(name|path|file))?"
)
_COUNT = re.compile(
    r"(frame|image|img)?[\s_-]?(id|idx|index|no|nr|num|number|count|seq)\.?|#|frame"
)
_UNITS = {
    **dict.fromkeys(("s", "sec", "secs", "second", "seconds"), "s"),
    **dict.fromkeys(("ms", "msec", "millis", "millisecond", "milliseconds"), "ms"),
    **dict.fromkeys(("us", "usec", "µs", "μs", "micros", "microsecond", "microseconds"), "us"),
    **dict.fromkeys(("ns", "nsec", "nanos", "nanosecond", "nanoseconds"), "ns"),
}
_WORDS = re.compile(r"\"[^\"]*\"(?=\s|$)|'[^']*'(?=\s|$)|\S+")


@dataclass(frozen=True)
class Line:
    """A line's number, its text, and the fields that it was cut into."""

    number: int
    text: str
    fields: list[str]


@dataclass(frozen=True)
class Table:
    """A list cut into fields, and what its columns are.

    Attributes
    ----------
    lines : list of Line
        All lines but comments and heading.
    time, name : int
        Columns of the times and, if there is one, of the names.
    unit : str or None
        The unit of the times that the heading states.
    """

    lines: list[Line]
    time: int
    name: int | None
    unit: str | None

    def described(self, unit: str) -> str:
        """Return the roles of the columns in words, their times being in `unit`."""
        words = ["unused"] * len(self.lines[0].fields)
        words[self.time] = f"time [{unit}]"
        if self.name is not None:
            words[self.name] = "name"
        return ", ".join(words)


def table_of(text: str, label: str) -> Table:
    """Cut a list into fields, and settle what its columns are.

    Raises
    ------
    DataError
        No lines, a line unlike the others, or columns whose meaning is open; the text names file
        and line.
    """
    rows, comments = _rows(text)
    if not rows:
        raise DataError(f"{label}: no times in it; one time a line is expected")
    lines = _cut_alike(rows)
    first = lines[0]
    if len(lines) > 1 and not any(map(_is_number, first.fields)) and _has_time(first.fields):
        comments.append(first.text)
        lines = lines[1:]
    _check_widths(lines, label)
    columns = list(zip(*(line.fields for line in lines), strict=True))
    numbers = [at for at, column in enumerate(columns) if _are_numbers(column)]
    others = [at for at in range(len(columns)) if at not in numbers]
    headings = next(filter(None, (_heading(c, len(columns)) for c in reversed(comments))), None)
    roles = [_role(word) for word in headings or [""] * len(columns)]
    times = [at for at, role in enumerate(roles) if role == "time"]
    if not times:
        times = [at for at in numbers if not roles[at]]
    if len(times) != 1:
        raise _open(lines[0], times, "time", label)
    (time,) = times
    for line in lines:
        if not _is_number(line.fields[time]):
            raise DataError(
                f"{label} line {line.number}: {line.fields[time][:40]!r} is not a number; a time is"
                " expected there"
            )
    named = [at for at in others if roles[at] == "name"] or others
    if len(named) > 1:
        raise _open(lines[0], named, "name of the image", label)
    unit = _unit_of_heading(headings[time]) if headings else None
    return Table(lines, time, named[0] if named else None, unit)


def has_lines(text: str) -> bool:
    """Tell whether a list has any line that is no comment."""
    return bool(_rows(text)[0])


def _rows(text: str) -> tuple[list[tuple[int, str]], list[str]]:
    """Return numbers and texts of the lines, and the comments before the first."""
    rows: list[tuple[int, str]] = []
    comments = []
    # not at the other marks at which Python splits, which names may hold
    for number, line in enumerate(re.split(r"\r\n|\r|\n", text), start=1):
        content = line.strip()
        if content and not content.startswith(("#", "%")):
            rows.append((number, content))
        elif content and not rows:
            comments.append(content.lstrip("#% "))
    return rows, comments


def _is_number(field: str) -> bool:
    return NUMBER.fullmatch(field) is not None


def _cut_alike(rows: list[tuple[int, str]]) -> list[Line]:
    """Cut all lines in the same way: at the mark that makes columns, or else at blanks."""
    for mark in (",", ";", "\t"):
        if mark in rows[-1][1]:
            lines = [Line(number, text, _cut(text, mark)) for number, text in rows]
            if _is_table(lines):
                return lines
    return [Line(number, text, _words(text)) for number, text in rows]


def _cut(text: str, mark: str) -> list[str]:
    try:
        (fields,) = csv.reader([text], delimiter=mark, skipinitialspace=True)
    except csv.Error:  # a field beyond its limit
        return []
    fields = [field.strip() for field in fields]
    while len(fields) > 1 and not fields[-1]:  # a mark at the end of the line
        fields.pop()
    return fields


def _is_table(lines: list[Line]) -> bool:
    """Tell whether lines were cut where columns end: most have as many fields, and numbers."""
    width = len(lines[-1].fields)
    alike = [line.fields for line in lines if len(line.fields) == width]
    if width < 2 or len(alike) <= len(lines) // 2:
        return False
    return any(map(_are_numbers, zip(*alike, strict=True)))


def _are_numbers(column: tuple[str, ...]) -> bool:
    """Tell whether a column is one of numbers; one or the other line may be wrong."""
    return 2 * sum(map(_is_number, column)) >= len(column)


def _words(text: str) -> list[str]:
    """Return the words of a line, quoted ones whole; a comment behind numbers is left out."""
    words: list[str] = []
    for match in _WORDS.finditer(text):
        word = match.group()
        if word.startswith("#") and all(map(_is_number, words)):
            break
        quoted = len(word) > 1 and word[0] == word[-1] and word[0] in "\"'"
        words.append(word[1:-1] if quoted else word)
    return words


def _check_widths(lines: list[Line], label: str) -> None:
    """Raise DataError for the first line that has other fields than most."""
    usual = Counter(len(line.fields) for line in lines).most_common(1)[0][0]
    for line in lines:
        if len(line.fields) != usual:
            like = next(other for other in lines if len(other.fields) == usual)
            raise DataError(
                f"{label} line {line.number}: {line.text[:60]!r}: expected one like line"
                f" {like.number}, {like.text[:60]!r}; quote names that hold blanks"
            )


def _heading(text: str, width: int) -> list[str] | None:
    """Return the names of the columns in a line above the list, if it has one for each."""
    bound = re.sub(r"\s+(?=[(\[])", "", text)  # a unit in brackets belongs to the word before
    for pattern in (r"\s*[,;\t]\s*", r"[\s,;]+"):
        words = re.split(pattern, bound.strip())
        if len(words) == width and (_has_time(words) or {*map(_role, words)} <= {"count", "name"}):
            return words
    return None


def _has_time(words: list[str]) -> bool:
    return "time" in map(_role, words)


def _role(word: str) -> str:
    """Return the role of a column by its heading: 'time', 'name', 'count', 'other' or ''."""
    word = word.strip("\"'# ").lower()
    for role, form in (("time", _TIME), ("name", _NAME), ("count", _COUNT)):
        if form.fullmatch(word):
            return role
    return "other" if word else ""


def _unit_of_heading(word: str) -> str | None:
    parts = re.split(r"[^\wµμ]|_", word.lower())
    return next((_UNITS[part] for part in parts if part in _UNITS), None)


def _open(line: Line, columns: list[int], what: str, label: str) -> DataError:
    shown = " or ".join(line.fields[at][:40] for at in columns[:4])
    which = f"which is the {what}, {shown}?" if len(columns) > 1 else f"no {what} in it;"
    return DataError(
        f"{label} line {line.number}: {line.text[:80]!r}: {which} put a line such as"
        " '# id timestamp filename' above, with a word for each column; quote names with blanks"
    )
