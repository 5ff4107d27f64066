"""Events as text: ``events.txt`` of DAVIS240C and its relatives.

A line is ``time x y polarity``, separated by blanks.  Lines that begin with ``#`` and empty lines
are skipped.  Times are seconds, plain or scientific, read digit by digit to the nearest
microsecond, so that 1.47e9 s loses nothing.  A first line of two numbers is the geometry
(``width height``, as rpg_e2vid writes it).  Other units than seconds, such as the microseconds of
DVS-Voltmeter, are told from the times: see :mod:`adv2e.sources.times.units`.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from itertools import islice
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from adv2e.compiled import entry, kernel
from adv2e.errors import DataError
from adv2e.formats.builder import RecordingBuilder
from adv2e.formats.recording import Recording
from adv2e.sources.times.units import Unit
from adv2e.ticks import LARGEST_NS, US, check_us

_BLOCK = 1 << 22  # bytes read at once
_DECIMALS = {"s": 6, "ms": 3, "us": 0, "ns": -3}  # that make a microsecond

_SIZE = re.compile(rb"0{0,9}[1-9][0-9]{0,4}")
_HOLDS = re.compile(rb"[\x00-\x20]*[^\x00-\x20#]")
_DECIMAL_TIME = re.compile(rb"^[\x00-\x09\x0b-\x20]*(?!#)[^\x00-\x20.eE]*[.eE]", re.M)

_MALFORMED, _WHOLE, _ROUNDED = -1, 0, 1


@kernel
def _number(data: Any, start: int, stop: int, decimals: int) -> Any:
    """Return (value times 10**decimals to the nearest, what became of it) of a decimal number.

    What became of it: _MALFORMED, _WHOLE or _ROUNDED.
    """
    at = start
    negative = data[at] == 45
    if negative or data[at] == 43:
        at += 1
    first = at
    point = -1
    digits = 0
    while at < stop and data[at] != 101 and data[at] != 69:  # e, E
        if data[at] == 46 and point < 0:
            point = at
        elif 48 <= data[at] <= 57:
            digits += 1
        else:
            return 0, _MALFORMED
        at += 1
    last = at
    if digits == 0:
        return 0, _MALFORMED
    exponent = 0
    if at < stop:
        at += 1
        below = at < stop and data[at] == 45
        if at < stop and (below or data[at] == 43):
            at += 1
        if at == stop or stop - at > 4:
            return 0, _MALFORMED
        while at < stop:
            if not 48 <= data[at] <= 57:
                return 0, _MALFORMED
            exponent = exponent * 10 + int(data[at]) - 48
            at += 1
        if below:
            exponent = -exponent
    kept = (last if point < 0 else point) - first + exponent + decimals
    value = 0
    seen = 0
    up = False
    whole = True
    for k in range(first, last):
        if k == point:
            continue
        digit = int(data[k]) - 48
        if seen < kept:
            if value > 922337203685477579:
                return 0, _MALFORMED
            value = value * 10 + digit
        elif digit > 0:
            whole = False
            up = up or (seen == kept and digit >= 5)
        seen += 1
    while seen < kept and value > 0:
        if value > 922337203685477579:
            return 0, _MALFORMED
        value *= 10
        seen += 1
    if up:
        value += 1
    return (-value if negative else value), (_WHOLE if whole else _ROUNDED)


@entry
def parse_lines(data: Any, decimals: int, t: Any, x: Any, y: Any, p: Any) -> Any:
    """Read the lines in `data` into columns; return (events, lines, line that is wrong or 0)."""
    count = 0
    line = 0
    at = 0
    size = data.shape[0]
    while at < size:
        line += 1
        fields = 0
        comment = False
        while at < size and data[at] != 10:
            if data[at] <= 32:
                at += 1
                continue
            comment = comment or (data[at] == 35 and fields == 0)
            start = at
            while at < size and data[at] > 32:
                at += 1
            if comment:
                continue
            value, became = _number(data, start, at, decimals if fields == 0 else 0)
            rounded = became == _ROUNDED and (fields > 0 or decimals == 0)
            if became == _MALFORMED or rounded or fields == 4:
                return count, line, line
            if fields == 0:
                t[count] = value
            elif fields == 1:
                x[count] = value
            elif fields == 2:
                y[count] = value
            else:
                p[count] = value
            fields += 1
        at += 1
        if fields == 4:
            count += 1
        elif fields > 0:
            return count, line, line
    return count, line, 0


def read_text(path: Path, time_unit: str | None = None) -> Recording:
    """Return the recording in a text file of events.

    ``<name>.json`` beside it, or ``adv2e.json`` beside an ``events.txt``, tells the geometry.

    Raises
    ------
    DataError
        A line that cannot be read.
    """
    builder = RecordingBuilder(path, time_unit)
    beside = [path.with_name(path.name + ".json")]
    if path.name == "events.txt":
        beside.append(path.with_name("adv2e.json"))
    description = next((file for file in beside if file.is_file()), None)
    if description is not None:
        text = description.read_text("utf-8", errors="replace")
        builder.describe(text, str(description), description.name)
    with path.open("rb") as file:
        geometry = read_lines(file, str(path), builder)
    builder.state(geometry, "the first line")
    return builder.finish("text")


def read_lines(file: IO[bytes], label: str, builder: RecordingBuilder) -> tuple[int, int] | None:
    """Read all lines of `file` into `builder`; return what the first says of width and height.

    Parameters
    ----------
    file : binary file
        Read from where it stands to its end.
    label : str
        Its name, for messages.
    builder : RecordingBuilder

    Raises
    ------
    DataError
        A line is not ``time x y polarity``; the text names file and line.
    """
    geometry, whole, unit = None, False, Unit("s")
    before = 0  # lines in earlier blocks
    for number, block in enumerate(_blocks(file)):
        data = np.frombuffer(block, np.uint8)
        if number == 0:
            geometry, begin, before = _header(block)
            data = data[begin:]
            whole = not _DECIMAL_TIME.search(block[begin:])
            t, x, y, *_ = _columns(data, whole, "us" if whole else "s")
            unit = builder.unit_of_events(t if whole else t / 1e6, x, y, geometry, whole=whole)
        t, x, y, p, lines, wrong = _columns(data, whole, unit.name)
        if wrong:
            raise _malformed(data.tobytes(), label, before, wrong)
        late = np.flatnonzero(np.abs(t) > LARGEST_NS // US)
        if late.size:
            line = before + _line_of(data.tobytes(), int(late[0]))
            check_us(t[late[:1]], f"{label} line {line}")
        builder.add(t, x, y, p)
        before += lines
    return geometry


def _columns(data: NDArray[np.uint8], whole: bool, unit: str) -> tuple[Any, ...]:
    """Return time [us], x, y and polarity of each line, lines read, and the wrong one or 0."""
    rows = int(np.count_nonzero(data == 10)) + 1
    columns = [np.empty(rows, np.int64) for _ in range(4)]
    # digits behind the point of microseconds are rounded, where some were expected
    parts = 1000 if unit == "us" and not whole else 1
    count, lines, wrong = parse_lines(data, 3 if parts > 1 else _DECIMALS[unit], *columns)
    t, x, y, p = (column[:count] for column in columns)
    return (t + parts // 2) // parts, x, y, p, lines, wrong


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


def _line_of(data: bytes, event: int) -> int:
    """Return the number of the line, from 1, that holds an event, from 0."""
    lines = (n for n, line in enumerate(data.split(b"\n"), 1) if _HOLDS.match(line))
    return next(islice(lines, event, None))


def _malformed(data: bytes, label: str, before: int, wrong: int) -> DataError:
    line = data.split(b"\n", wrong)[wrong - 1].strip()
    shown = line[:60].decode("utf-8", errors="backslashreplace")
    return DataError(f"{label} line {before + wrong}: must be 'time x y polarity', got {shown!r}")
