"""Events as text: ``events.txt`` of DAVIS240C and its relatives.

A line is ``time x y polarity``, separated by blanks.  Lines that begin with ``#`` and empty lines
are skipped.  Times are seconds, plain or scientific, read digit by digit to the nearest
microsecond, so that 1.47e9 s loses nothing.  A first line of two numbers is the geometry
(``width height``, as rpg_e2vid writes it).  Other units than seconds, such as the microseconds of
DVS-Voltmeter, are told from the times: see :mod:`adv2e.formats.columns`.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from adv2e.errors import DataError
from adv2e.formats.columns import geometry_in, order_of
from adv2e.formats.event_file import Columns, EventFile, Facts
from adv2e.label import guessed
from adv2e.sources.stored import DESCRIPTION, EVENTS
from adv2e.ticks import LARGEST_NS, US, check_time

_BLOCK = 1 << 22  # bytes read at once
_SAMPLE = 1 << 19  # bytes that tell the unit of the times
_PIECE = 1 << 18  # bytes parsed at once
_JUDGED = 4096  # lines that tell the order of the columns
_DECIMALS = {"s": 6, "ms": 3, "us": 0, "ns": -3}  # that make a microsecond

_COMMENTS = re.compile(rb"^[ \t]*#([^\n]*)", re.M)
_SIZE = re.compile(rb"0{0,9}[1-9][0-9]{0,4}")


@dataclass(frozen=True)
class Form:
    """Line format of events: number and order of the fields.

    Attributes
    ----------
    what : str
        Description of a line, for messages.
    fields : int
        Number of fields in a line.
    order : tuple of int
        Indices of time, x, y and polarity among them.
    clean : callable
        Turns lines of a file into as many lines of numbers and blanks.
    """

    what: str = "'time x y polarity'"
    fields: int = 4
    order: tuple[int, ...] = (0, 1, 2, 3)
    clean: Callable[[bytes], bytes] = bytes

    def parse(self, block: bytes, decimals: int, *, exact: bool) -> Any:
        """Return the result of :func:`parse_lines`, in pieces that fit into caches."""
        found: list[tuple[Any, Any]] = []
        begin = before = wrong = 0  # bytes and lines of the pieces before
        while (begin < len(block) or not found) and not wrong:
            end = block.rfind(b"\n", begin, begin + _PIECE) + 1
            end = end or block.find(b"\n", begin) + 1 or len(block)
            piece = self.clean(block[begin:end])
            columns, lines, wrong = parse_lines(
                piece, decimals, exact=exact, fields=self.fields, order=self.order
            )
            found.append((columns, lines + before))
            wrong += before if wrong else 0
            before += block.count(b"\n", begin, end)
            begin = end
        parsed, places = zip(*found, strict=True)
        return np.concatenate(parsed, axis=1), np.concatenate(places), wrong

    def has_decimals(self, block: bytes) -> bool:
        """Tell whether a time in lines as they are is no whole number."""
        before = rb"[^\x00-\x20]+[\x00-\x09\x0b-\x20]+" * self.order[0]
        line = rb"^[\x00-\x09\x0b-\x20]*(?!#)" + before + rb"[^\x00-\x20.eE]*[.eE]"
        return re.search(line, self.clean(block), re.M) is not None


def open_text(path: Path, facts: Facts) -> EventFile:
    """Open a text file of events.

    ``adv2e.json`` beside an ``events.txt`` tells the geometry.

    Raises
    ------
    DataError
        From `parts`: a line that cannot be read.
    """
    beside = path.with_name(DESCRIPTION)
    if path.name == EVENTS and not facts.description and beside.is_file():
        facts.describe_from(beside)
    return lines_of(
        lambda: path.open("rb"), path.stat().st_size, str(path), facts, "the first line"
    )


def lines_of(
    opened: Callable[[], AbstractContextManager[IO[bytes]]],
    size: int,
    label: str,
    facts: Facts,
    header: str,
) -> EventFile:
    """Return the events that are the lines of a text, of which the first may be the geometry.

    Parameters and errors as :func:`events_of_lines`; `header` is what the first line is called.
    """
    with opened() as file:
        block = next(_blocks(file), b"")
    geometry, skipped, lines = _header(block)
    facts.state(geometry, header)
    comments = b"\n".join(_COMMENTS.findall(block[:_SAMPLE])).decode("utf-8", "replace")
    facts.state(geometry_in(comments)[1], "a comment")
    form = _form_of(block[skipped:_SAMPLE], facts)
    return events_of_lines(opened, size, label, facts, (skipped, lines), form)


def _form_of(block: bytes, facts: Facts) -> Form:
    """Return the format of lines without a heading; report it if it is not the usual one."""
    lines = _COMMENTS.sub(b"", block[: block.rfind(b"\n") + 1]).splitlines()
    fields = [line.split() for line in lines if line.strip()][:_JUDGED]
    try:
        rows = np.array(fields, np.float64)
    except ValueError:  # what is wrong with a line is told with its number
        rows = np.empty(0)
    order = order_of(rows) if rows.shape == (len(fields), 4) else "txyp"
    if order == "txyp":
        return Form()
    names = " ".join({"t": "time", "p": "polarity"}.get(name, name) for name in order)
    told = f"columns are taken as {names}: column {order.index('t') + 1} alone rises, and column"
    told += f" {order.index('p') + 1} alone holds but -1, 0 and 1"
    facts.tell(guessed(told, "columns", names, "write them as time x y polarity"))
    return Form(f"'{names}'", order=tuple(order.index(name) for name in "txyp"))


def events_of_lines(
    opened: Callable[[], AbstractContextManager[IO[bytes]]],
    size: int,
    label: str,
    facts: Facts,
    head: tuple[int, int],
    form: Form,
) -> EventFile:
    """Return the events that are the lines of a text.

    Parameters
    ----------
    opened : callable
        Opens the text.
    size : int
        That of the text [bytes], for telling the progress.
    label : str
        What it is called, for messages.
    facts : Facts
    head : (int, int)
        Bytes and lines before the events.
    form : Form

    Raises
    ------
    DataError
        From `parts`: a line is not of that form; the text names file and line.
    """
    skipped, lines = head
    with opened() as file:
        block = next(_blocks(file), b"")[skipped:]
    whole = not form.has_decimals(block)
    sample = block[: block.rfind(b"\n", 0, _SAMPLE) + 1 or len(block)]
    (t, x, y, _), *_ = form.parse(sample, 0 if whole else 6, exact=whole)
    unit = facts.unit_of_events(t if whole else t / 1e6, x, y, facts.geometry, whole=whole)
    # whole numbers stay as they are, as what they wrap at is of their unit
    decimals, unit_ns = (0, unit.ns) if whole else (_DECIMALS[unit.name], US)

    def parts() -> Iterator[Columns]:
        begin, before = skipped, lines  # bytes to leave out, lines in earlier blocks
        with opened() as file:
            for read in _blocks(file):
                block = read[begin:]
                columns, places, wrong = form.parse(block, decimals, exact=whole)
                if wrong:
                    raise _malformed(block, f"{label} line {before + wrong}", wrong, form.what)
                t = columns[0]
                late = np.flatnonzero(np.abs(t) > LARGEST_NS // unit_ns)
                if late.size:
                    time_ns = int(t[late[0]]) * unit_ns
                    check_time(time_ns, f"{label} line {before + places[late[0]]}")
                yield tuple(columns)
                before += block.count(b"\n")
                begin = 0
                facts.progress(file.tell(), size)

    order = "".join(name for _, name in sorted(zip(form.order, "txyp", strict=True)))
    times = label.removeprefix(f"{facts.path}: ")
    return EventFile("text", facts, parts, unit_ns=unit_ns, times=times, order=order)


def _blocks(file: IO[bytes]) -> Iterator[bytes]:
    """Yield the content of a file in blocks of whole lines."""
    held: list[bytes] = []
    while block := file.read(_BLOCK):
        cut = block.rfind(b"\n") + 1
        if cut:
            yield b"".join([*held, block[:cut]])
            held.clear()
        held.append(block[cut:])
    if any(held):
        yield b"".join(held)


def _header(block: bytes) -> tuple[tuple[int, int] | None, int, int]:
    """Return (geometry or None, bytes to skip, lines to skip) at the beginning of a file."""
    begin = 3 if block.startswith(b"\xef\xbb\xbf") else 0
    at, lines = begin, 0
    while at < len(block):
        end = block.find(b"\n", at)
        end = len(block) if end < 0 else end
        fields = block[at:end].split()
        at, lines = min(end + 1, len(block)), lines + 1
        if fields and not fields[0].startswith(b"#"):
            if len(fields) == 2 and all(_SIZE.fullmatch(field) for field in fields):
                return (int(fields[0]), int(fields[1])), at, lines
            break
    return None, begin, 0


def _malformed(data: bytes, label: str, wrong: int, what: str) -> DataError:
    line = data.split(b"\n", wrong)[wrong - 1].strip()
    shown = line[:60].decode("utf-8", errors="backslashreplace")
    return DataError(f"{label}: must be {what}, got {shown!r}")


_COMMENT = re.compile(rb"^[\x00-\x09\x0b-\x20]*#[^\n]*", re.M)
_PLUS, _MINUS, _POINT, _E, _ZERO, _FIVE, _NINE = b"+-.e059"
_LOWER = 32  # sets a letter in lower case
_LONGEST = 1000  # digits of a number
_MOST = 2**63 // 10 - 1  # that one more digit leaves within 64 bits
_TENS = 10 ** np.arange(19)
_EXACT = 12  # digits of a number that stays within 64 bits whatever is done with it

Numbers = NDArray[np.int64]


def parse_lines(
    block: bytes,
    decimals: int,
    *,
    exact: bool,
    fields: int = 4,
    order: tuple[int, ...] = (0, 1, 2, 3),
) -> tuple[Numbers, Numbers, int]:
    """Read lines of ``time x y polarity``.

    Parameters
    ----------
    block : bytes
        Whole lines.
    decimals : int
        Times are multiplied by 10**decimals, and rounded to the nearest, halves away from zero.
    exact : bool
        A time that would have to be rounded is wrong, as a column, row or polarity always is.
    fields : int
        How many a line has.
    order : tuple of int
        Where time, x, y and polarity stand among them.

    Returns
    -------
    columns : array of int64, (4, events)
        Time, x, y and polarity.
    lines : array of int64, (events,)
        Which line each stands in, from 1.
    wrong : int
        The first line that is wrong, from 1, before which the columns end; 0 if there is none.
    """
    found = _plain_numbers(block, fields, order[0])
    if found is not None and decimals >= 0 and not (exact and found.point):
        return found.columns(decimals, order), np.arange(1, len(found.numbers) + 1), 0
    if b"#" in block:
        block = _COMMENT.sub(b"", block)
    data = np.frombuffer(b"\n" + block + b"\n", np.uint8)
    filled = data > ord(" ")
    edges = np.flatnonzero(filled[1:] != filled[:-1]) + 1
    begin, end = edges[::2], edges[1::2]
    counts = np.diff(np.searchsorted(begin, np.flatnonzero(data == ord("\n"))))
    lines = np.flatnonzero(counts) + 1
    uneven = lines[counts[lines - 1] != fields]
    wrong = int(uneven[0]) if uneven.size else 0
    if wrong:
        lines = lines[lines < wrong]
    begin, end = (edge[: fields * lines.size].reshape(-1, fields) for edge in (begin, end))
    marks = np.flatnonzero(filled & (data - np.uint8(_ZERO) > 9))
    columns = np.empty((4, lines.size), np.int64)
    sound = np.empty((2, lines.size), np.bool_)
    time, *others = order
    ordered = sorted(others)
    columns[0], sound[0] = _numbers(data, marks, begin[:, time], end[:, time], decimals, exact)
    begin, end = begin[:, ordered].ravel(), end[:, ordered].ravel()
    values, good = _numbers(data, marks, begin, end, 0, True)
    columns[1:] = values.reshape(-1, 3).T[np.argsort(np.argsort(others))]
    sound[1] = good.reshape(-1, 3).all(axis=1)
    bad = np.flatnonzero(~sound.all(axis=0))
    if bad.size:
        wrong = int(lines[bad[0]])
        return columns[:, : bad[0]], lines[: bad[0]], wrong
    return columns, lines, wrong


@dataclass(frozen=True)
class _Plain:
    """Numbers of lines that are written plainly.

    Attributes
    ----------
    numbers : array of int64, (lines, fields)
        The time has two fields if it has a point: what is before it, and what is behind.
    point : bool
        It has.
    digits : array of int64, (lines,)
        Digits behind it.
    """

    numbers: Numbers
    point: bool
    digits: Numbers

    def columns(self, decimals: int, order: tuple[int, ...]) -> Numbers:
        """Return time, x, y and polarity, (4, lines), the time times 10**decimals."""
        time = order[0]
        places = [place + (self.point and place > time) for place in order]
        columns = np.ascontiguousarray(self.numbers.T[places])
        columns[0] *= _TENS[decimals]
        if self.point:
            behind, over = self.numbers[:, time + 1], self.digits - decimals
            whole, scale = _TENS[np.maximum(over, 0)], _TENS[np.maximum(-over, 0)]
            columns[0] += (behind + whole // 2) // whole * scale
        return columns


def _plain_numbers(block: bytes, fields: int, time: int) -> _Plain | None:
    """Return the numbers of lines of digits and single blanks, with a point in each time or none.

    Most files are written so, and compiled code reads them in a third of the time.  None: some
    line may be of another kind.
    """
    data = np.frombuffer(block, np.uint8)
    if not block.endswith(b"\n") or data.max() > ord("9"):
        return None
    edges = np.flatnonzero(data < ord("0"))
    marks = data[edges]
    count, points = (int(np.count_nonzero(marks == ord(mark))) for mark in "\n.")
    if points not in (0, count) or edges.size != count * (fields + (points > 0)):
        return None
    between = bytearray(b" " * (fields - 1) + b"\n")
    if points:
        between.insert(time, ord("."))
    lengths = np.diff(edges, prepend=-1).reshape(count, -1) - 1
    if (marks.reshape(count, -1) != np.frombuffer(between, np.uint8)).any():
        return None
    if lengths.min() < 1 or lengths.max() > _EXACT:
        return None
    text = block.translate(bytes.maketrans(b".", b" "))
    numbers = np.fromstring(text, np.int64, sep=" ").reshape(count, -1)
    return _Plain(numbers, points > 0, lengths[:, time + 1] if points else lengths[:, time])


def _numbers(
    data: NDArray[np.uint8],
    marks: Numbers,
    begin: Numbers,
    end: Numbers,
    decimals: int,
    exact: bool,
) -> tuple[Numbers, NDArray[np.bool_]]:
    """Return the numbers in data[begin:end] times 10**decimals, and which are sound.

    `marks` is where something other than digits stands, in all fields.
    """
    owner = np.searchsorted(begin, marks, side="right") - 1
    mine = (owner >= 0) & (marks < end[owner]) if begin.size else np.zeros(marks.size, np.bool_)
    marks, owner = marks[mine], owner[mine]
    mark, before = data[marks], data[marks - 1]
    is_sign, is_point = (mark == _PLUS) | (mark == _MINUS), mark == _POINT
    is_e, after_e = mark | _LOWER == _E, before | _LOWER == _E
    leads = is_sign & (marks == begin[owner])
    good = np.ones(begin.size, np.bool_)
    good[owner[~(leads | is_point | is_e | (is_sign & after_e))]] = False
    first, point, e = begin.copy(), end.copy(), end.copy()
    first[owner[leads]] += 1
    for place, which in ((point, is_point), (e, is_e)):
        owners = owner[which]
        place[owners] = marks[which]
        good[owners[1:][owners[1:] == owners[:-1]]] = False  # two in one field
    good &= (point < e) | (point == end)
    point = np.minimum(point, e)
    digits = e - first - (point < e)
    good &= (digits > 0) & (digits <= _LONGEST)

    # digits that make the whole number: those before the point, moved by the exponent
    kept = point - first + decimals
    powers = np.flatnonzero(good & (e < end))
    if powers.size:
        at = e[powers] + 1
        below = data[at] == _MINUS
        at += below | (data[at] == _PLUS)
        length = end[powers] - at
        good[powers] &= (length > 0) & (length <= 4)
        power = _whole_numbers(data, at, np.minimum(length, 4), end[powers])
        kept[powers] += np.where(below, -power, power)

    used = np.where(good, np.clip(kept, 0, digits), 0)
    values = _whole_numbers(data, first, used, point)
    # digits behind: the first rounds, or all must be zero
    rest = np.flatnonzero(good & (used < digits))
    if rest.size:
        place = first[rest] + used[rest]
        place += place >= point[rest]
        if exact:
            nonzero = np.cumsum((data > _ZERO) & (data <= _NINE))
            good[rest] = nonzero[e[rest] - 1] == nonzero[place - 1]
        else:
            values[rest] += (data[place] >= _FIVE) & (kept[rest] >= 0)
    zeros = np.clip(kept - used, 0, 18)
    if zeros.any():
        good &= (values <= (2**63 - 1) // _TENS[zeros]) & ((kept - used <= 18) | (values == 0))
        values *= _TENS[zeros]
    good &= values >= 0
    return np.where(data[begin] == _MINUS, -values, values), good


def _whole_numbers(
    data: NDArray[np.uint8], first: Numbers, digits: Numbers, point: Numbers
) -> Numbers:
    """Return the numbers of so many digits from `first`, over the point; -1: beyond 64 bits."""
    values = np.zeros(first.size, np.int64)
    fewest = int(digits.min(initial=_LONGEST))
    for k in range(int(digits.max(initial=0))):
        some = slice(None) if k < fewest else np.flatnonzero(digits > k)
        place = first[some] + k
        place += place >= point[some]
        value = values[some]
        if k >= 18:
            value[(value > _MOST) | (value < 0)] = -1
        values[some] = value * 10 + (data[place] - np.uint8(_ZERO))
    return values
