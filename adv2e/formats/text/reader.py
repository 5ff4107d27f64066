"""Events as text: ``events.txt`` of DAVIS240C and its relatives.

A line is ``time x y polarity``, separated by blanks.  Lines that begin with ``#`` and empty lines
are skipped.  Times are seconds, plain or scientific, read digit by digit to the nearest
microsecond, so that 1.47e9 s loses nothing.  A first line of two numbers is the geometry
(``width height``, as rpg_e2vid writes it).  Other units than seconds, such as the microseconds of
DVS-Voltmeter, are told from the times: see :mod:`adv2e.formats.units`.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import IO

import numpy as np

from adv2e.errors import DataError
from adv2e.formats.builder import RecordingBuilder
from adv2e.formats.recording import Recording
from adv2e.formats.text.lines import parse_lines
from adv2e.sources.stored import DESCRIPTION, EVENTS
from adv2e.sources.times.units import Unit
from adv2e.ticks import LARGEST_NS, US, check_us

_BLOCK = 1 << 22  # bytes read at once
_DECIMALS = {"s": 6, "ms": 3, "us": 0, "ns": -3}  # that make a microsecond

_SIZE = re.compile(rb"0{0,9}[1-9][0-9]{0,4}")
_DECIMAL_TIME = re.compile(rb"^[\x00-\x09\x0b-\x20]*(?!#)[^\x00-\x20.eE]*[.eE]", re.M)


def read_text(path: Path, builder: RecordingBuilder) -> Recording:
    """Return the recording in a text file of events; `builder` is a new one.

    ``<name>.json`` beside it, or ``adv2e.json`` beside an ``events.txt``, tells the geometry.

    Raises
    ------
    DataError
        A line that cannot be read.
    """
    beside = [path.with_name(path.name + ".json")]
    if path.name == EVENTS:
        beside.append(path.with_name(DESCRIPTION))
    description = next((file for file in beside if file.is_file()), None)
    if description is not None:
        text = description.read_text("utf-8", errors="replace")
        builder.describe(text, str(description), description.name)
    with path.open("rb") as file:
        geometry = read_lines(file, path.stat().st_size, str(path), builder)
    builder.state(geometry, "the first line")
    return builder.finish("text")


def read_lines(
    file: IO[bytes], size: int, label: str, builder: RecordingBuilder
) -> tuple[int, int] | None:
    """Read all lines of `file` into `builder`; return what the first says of width and height.

    `size` is that of the file [bytes], for telling the progress.

    Raises
    ------
    DataError
        A line is not ``time x y polarity``; the text names file and line.
    """
    geometry, whole, unit = None, False, Unit("s")
    before = 0  # lines in earlier blocks
    for number, read in enumerate(_blocks(file)):
        block = read
        if number == 0:
            geometry, begin, before = _header(read)
            block = read[begin:]
            whole = not _DECIMAL_TIME.search(block)
            (t, x, y, _), *_ = parse_lines(block, 0 if whole else 6, exact=whole)
            unit = builder.unit_of_events(t if whole else t / 1e6, x, y, geometry, whole=whole)
        decimals = _DECIMALS[unit.name]
        columns, lines, wrong = parse_lines(block, decimals, exact=whole and decimals == 0)
        if wrong:
            raise _malformed(block, label, before, wrong)
        t = columns[0]
        late = np.flatnonzero(np.abs(t) > LARGEST_NS // US)
        if late.size:
            check_us(t[late[:1]], f"{label} line {before + lines[late[0]]}")
        builder.add(*columns)
        before += block.count(b"\n")
        builder.progress(file.tell(), size)
    return geometry


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


def _malformed(data: bytes, label: str, before: int, wrong: int) -> DataError:
    line = data.split(b"\n", wrong)[wrong - 1].strip()
    shown = line[:60].decode("utf-8", errors="backslashreplace")
    return DataError(f"{label} line {before + wrong}: must be 'time x y polarity', got {shown!r}")
