"""Lists of frames in text files: the time of each, and which image is meant.

The columns are told apart first; the unit of the times is settled in
:mod:`adv2e.sources.times.rates`.
"""

from __future__ import annotations

import codecs
import csv
import re
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from decimal import Decimal
from itertools import pairwise
from pathlib import Path
from typing import Any
from unicodedata import normalize

from adv2e.errors import DataError
from adv2e.files.regular import read_text_bytes, reading
from adv2e.label import told_of
from adv2e.sources.times.rates import NUMBER, Stamp, Unit, frame_unit, parse_ns, seconds

# ---- Pictures by the names in a list.
#
# Lists are written elsewhere, on another system even, and folders are moved.  A name is therefore
# matched whole, and where that fails by its end: ``C:/clip/left/0001.png`` is ``left/0001.png`` or
# ``0001.png`` of this folder.  Never do two lines take one picture.


def member_of(name: str, has: Callable[[str], bool]) -> str | None:
    """Return the file of a folder or zip that a name means, whole or by its end; None: none.

    `name` is a path as a list has it, from any system; `has` tells whether there is such a file,
    from its path below the folder.
    """
    parts: list[str] = []
    for part in re.sub(r"^[A-Za-z]:", "", name.replace("\\", "/")).split("/"):
        if part == "..":
            del parts[-1:]
        elif part not in ("", "."):
            parts.append(part)
    ends = ["/".join(parts[begin:]) for begin in range(len(parts))]
    # systems differ in how they store letters with accents
    forms = (normalize(form, end) for form in ("NFC", "NFD") for end in ends)
    return next(filter(has, (*ends, *forms)), None)


def members_of(
    stamps: Sequence[Stamp], label: str, has: Callable[[str], bool], *, where: str = ""
) -> list[str]:
    """Return the file that each line of the list `label` means; never one outside its folder.

    `has` is as in :func:`member_of`; `where` follows "no image NAME" in messages.

    Raises
    ------
    DataError
        A line without a name, or whose image is missing, or is that of another line.
    """
    takers: dict[str, Stamp] = {}
    for stamp in stamps:
        if stamp.name is None:
            raise DataError(f"{label} line {stamp.line}: expected 'time name' of an image")
        member = member_of(stamp.name, has)
        if member is None:
            raise DataError(f"{label} line {stamp.line}: no image {stamp.name}{where}")
        other = takers.setdefault(member, stamp)
        if other is not stamp:
            first, second = sorted((other, stamp), key=lambda one: one.line)
            raise DataError(
                f"{label} line {second.line}: {second.name} is the same picture as {first.name} on"
                f" line {first.line}"
            )
    return list(takers)


def match(stamps: Sequence[Stamp], paths: Sequence[str], label: str, where: str) -> list[int]:
    """Return the number of the picture that each line means, of pictures at the paths given.

    The last parts of the paths are enough where no two are the same.  See :func:`members_of`.
    """
    lasts = [path.rpartition("/")[2] for path in paths]
    unlike = len(set(lasts)) == len(lasts)
    numbers = {path: n for n, path in enumerate(lasts if unlike else paths)}
    members = members_of(stamps, label, numbers.__contains__, where=where)
    return [numbers[member] for member in members]


# ---- The columns of a list of frames: which is the time, which the name of the image.
#
# A list has a line for each frame. Its columns are separated by commas, semicolons, tabs or
# blanks, and what each of them means is settled once for the whole file:
#
# - a heading (``timestamp,filename``; ``# id timestamp image_name``; ``#timestamp [ns],filename``)
#   says it;
# - of a heading with start and end, as of exposures, the middle is the time;
# - else the only column that is no number is the name, and the only column of numbers the time.
#
# What that leaves open is an error that shows the line. Names that hold separators are quoted;
# backslashes in them separate folders on every system. Lines that begin with ``#`` or ``%`` are
# comments.


_TIME = re.compile(
    r"(time|times|timestamp|timestamps|time ?stamp|stamp|ts|t|timecode|sec|secs|seconds)"
    r"([\s_(\[-].*)?|s|ms|us|ns|[mun]secs?|(?:milli|micro|nano)seconds"
)
_START = re.compile(r"(exposure[\s_-]?)?(start|begin)([\s_(\[-].*)?")
_STARTS = re.compile(r"(?i)(exposures?[\s_-]?)(?:start|begin)(?=[^a-z]|$)")
_END = re.compile(r"(exposure[\s_-]?)?(end|stop)([\s_(\[-].*)?")
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
    end : int, optional
        Column of the ends of exposures, which begin at the times.
    """

    lines: list[Line]
    time: int
    name: int | None
    unit: str | None
    end: int | None = None

    def described(self, unit: str) -> str:
        """Return the roles of the columns in words, their times being in `unit`."""
        words = ["unused"] * len(self.lines[0].fields)
        words[self.time] = f"time [{unit}]" if self.end is None else f"start of exposure [{unit}]"
        if self.end is not None:
            words[self.end] = "its end"
        if self.name is not None:
            words[self.name] = "name"
        return ", ".join(words)


def table_of(text: str, label: str, heading: str = "") -> Table:
    """Cut a list into fields, and settle what its columns are; `heading` as in :func:`parse_list`.

    Raises
    ------
    DataError
        No lines, a line unlike the others, or columns whose meaning is open; the text names file
        and line.
    """
    rows, comments = _rows(text)
    comments = [heading, *comments]
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
    end = None
    if not times and {"start", "end"} <= {*roles}:
        times, end = [roles.index("start")], roles.index("end")
    if not times:
        times = [at for at in numbers if not roles[at]]
    if len(times) != 1:
        raise _open(lines[0], times, "time", label)
    (time,) = times
    for line in lines:
        for at in (time,) if end is None else (time, end):
            if not _is_number(line.fields[at]):
                raise DataError(
                    f"{label} line {line.number}: {line.fields[at][:40]!r} is not a number; a time"
                    " is expected there"
                )
    named = [at for at in others if roles[at] == "name"] or others
    if len(named) > 1:
        raise _open(lines[0], named, "name of the image", label)
    unit = _unit_of_heading(headings[time]) if headings else None
    return Table(lines, time, named[0] if named else None, unit, end)


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
    roles = {*map(_role, words)}
    return "time" in roles or {"start", "end"} <= roles


def _role(word: str) -> str:
    """Return the role of a column: 'time', 'start', 'end', 'name', 'count', 'other' or ''."""
    word = word.strip("\"'# ").lower()
    forms = {"time": _TIME, "start": _START, "end": _END, "name": _NAME, "count": _COUNT}
    for role, form in forms.items():
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


@dataclass(frozen=True)
class FrameList:
    """A list of frames.

    Attributes
    ----------
    stamps : list of Stamp
        In the order of time.
    columns : str
        What its columns were taken for, and the unit of its times.
    unit : Unit
        That unit, and what is to be told of it.
    order : str
        What is to be told of the order that its lines had; may be empty.
    whole : bool
        All its times are written as whole numbers.
    """

    stamps: list[Stamp]
    columns: str
    unit: Unit
    order: str = ""
    whole: bool = False

    def told(self, label: str) -> tuple[list[str], list[str]]:
        """Return doubts about the list `label`, and notes on it."""
        notes = [f"times from {label}: {self.columns}"]
        if self.order:
            notes.append(f"{label}: {self.order}")
        return [told_of(label, self.unit.doubt)] if self.unit.doubt else [], notes


def first_name(text: str, label: str) -> str:
    """Return the name on the first line of a list; "" if lines have none."""
    table = table_of(text, label)
    return _name(table.lines[0], table) or ""


def read_list(path: Path, **evidence: Any) -> FrameList:
    """Read a list of frames from a file; parameters and errors as :func:`parse_list`.

    What lies beside our own ``adv2e.json`` is in seconds.  Starts of exposures whose ends lie
    beside them, ``Exposure_start.txt`` and ``Exposure_end.txt``, are read with these.
    """
    if path.name == "images.txt" and path.with_name("adv2e.json").is_file():
        evidence.setdefault("stated", "s")
    text, ends = _text(path), path.with_name(_STARTS.sub(r"\1end", path.name))
    if ends != path and ends.is_file():
        text, evidence["heading"] = _paired(text, path, ends)
    return parse_list(text, str(path), **evidence)


def _paired(text: str, path: Path, ends: Path) -> tuple[str, str]:
    """Return starts and ends of exposures as one list, on the lines of the starts, and a heading.

    Raises
    ------
    DataError
        Their numbers differ, or a line is no number.
    """
    (starts, said), (stops, _) = _rows(text), _rows(_text(ends))
    if len(starts) != len(stops):
        raise DataError(f"{ends}: {len(stops)} lines for the {len(starts)} of {path.name}")
    if not all(_is_number(line) for _, line in (*starts, *stops)):
        raise DataError(f"{path}, {ends.name}: expected one number a line, a start or an end")
    both = zip(starts, stops, strict=True)
    lines = {number: f"{line},{stop}" for (number, line), (_, stop) in both}
    unit = next(filter(None, map(_unit_of_heading, said)), "")
    last = max(lines, default=0)
    return "\n".join(lines.get(n, "#") for n in range(1, last + 1)), f"start_{unit},end"


def _text(path: Path) -> str:
    with reading(path):
        return decoded(read_text_bytes(path), str(path))


def decoded(data: bytes, label: str) -> str:
    """Return the text of a list; DataError unless it is text."""
    wide = data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
    try:
        # names are bytes: those that are not UTF-8 are what Python makes of such names of files
        text = data.decode("utf-16") if wide else data.decode("utf-8-sig", "surrogateescape")
    except UnicodeDecodeError as error:
        raise DataError(f"{label}: not a text file; one time a line is expected") from error
    if "\0" in text:
        raise DataError(f"{label}: not a text file; one time a line is expected")
    return text


def parse_list(
    text: str,
    label: str,
    *,
    time_unit: str | None = None,
    stated: str | None = None,
    own_step_s: float | None = None,
    heading: str = "",
) -> FrameList:
    """Read a list of frames.

    Lines with names may stand in any order and are sorted by time (a name tells which frame is
    meant); lines without must increase, since their order is that of the frames.

    Parameters
    ----------
    text, label : str
        The list, and the name of its file, for messages.
    time_unit : {'s', 'ms', 'us', 'ns'}, optional
        What the user says of the unit.
    stated, own_step_s
        What else tells of it; see :func:`adv2e.sources.times.rates.frame_unit`.
    heading : str
        Words for the columns, where the list has none of its own.

    Raises
    ------
    DataError
        Columns whose meaning is open, a line that is unlike the others or whose time cannot be
        read, a time that occurs twice, times that do not increase, or an empty list; the text names
        the line.
    """
    table = table_of(text, label, heading)
    fields = [line.fields[table.time] for line in table.lines]
    unit = frame_unit(
        [Decimal(field) for field in fields],
        given=time_unit,
        stated=table.unit or stated,
        own_step_s=own_step_s,
    )
    stamps = [_stamp(line, table, unit, label) for line in table.lines]
    order = ""
    if table.name is not None:
        order = _disorder(stamps)
        stamps = sorted(stamps, key=lambda stamp: stamp.t_ns)
    _check_order(stamps, label)
    whole = not any(re.search("[.eE]", field) for field in fields)
    return FrameList(stamps, table.described(unit.name), unit, order, whole)


def _stamp(line: Line, table: Table, unit: Unit, label: str) -> Stamp:
    ends = (table.time,) if table.end is None else (table.time, table.end)
    try:
        first, *last = (parse_ns(line.fields[at], unit.ns) for at in ends)
    except ValueError as error:
        raise DataError(
            f"{label} line {line.number}: {error}; a time in {unit.name} is expected there"
        ) from error
    exposure = last[0] - first if last else 0
    if exposure < 0:
        raise DataError(f"{label} line {line.number}: the exposure ends before it starts")
    return Stamp(first + exposure // 2, line.number, _name(line, table), exposure)


def _name(line: Line, table: Table) -> str | None:
    return None if table.name is None else line.fields[table.name].replace("\\", "/")


def _disorder(stamps: list[Stamp]) -> str:
    for before, stamp in pairwise(stamps):
        if stamp.t_ns < before.t_ns:
            return f"line {stamp.line} is earlier than one before it: sorted by time"
    return ""


def _check_order(stamps: list[Stamp], label: str) -> None:
    for before, stamp in pairwise(stamps):
        if stamp.t_ns <= before.t_ns:
            raise DataError(
                f"{label} line {stamp.line}: times must increase; {seconds(stamp.t_ns)} s is not"
                f" after the {seconds(before.t_ns)} s of line {before.line}"
            )
