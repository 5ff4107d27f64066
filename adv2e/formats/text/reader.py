"""Events as text: ``events.txt`` of DAVIS240C and its relatives.

A line is ``time x y polarity``, separated by blanks.  Lines that begin with ``#`` and empty lines
are skipped.  Times are seconds, plain or scientific, read digit by digit to the nearest
microsecond, so that 1.47e9 s loses nothing.  A first line of two numbers is the geometry
(``width height``, as rpg_e2vid writes it).  Other units than seconds, such as the microseconds of
DVS-Voltmeter, are told from the times: see :mod:`adv2e.formats.units`.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

import numpy as np

from adv2e.errors import DataError
from adv2e.formats.column_names import geometry_in, order_of
from adv2e.formats.event_file import Columns, EventFile, Facts
from adv2e.formats.text.lines import parse_lines
from adv2e.sources.stored import DESCRIPTION, EVENTS
from adv2e.ticks import LARGEST_NS, US, check_time

_BLOCK = 1 << 22  # bytes read at once
_SAMPLE = 1 << 19  # bytes that tell the unit of the times
_PIECE = 1 << 18  # bytes parsed at once
_JUDGED = 4096  # lines that tell the order of the columns
_DECIMALS = {"s": 6, "ms": 3, "us": 0, "ns": -3}  # that make a microsecond

_COMMENT = re.compile(rb"^[ \t]*#([^\n]*)", re.M)
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
    comments = b"\n".join(_COMMENT.findall(block[:_SAMPLE])).decode("utf-8", "replace")
    facts.state(geometry_in(comments)[1], "a comment")
    form = _form_of(block[skipped:_SAMPLE], facts)
    return events_of_lines(opened, size, label, facts, (skipped, lines), form)


def _form_of(block: bytes, facts: Facts) -> Form:
    """Return the format of lines without a heading; report it if it is not the usual one."""
    lines = _COMMENT.sub(b"", block[: block.rfind(b"\n") + 1]).splitlines()
    fields = [line.split() for line in lines if line.strip()][:_JUDGED]
    try:
        rows = np.array(fields, np.float64)
    except ValueError:  # what is wrong with a line is told with its number
        rows = np.empty(0)
    order = order_of(rows) if rows.shape == (len(fields), 4) else "txyp"
    if order == "txyp":
        return Form()
    names = " ".join({"t": "time", "p": "polarity"}.get(name, name) for name in order)
    facts.tell(
        f"columns are taken as {names}: column {order.index('t') + 1} alone rises, and column"
        f" {order.index('p') + 1} alone holds but -1, 0 and 1"
    )
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
