"""The columns of a list of frames: which is the time, which the name of the image.

A list has a line for each frame.  Its columns are separated by commas, semicolons, tabs or blanks,
and what each of them means is settled once for the whole file:

- a heading (``timestamp,filename``; ``# id timestamp image_name``; ``#timestamp [ns],filename``)
  says it;
- else the only column that is no number is the name, and the only column of numbers the time;
- of several columns of numbers the time is the one that rises, where the others do not, or only
  count the frames (0, 1, 2, ...; or the number in the name).

What that leaves open is an error that shows the line.  Names may be quoted, and hold blanks where
they are the only column beside numbers; backslashes in them separate folders on every system.
Lines that begin with ``#`` or ``%`` are comments.
"""

from __future__ import annotations

import csv
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from decimal import Decimal
from itertools import pairwise

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
_SENTENCE = re.compile(
    r"\b(?:time ?stamps?|times?|units?)\b[^\d]*?(?:\bin|\bare|[:=\[(])\s*([a-zµμ]+)\b"
)
"""What a comment says of the unit: 'times in ms', 'unit: us'."""
_SUFFIX = re.compile(r"\.(png|jpe?g|bmp|tiff?|webp|p[gpnf]m|hdr|exr|npy)$", re.IGNORECASE)
_WORDS = re.compile(r"\"[^\"]*\"(?=\s|$)|'[^']*'(?=\s|$)|\S+")


@dataclass(frozen=True)
class Line:
    """A line's number, its fields, and the text that its fields were cut from."""

    number: int
    fields: list[str]
    text: str


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
        The unit of the times that heading or comments state.
    """

    lines: list[Line]
    time: int
    name: int | None
    unit: str | None

    def times(self) -> list[str]:
        """Return the field with the time, of each line."""
        return [line.fields[self.time] for line in self.lines]

    def described(self, unit: str) -> str:
        """Return what the columns were taken for, their times being in `unit`."""
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
    lines, comments = _table(*_lines(text, label), label)
    return _meaning(lines, comments, label)


def has_lines(text: str) -> bool:
    """Tell whether a list has any line that is no comment."""
    return any(line.strip() and not _is_comment(line.strip()) for line in _split(text))


def _split(text: str) -> list[str]:
    # not at the other marks at which Python splits, which names may hold
    return re.split(r"\r\n|\r|\n", text)


def _is_comment(line: str) -> bool:
    return line.startswith(("#", "%"))


def _lines(text: str, label: str) -> tuple[list[Line], list[str]]:
    """Return the lines, not cut into fields, and the comments before the first."""
    lines: list[Line] = []
    comments = []
    for number, line in enumerate(_split(text), start=1):
        content = line.strip()
        if content and not _is_comment(content):
            lines.append(Line(number, [], content))
        elif content and not lines:
            comments.append(content.lstrip("#% "))
    if not lines:
        raise DataError(f"{label}: no times in it; one time a line is expected")
    return lines, comments


def _is_number(field: str) -> bool:
    return NUMBER.fullmatch(field) is not None


# from lines to fields


def _table(lines: list[Line], comments: list[str], label: str) -> tuple[list[Line], list[str]]:
    """Cut all lines in the same way; a first line that is a heading goes to the comments."""
    for mark in (",", ";", "\t"):
        cut = [_cut(line, mark, label) for line in lines] if mark in lines[-1].text else []
        if _is_table(cut):
            break
    else:
        cut = [Line(line.number, _words(line.text), line.text) for line in lines]
        mark = " "
    if len(cut) > 1 and not any(map(_is_number, cut[0].fields)) and "time" in _roles(cut[0].fields):
        comments = [*comments, cut[0].text]
        cut = cut[1:]
    if mark == " ":
        return _aligned(cut, label), comments
    width = len(cut[-1].fields)
    if all(re.fullmatch(r"\d+,\d+", line.text) for line in lines):
        raise DataError(
            f"{label} line {lines[0].number}: {lines[0].text[:40]!r}: two columns, or a decimal"
            " comma? write decimal points, or put a line such as '# id timestamp' above"
        )
    for line in cut:
        if len(line.fields) != width:
            raise _unlike(line, cut[-1], label)
    return cut, comments


def _cut(line: Line, mark: str, label: str) -> Line:
    try:
        (fields,) = csv.reader([line.text], delimiter=mark, skipinitialspace=True)
    except csv.Error as error:
        raise DataError(f"{label} line {line.number}: {error}") from error
    fields = [field.strip() for field in fields]
    while len(fields) > 1 and not fields[-1]:  # a mark at the end of the line
        fields.pop()
    return Line(line.number, fields, line.text)


def _is_table(lines: list[Line]) -> bool:
    """Tell whether lines were cut where columns end: most have as many fields, and numbers."""
    if not lines:
        return False
    width = len(lines[-1].fields)
    alike = [line for line in lines if len(line.fields) == width]
    if width < 2 or len(alike) <= len(lines) // 2:
        return False
    return any(_are_numbers([line.fields[at] for line in alike]) for at in range(width))


def _are_numbers(column: list[str]) -> bool:
    """Tell whether a column is one of numbers; one or the other line may be wrong."""
    return sum(map(_is_number, column)) > len(column) // 2


def _words(text: str) -> list[str]:
    """Return the words of a line, quoted ones whole; a comment behind them is left out."""
    words: list[str] = []
    for match in _WORDS.finditer(text):
        word = match.group()
        if word.startswith("#") and all(map(_is_number, words)):
            break
        bare = word.strip("\"'")
        words.append(bare if _is_number(bare) else word)
    return words


def _aligned(lines: list[Line], label: str) -> list[Line]:
    """Join the words between numbers to one name, in the same way on every line.

    Raises DataError for the first line that is unlike most.
    """
    shapes = [_shape(line.fields) for line in lines]
    usual = Counter(shapes).most_common(1)[0][0]
    like = lines[shapes.index(usual)]
    for line, shape in zip(lines, shapes, strict=True):
        if shape != usual:
            raise _unlike(line, like, label)
    before, named, behind = usual
    if not named:
        return lines
    for line in lines:
        inner = line.fields[before : len(line.fields) - behind]
        if any(_SUFFIX.search(word) for word in inner[:-1]) or any(map(_is_time, inner)):
            raise DataError(
                f"{label} line {line.number}: {line.text[:80]!r}: is all of that one name? quote"
                " names that hold blanks, or separate the columns by commas"
            )
    return [_joined(line, before, behind) for line in lines]


def _is_time(word: str) -> bool:
    """Tell whether a word is a number as names hold none, but lists."""
    return _is_number(word) and ("." in word or len(word) > 9)


def _shape(words: Sequence[str]) -> tuple[int, bool, int]:
    """Return (numbers at the beginning, whether anything else follows, numbers at the end)."""
    numbers = [_is_number(word) for word in words]
    if all(numbers):
        return len(words), False, 0
    return numbers.index(False), True, numbers[::-1].index(False)


def _joined(line: Line, before: int, behind: int) -> Line:
    # as it is written: blanks within a name may be several
    places = [match.span() for match in _WORDS.finditer(line.text)][: len(line.fields)]
    inner = places[before : len(places) - behind]
    name = line.text[inner[0][0] : inner[-1][1]]
    if len(inner) == 1 and name[0] == name[-1] and name[0] in "\"'" and len(name) > 1:
        name = name[1:-1]
    end = len(line.fields) - behind
    return Line(line.number, [*line.fields[:before], name, *line.fields[end:]], line.text)


def _unlike(line: Line, like: Line, label: str) -> DataError:
    shown = f"{label} line {line.number}: {line.text[:60]!r}"
    named, is_named = (not all(map(_is_number, one.fields)) for one in (like, line))
    if named != is_named and _is_number(line.fields[0]) == _is_number(like.fields[0]):
        does = "does" if named else "does not"
        return DataError(
            f"{shown}: all lines or none must name an image; line {like.number} {does}"
        )
    return DataError(f"{shown}: expected one like line {like.number}, {like.text[:60]!r}")


# what columns mean


def _meaning(lines: list[Line], comments: list[str], label: str) -> Table:
    """Settle which columns are time and name."""
    width = len(lines[0].fields)
    columns = [[line.fields[at] for line in lines] for at in range(width)]
    numbers = [at for at, column in enumerate(columns) if _are_numbers(column)]
    others = [at for at in range(width) if at not in numbers]
    headings = next(filter(None, (_heading(text, width) for text in reversed(comments))), None)
    roles = _roles(headings or [""] * width)
    time = _only([at for at in range(width) if roles[at] == "time"])
    if time is None:
        time = _time_among(columns, numbers, others, roles)
    if time is None:
        raise _open(lines, numbers, "time", label)
    for line in lines:
        if not _is_number(line.fields[time]):
            raise DataError(
                f"{label} line {line.number}: {line.fields[time][:40]!r} is not a number; a time is"
                " expected there"
            )
    named = [at for at in others if roles[at] == "name"] or others
    if len(named) > 1:
        named = [at for at in others if _look_like_files(columns[at])] or named
    if len(named) > 1:
        raise _open(lines, named, "name of the image", label)
    unit = _unit_of_heading(headings[time]) if headings else None
    return Table(lines, time, named[0] if named else None, unit or _unit_in(comments))


def _only(places: list[int]) -> int | None:
    return places[0] if len(places) == 1 else None


def _time_among(
    columns: list[list[str]], numbers: list[int], others: list[int], roles: list[str]
) -> int | None:
    """Return the column of times, where no heading names it."""
    open_to = [at for at in numbers if not roles[at]]
    if len(open_to) < 2:
        return _only(open_to)
    open_to = [at for at in open_to if all(map(_is_number, columns[at]))]
    rising = [at for at in open_to if _rises(columns[at], named=bool(others))]
    if len(rising) > 1:
        names = columns[others[0]] if len(others) == 1 else None
        rising = [at for at in rising if not _counts(columns[at], names)]
    return _only(rising)


def _rises(column: list[str], *, named: bool) -> bool:
    values = [Decimal(field) for field in column]
    if named:  # in any order
        return len(set(values)) == len(values)
    return all(before < after for before, after in pairwise(values))


def _counts(column: list[str], names: list[str] | None) -> bool:
    """Tell whether a column counts the frames: by one, or as the numbers in their names do."""
    if not all(re.fullmatch(r"\+?\d{1,9}", field) for field in column):
        return False
    values = [int(field) for field in column]
    if all(after - before == 1 for before, after in pairwise(values)):
        return True
    if names is None:
        return False
    ends = [re.findall(r"\d+", name) for name in names]
    return all(end and int(end[-1][-18:]) == n for end, n in zip(ends, values, strict=True))


def _look_like_files(column: list[str]) -> bool:
    return all(map(_SUFFIX.search, column))


def _heading(text: str, width: int) -> list[str] | None:
    """Return what a line above the list calls its columns, if it has a word for each."""
    bound = re.sub(r"\s+(?=[(\[])", "", text)  # a unit in brackets belongs to the word before
    for pattern in (r"\s*[,;\t]\s*", r"[\s,;]+"):
        words = [word.strip("\"' ").lower() for word in re.split(pattern, bound.strip())]
        roles = _roles(words)
        if len(words) == width and ("time" in roles or {*roles} <= {"count", "name"}):
            return words
    return None


def _roles(words: Sequence[str]) -> list[str]:
    return [_role(word.strip("\"'# ").lower()) for word in words]


def _role(word: str) -> str:
    """Return what a heading calls a column: 'time', 'name', 'count', 'other', or '' (nothing)."""
    if not word:
        return ""
    if _TIME.fullmatch(word):
        return "time"
    if _NAME.fullmatch(word):
        return "name"
    return "count" if _COUNT.fullmatch(word) else "other"


def _unit_of_heading(word: str) -> str | None:
    return next((_UNITS[part] for part in re.split(r"[^\wµμ]|_", word) if part in _UNITS), None)


def _unit_in(comments: list[str]) -> str | None:
    """Return the unit that a comment states, where none states another."""
    about = (_SENTENCE.search(text.lower()) for text in comments if "exposure" not in text.lower())
    named = {_UNITS[match[1]] for match in about if match and match[1] in _UNITS}
    return named.pop() if len(named) == 1 else None


def _open(lines: list[Line], columns: list[int], what: str, label: str) -> DataError:
    line = lines[0]
    shown = " or ".join(line.fields[at][:40] for at in columns[:4])
    which = f"which is the {what}, {shown}?" if len(columns) > 1 else f"no {what} in it;"
    return DataError(
        f"{label} line {line.number}: {line.text[:80]!r}: {which} put a line such as"
        " '# id timestamp filename' above, with a word for each column"
    )
