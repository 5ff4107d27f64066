"""Binary formats that are a stream of words: ES, DAT, EVT 2.0, 2.1 and 3.0, and N-MNIST.

Words are read in blocks, and times of few bits are counted on.  Each format has a section below,
which begins with its layout.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.background import OrderedWork
from adv2e.errors import DataError
from adv2e.events import Events
from adv2e.formats.event_file import Column, Columns, EventFile, Facts
from adv2e.formats.writing import Request, Writer, to_line
from adv2e.label import left_out
from adv2e.ticks import US, check_time

# ---- Files that are a stream of words: read in blocks, and times of few bits counted on.


Numbers = NDArray[np.int64]


def blocks(
    path: Path, begin: int, dtype: str, count: int, facts: Facts | None = None
) -> Iterator[NDArray[Any]]:
    """Yield the words of a file as arrays of at most `count` of them.

    What is left at the end and is no whole word, as where a recording was broken off, is told.

    Parameters
    ----------
    path : Path
    begin : int
        Where the first word begins [bytes].
    dtype : str
        Of a word.
    count : int
    facts : Facts, optional
        Is told the progress, and what is left.
    """
    word = np.dtype(dtype)
    total = path.stat().st_size
    with path.open("rb") as file:
        file.seek(begin)
        while data := file.read(count * word.itemsize):
            whole, left = divmod(len(data), word.itemsize)
            if whole:
                yield np.frombuffer(data, word, whole)
            if facts is None:
                continue
            if left:
                told = (
                    f"{left} bytes at the end, at byte {file.tell() - left}, are no whole word of"
                )
                facts.problems.append(left_out(f"{told} {word.itemsize}: left out"))
            facts.progress(file.tell(), total)


class Counter:
    """Counts on where numbers of few bits begin again: where one is less by half the range.

    Parameters
    ----------
    bits : int
        Of a number.
    """

    def __init__(self, bits: int) -> None:
        self._bits = bits
        self._last = self._turns = 0

    def __call__(self, numbers: NDArray[Any]) -> Numbers:
        """Return the numbers that follow on those of the last call, counted on."""
        counted = numbers.astype(np.int64)
        if not counted.size:
            return counted
        again = np.empty(counted.size, np.bool_)
        half = 1 << (self._bits - 1)
        again[0] = self._last - counted[0] >= half
        np.greater_equal(counted[:-1] - counted[1:], half, out=again[1:])
        self._last = int(counted[-1])
        if self._turns or again.any():
            turns = self._turns + np.cumsum(again)
            self._turns = int(turns[-1])
            counted += turns << self._bits
        return counted


def last_before(values: NDArray[Any], which: NDArray[np.bool_], carry: int, at: Numbers) -> Numbers:
    """Return the state at the words `at`: the last of `values` before each.

    Parameters
    ----------
    values : array, (words set in `which`,)
        Values that these words set.
    which : array of bool, (words,)
    carry : int
        State before the first of them.
    at : array of int, (n,)
        None of those set in `which`.
    """
    table = np.empty(values.size + 1, np.int64)
    table[0], table[1:] = carry, values
    if values.size < at.size >> 4:  # few, so each holds for many
        ends = np.searchsorted(at, np.flatnonzero(which))
        return np.repeat(table, np.diff(ends, prepend=0, append=at.size))
    held: Numbers = table[np.cumsum(which, dtype=np.int32)[at]]
    return held


class Kinds:
    """Counts the words of each kind, to tell of those that nobody knows.

    Parameters
    ----------
    known : tuple of int
        Kinds that the format has, whether they are events or not.
    """

    def __init__(self, *known: int) -> None:
        self._known = known
        self._counts = np.zeros(16, np.int64)
        self._total = 0
        self.early = 0

    def note(self, kinds: NDArray[Any], usual: NDArray[np.bool_]) -> None:
        """Count some words, of which those that are `usual` are known."""
        self._total += kinds.size
        if not usual.all():
            self._counts += np.bincount(kinds[~usual], minlength=16)

    def problems(self) -> list[str]:
        """Return the problems of all words until now."""
        told: list[str] = []
        if self.early:
            early = f"{self.early} events without a time, row or column before them: left out"
            told.append(left_out(early))
        odd = [kind for kind in np.flatnonzero(self._counts) if kind not in self._known]
        if odd:
            names = ", ".join(f"{kind:#x}" for kind in odd)
            count = f"{self._counts[odd].sum()} of {self._total} words"
            line = f"{count} of a kind that the format does not have ({names}): left out"
            told.append(left_out(line))
        return told


# ---- Headers of lines that begin with ``%``, which RAW and DAT files of Prophesee begin with.
#
# A line is ``% key value``; the line ``% end`` ends the header, or the first line of another kind.
# This program writes a line ``% adv2e`` with its settings as JSON.


_LONGEST = 1 << 20  # bytes of a header
_LINE = re.compile(rb"%[ \r\n]")


@dataclass(frozen=True)
class Header:
    """The header of a file.

    Attributes
    ----------
    path : Path
        The file.
    values : dict
        By key, in lower case.
    size : int
        Where the header ends [bytes].
    """

    path: Path
    values: dict[str, str]
    size: int

    def whole(self, key: str) -> int | None:
        """Return the whole number that a line gives, or None without that line.

        Raises
        ------
        DataError
            It is none.
        """
        value = self.values.get(key)
        if value is None:
            return None
        if not re.fullmatch(r"[0-9]{1,18}", value):
            raise DataError(
                f"{self.path}: header: {key!r} must be a whole number, not {value[:40]!r}"
            )
        return int(value)

    @property
    def t0(self) -> int:
        """Time [us] that faery took off all times and states; DataError if it cannot be."""
        t0_us = self.whole("t0") or 0
        check_time(t0_us * US, f"{self.path}: header: 't0'")
        return t0_us

    def tell(self, facts: Facts, geometry: tuple[int | None, int | None]) -> None:
        """Hand the description in the header to `facts`, and the geometry, (width, height)."""
        if "adv2e" in self.values:
            facts.describe(self.values["adv2e"], f"{self.path}: header: adv2e", "the header")
        facts.state_by_names({"width": geometry[0], "height": geometry[1]}, "the header")


def read_header(path: Path) -> Header:
    """Read the header of a file; one without a header has no values.

    Raises
    ------
    DataError
        A line of it does not end.
    """
    with path.open("rb") as file:
        data = file.read(_LONGEST)
    values: dict[str, str] = {}
    at = 0
    while _LINE.match(data, at):
        end = data.find(b"\n", at)
        if end < 0:
            raise DataError(f"{path}: header: a line, at byte {at}, does not end")
        line = data[at + 1 : end].decode("utf-8", "replace").strip()
        at = end + 1
        if line == "end":
            break
        key, _, value = line.partition(" ")
        values[key.lower()] = value.strip()
    return Header(path, values, at)


def raw_header(request: Request, version: str) -> bytes:
    """Return the whole header of a RAW file in EVT of that version, such as 3.0."""
    encoding = f"EVT{version[0]};height={request.height};width={request.width}"
    geometry = f"geometry {request.width}x{request.height}"
    return header_of(request, f"evt {version}", f"format {encoding}", geometry) + b"% end\n"


def header_of(request: Request, *lines: str) -> bytes:
    """Return a header of such lines and the settings; the end is for the caller to add."""
    settings = f"adv2e {to_line(request.description)}"
    return "".join(f"% {line}\n" for line in (*lines, settings)).encode("ascii")


# ---- Events in Event Stream, version 2, in files that end on ``.es``; of its types, DVS events.
#
# ======== =============================================
# bytes    content
# ======== =============================================
# 0-11     ``Event Stream``
# 12-14    version: major, minor, patch
# 15       type: 1, DVS events
# 16-19    width and height, 16 bits each, little endian
# ======== =============================================
#
# Then, for each event:
#
# ====== ==============================================================================
# byte   content
# ====== ==============================================================================
# 0      bits 1-7: time since the event before [us], up to 126; bit 0: polarity
# 1-2    column, little endian
# 3-4    row, from the bottom
# ====== ==============================================================================
#
# Before an event, a byte 0xFF is 127 us more, and 0xFE says nothing. Times are from 0 on, so empty
# time makes a file long: 28 MB an hour. Up to 9.5 hours are written.
#
# References
# ----------
# .. [1] A. Marcireau, "Event Stream", https://github.com/neuromorphic-paris/event_stream.


_MAGIC = b"Event Stream"
_VERSION = 2, 0, 0
_ES_TYPES = "generic events", "DVS events", "ATIS events", "display events", "colour events"
_DVS = 1
_HEADER = 20  # bytes
_OVERFLOW, _RESET = 0xFF, 0xFE
_OVERFLOW_US = 127  # us of an overflow
_EVENT = 5  # bytes
_ES_BYTES = 1 << 20  # bytes
_WRITE = 1 << 18  # events, or bytes of empty time


def open_es(path: Path, facts: Facts) -> EventFile:
    """Open an Event Stream file.

    Raises
    ------
    DataError
        It is of another version, or of another type than DVS events.
    """
    with path.open("rb") as file:
        header = file.read(_HEADER)
    if len(header) < _HEADER:
        raise DataError(f"{path}: cut short, within the header")
    version = tuple(header[12:15])
    if version[0] != _VERSION[0]:
        raise DataError(
            f"{path}: Event Stream of version {'.'.join(map(str, version))}, must be {_VERSION[0]}"
        )
    if header[15] != _DVS:
        names = dict(enumerate(_ES_TYPES))
        raise DataError(
            f"{path}: holds {names.get(header[15], f'events of type {header[15]}')}, must be DVS"
            " events"
        )
    width, height = (int(size) for size in np.frombuffer(header[16:20], "<u2"))
    facts.state_by_names({"width": width, "height": height}, "the header")

    def parts() -> Iterator[Columns]:
        total, t, rest = path.stat().st_size, 0, b""
        with path.open("rb") as file:
            file.seek(_HEADER)
            while data := file.read(_ES_BYTES):
                block = np.frombuffer(rest + data, np.uint8)
                events, waits, rest = _split(block)
                times = t + np.cumsum(waits[:-1] + (events[:, 0] >> 1))
                t = int(times[-1] if times.size else t) + int(waits[-1])
                x, y = (
                    events[:, k].astype(np.int32) | events[:, k + 1].astype(np.int32) << 8
                    for k in (1, 3)
                )
                yield times, x, height - 1 - y, events[:, 0] & 1
                facts.progress(file.tell(), total)
        if rest:
            told = f"the last {len(rest)} bytes are no whole event: left out"
            facts.problems.append(left_out(told))

    return EventFile("es", facts, parts)


def _split(block: NDArray[np.uint8]) -> tuple[NDArray[np.uint8], NDArray[np.int64], bytes]:
    """Return the events, (n, 5), the empty time before each and at the end, and what is left.

    Bytes from 0xFE on stand alone where an event may begin.  Where that is depends on all before,
    but only on those that stand alone, which come in few runs.
    """
    is_high = np.zeros(block.size + 2, np.int8)
    np.greater_equal(block, _RESET, out=is_high[1:-1].view(np.bool_))
    edges = np.flatnonzero(np.diff(is_high))
    begin = 0  # of some event before the run
    alone: list[tuple[int, int]] = []
    for run, end in edges.reshape(-1, 2).tolist():
        at = run + (begin - run) % _EVENT
        if at < end:
            begin = end
            alone.append((at, end))
    first, last = np.array(alone, np.int64).reshape(-1, 2).T
    step = np.zeros(block.size + 1, np.int8)
    step[first] = 1
    step[last] -= 1
    of_events = block[np.cumsum(step[:-1], dtype=np.int8) == 0]
    count, left = divmod(of_events.size, _EVENT)
    overflows = np.concatenate([[0], np.cumsum(block == _OVERFLOW, dtype=np.int32)])
    lengths = last - first
    which = (first - (np.cumsum(lengths) - lengths)) // _EVENT
    waits = np.zeros(count + 1, np.int64)
    waits[which] = (overflows[last] - overflows[first]) * _OVERFLOW_US
    rest = of_events[count * _EVENT :].tobytes() if left else b""
    return of_events[: count * _EVENT].reshape(count, _EVENT), waits, rest


class EsWriter(Writer):
    """Writes Event Stream; see :class:`Writer`."""

    def __init__(self, request: Request, stack: ExitStack, path: Path) -> None:
        self._file = stack.enter_context(path.open("wb"))
        size = np.array([request.width, request.height], "<u2").tobytes()
        self._file.write(_MAGIC + bytes(_VERSION) + bytes([_DVS]) + size)
        self._rows = request.height
        self._t = 0

    def write_events(self, events: Events) -> None:
        """Append events."""
        for begin in range(0, events.size, _WRITE):
            part = events[begin : begin + _WRITE]
            far = np.flatnonzero(np.diff(part["t"]) > _WRITE) + 1
            for piece in np.split(part, far):
                self._pass_time(int(piece["t"][0]))
                self._write(piece)

    def _pass_time(self, t: int) -> None:
        """Write the time up to an event, but for what the event holds itself."""
        overflows, _ = divmod(t - self._t, _OVERFLOW_US)
        self._t += overflows * _OVERFLOW_US
        while overflows:
            count = min(overflows, _WRITE)
            self._file.write(bytes([_OVERFLOW]) * count)
            overflows -= count

    def _write(self, events: Events) -> None:
        passed = np.diff(events["t"], prepend=self._t)
        self._t = int(events["t"][-1])
        overflows, left = np.divmod(passed, _OVERFLOW_US)
        end = np.cumsum(overflows + _EVENT)
        data = np.full(int(end[-1]), _OVERFLOW, np.uint8)
        at = end - _EVENT
        y = self._rows - 1 - events["y"]
        data[at] = left << 1 | events["p"]
        for k, value in ((1, events["x"]), (3, y)):
            data[at + k] = value & 0xFF
            data[at + k + 1] = value >> 8
        self._file.write(data.data)


# ---- Events in DAT, a format of Prophesee's cameras and data sets, in files that end on ``.dat``.
#
# A header of lines with ``%``, which states ``Version 2``, ``Width`` and
# ``Height``, is followed by two bytes, the type and size of an event, and by the events, each two
# words of 32 bits, little endian:
#
# ==== =====================================================
# word bits
# ==== =====================================================
# 0    time [us]
# 1    0-13: column; 14-27: row; 28-31: polarity, ON above 0
# ==== =====================================================
#
# Times have 32 bits, some 71 minutes; where they begin again at zero, that is counted on reading.
# Type 12 is written (contrast detection); type 0, which expelliarmus writes, is the same. faery
# writes times from the first event on, and that as ``% T0`` in the header, which is added here.
#
# References
# ----------
# .. [1] Prophesee, "DAT File Format",
#    https://docs.prophesee.ai/stable/data/file_formats/dat.html.


_TYPE, _SIZE = 12, 8
_DAT_TYPES = (0, _TYPE)
_BLOCK = 1 << 18  # events


def open_dat(path: Path, facts: Facts) -> EventFile:
    """Open a DAT file.

    Raises
    ------
    DataError
        It is of another version, or holds another type of events.
    """
    header = read_header(path)
    version = header.whole("version")
    if version != 2:
        raise DataError(
            f"{path}: its header states {f'version {version}' if version else 'no version'}, must"
            " be version 2; Metavision writes it: metavision_raw_to_dat"
        )
    with path.open("rb") as file:
        file.seek(header.size)
        kind = tuple(file.read(2))
    if not kind:
        facts.problems.append("nothing follows its header")
    elif len(kind) < 2 or kind[0] not in _DAT_TYPES or kind[1] != _SIZE:
        held = f"type {kind[0]} of {kind[1]} bytes" if len(kind) == 2 else "cut short"
        raise DataError(
            f"{path}: events, at byte {header.size}: {held}, must be type {_TYPE} (contrast"
            f" detection) of {_SIZE} bytes"
        )
    header.tell(facts, (header.whole("width"), header.whole("height")))
    begin = header.t0

    def parts() -> Iterator[Columns]:
        for words in blocks(path, header.size + 2, "(2,)<u4", _BLOCK, facts):
            where = words[:, 1]
            yield (
                words[:, 0],
                where & 0x3FFF,
                where >> 14 & 0x3FFF,
                (where >> 28 > 0).astype(np.uint8),
            )

    return EventFile("dat", facts, parts, offset_us=begin, bits=32)


class DatWriter(Writer):
    """Writes DAT; see :class:`Writer`."""

    def __init__(self, request: Request, stack: ExitStack, path: Path) -> None:
        self._file = stack.enter_context(path.open("wb"))
        sizes = f"Width {request.width}", f"Height {request.height}"
        first = "Data file containing CD events."
        self._file.write(header_of(request, first, "Version 2", *sizes) + bytes([_TYPE, _SIZE]))

    def write_events(self, events: Events) -> None:
        """Append events."""
        for begin in range(0, events.size, _BLOCK):
            part = events[begin : begin + _BLOCK]
            words = np.empty((part.size, 2), "<u4")
            words[:, 0] = part["t"]
            polarity, row = part["p"].astype(np.uint32) << 28, part["y"].astype(np.uint32) << 14
            words[:, 1] = polarity | row | part["x"]
            self._file.write(words.data)


# ---- Events in EVT 2.0, 2.1 and 3.0, formats of Prophesee's cameras, in files that end on
# ``.raw``.
#
# A header of lines with ``%`` says which it is. Words follow, little
# endian. In EVT 2.0 they have 32 bits:
#
# ======= =========== ======================================== ==========================
# kind    bits 28-31  bits 0-27
# ======= =========== ======================================== ==========================
# OFF, ON 0x0, 0x1    22-27: time, low bits; 11-21: column;    an event
#                     0-10: row
# HIGH    0x8         time, from bit 6 on                      holds until the next one
# others  0xA, E, F   triggers and what vendors add            left out
# ======= =========== ======================================== ==========================
#
# Times have 34 bits [us], some 4.7 hours; then they begin again at zero, which is counted on
# reading. A file that is written begins with time 0, because Metavision takes the first time off
# all others. faery writes times from the first event on, and that as ``% t0`` in the header, which
# is added here.
#
# EVT 2.1 has words of 64 bits.  Their upper half is a word of EVT 2.0, whose column is a multiple
# of 32; the lower half has a bit for each of 32 columns from there on, set for an event.  In the
# order ``legacy``, that of the IMX636, the upper half comes first.  It is read, and not written.
#
# In EVT 3.0 words have 16 bits. What a word says holds until another one of its kind:
#
# ========= =========== ===================================================
# kind      bits 12-15  bits 0-11
# ========= =========== ===================================================
# ROW       0x0         0-10: row
# COLUMN    0x2         0-10: column; 11: polarity: an event
# BASE      0x3         0-10: column, from which vectors count; 11: polarity
# VECTOR    0x4, 0x5    12, or 8, columns: an event where a bit is set;
#                       the base moves on by as many
# LOW       0x6         time, low bits
# HIGH      0x8         time, high bits; if they change, the low ones are 0
# others    0x7, A, E,  triggers and what vendors add, left out
#           0xF
# ========= =========== ===================================================
#
# Times have 24 bits [us], so they begin again at zero every 16.8 s, which is counted on reading.
# So that every reader can count it, each HIGH is written, one every 4.096 ms, also where there is
# no event, from time 0 on; up to 19 hours, which are 34 MB of such words. Vectors are not written.
# Rows of kind 0x1 are those of another type of event, which is left out.
#
# References
# ----------
# .. [1] Prophesee, "EVT 2.0 Format", https://docs.prophesee.ai/stable/data/encoding_formats/evt2.html;
#    "EVT 2.1 Format", .../evt21.html; "EVT 3.0 Format", .../evt3.html.


_ROW, _OTHER_ROW, _COLUMN, _BASE, _VECTOR_12, _VECTOR_8, _LOW, _HIGH = 0, 1, 2, 3, 4, 5, 6, 8
_KINDS_3 = (_ROW, _COLUMN, _BASE, _VECTOR_12, _VECTOR_8, _LOW, 0x7, _HIGH, 0xA, 0xE, 0xF)
_USUAL = np.isin(np.arange(16), (_ROW, _COLUMN, _BASE, _VECTOR_12, _VECTOR_8, _LOW, _HIGH))
_NOWHERE = -(1 << 40)
_KINDS_2 = (0x0, 0x1, _HIGH, 0xA, 0xE, 0xF)
_LOW_BITS, _ADDRESS_BITS = 6, 11  # of words of EVT 2.0
_UPPER = {"little": 1, "legacy": 0}  # place of the upper half of a word
_READ = 1 << 19  # bytes
_WRITTEN = 1 << 16  # events, or high bits of times, written at once
_VERSIONS = {"2.0": "EVT2", "2.1": "EVT21", "3.0": "EVT3", "4.0": "EVT4"}


def open_raw(path: Path, facts: Facts) -> EventFile:
    """Open a file in EVT 2.0, EVT 2.1 or EVT 3.0.

    Raises
    ------
    DataError
        Its header says another encoding, or none.
    """
    header = read_header(path)
    encoding, options = _encoding(header)
    if encoding not in DECODERS:
        raise DataError(
            f"{path}: events in {encoding or 'an encoding that its header does not state'};"
            f" {', '.join(DECODERS)} are read, as '% evt 3.0' or '% format EVT3;...' in its header"
            " states them; Metavision converts others: metavision_file_to_hdf5,"
            " metavision_file_to_csv"
        )
    order = options.get("endianness", header.values.get("endianness", ""))
    if order == "big":
        raise DataError(f"{path}: {encoding} in big-endian words, must be little-endian")
    geometry = header.values.get("geometry", "").partition("x")
    header.tell(
        facts,
        (_size(options.get("width") or geometry[0]), _size(options.get("height") or geometry[2])),
    )
    begin = header.t0

    def parts() -> Iterator[Columns]:
        decoder = DECODERS[encoding](order)
        count = _READ // np.dtype(decoder.word).itemsize
        for words in blocks(path, header.size, decoder.word, count, facts):
            t, x, y, p = decoder.events_of(words)
            yield t + begin, x, y, p
        facts.problems += decoder.problems()

    return EventFile(encoding.lower(), facts, parts)


def _encoding(header: Header) -> tuple[str, dict[str, str]]:
    """Return the encoding that the header states: its name, and options."""
    name, *options = header.values.get("format", "").split(";")
    version = header.values.get("evt", "")
    pairs = (option.partition("=") for option in options)
    return (
        name.strip().upper() or _VERSIONS.get(version, version),
        {key.strip().lower(): value.strip() for key, _, value in pairs},
    )


def _size(text: str) -> int | None:
    return int(text) if text.isascii() and text.isdigit() and len(text) < 6 else None


class _Decoder:
    """Decodes block after block, and holds what the words before said.

    Parameters
    ----------
    order : str
        That of the halves of a word, as it is stated; of EVT 2.1 only: ``little``, or ``legacy``
        where the upper half comes first; else the first words tell it.

    Attributes
    ----------
    word : str
        Data type of a word.
    bits : int
        Of its clock, in microseconds.
    known : tuple of int
        Kinds of words.
    """

    word, bits = "<u4", 34
    known: tuple[int, ...] = _KINDS_2

    def __init__(self, order: str = "") -> None:
        self._order = order
        self._kinds = Kinds(*self.known)
        self._high = -1

    def events_of(self, words: NDArray[Any]) -> Columns:
        """Return the events of some words."""
        raise NotImplementedError

    def problems(self) -> list[str]:
        """Return the problems of all words until now."""
        return self._kinds.problems()


class Evt2Decoder(_Decoder):
    """Decodes EVT 2.0."""

    def __init__(self, order: str = "") -> None:
        super().__init__(order)
        self._counter = Counter(28)

    def events_of(self, words: NDArray[Any]) -> Columns:
        """Return the events of some words."""
        return self.placed(words)[1:]

    def placed(
        self, words: NDArray[Any]
    ) -> tuple[NDArray[np.int64], Column, Column, Column, Column]:
        """Return the place of each event among some words, and the events."""
        kind = (words >> 28).astype(np.uint8)
        is_high, is_event = kind == _HIGH, kind <= 1
        self._kinds.note(kind, is_high | is_event)
        highs = self._counter(words[is_high] & 0xFFF_FFFF)
        at = np.flatnonzero(is_event)
        held = last_before(highs, is_high, self._high, at)
        if self._high < 0 and held.size and held[0] < 0:
            known = held >= 0
            self._kinds.early += int(np.count_nonzero(~known))
            at, held = at[known], held[known]
        event = words[at]
        self._high = int(highs[-1]) if highs.size else self._high
        t = (held << _LOW_BITS) + (event >> 22 & 0x3F)
        return at, t, event >> 11 & 0x7FF, event & 0x7FF, kind[at]


class Evt21Decoder(Evt2Decoder):
    """Decodes EVT 2.1."""

    word = "(2,)<u4"

    def events_of(self, words: NDArray[Any]) -> Columns:
        """Return the events of some words, (n, 2)."""
        if self._order not in _UPPER:
            self._order = _likely_order(words)
        upper = _UPPER[self._order]
        at, t, x, y, p = self.placed(words[:, upper])
        masks = words[at, 1 - upper].astype("<u4").view(np.uint8).reshape(-1, 4)
        which, bit = np.nonzero(np.unpackbits(masks, axis=1, bitorder="little"))
        return t[which], x[which] + bit, y[which], p[which]


def _likely_order(words: NDArray[Any]) -> str:
    """Return the order in which more words of EVT 2.1 are events and times as these must be.

    Columns of events are multiples of 32, and the lower half of a HIGH is empty.
    """

    def fitting(order: str) -> int:
        half, other = words[:, _UPPER[order]], words[:, 1 - _UPPER[order]]
        kind = half >> 28
        is_event = (kind <= 1) & (half >> 11 & 0x1F == 0) & (other > 0)
        return int(np.count_nonzero(is_event | (kind == _HIGH) & (other == 0)))

    return max(_UPPER, key=fitting)


class Evt3Decoder(_Decoder):
    """Decodes EVT 3.0."""

    word, bits = "<u2", 24
    known = _KINDS_3

    def __init__(self, order: str = "") -> None:
        super().__init__(order)
        self._counter = Counter(12)
        self._t = self._row = -1
        self._base = _NOWHERE  # of the next vector, and ...
        self._polarity = 0

    def events_of(self, words: NDArray[np.uint16]) -> Columns:
        """Return the events of some words."""
        kind = (words >> 12).astype(np.uint8)
        self._kinds.note(kind, _USUAL[kind])
        content = words & 0xFFF
        at = np.flatnonzero(kind == _COLUMN)
        column = content[at]
        x, p = column & 0x7FF, column >> 11
        is_vector = (kind == _VECTOR_12) | (kind == _VECTOR_8)
        is_base = kind == _BASE
        if is_base.any() or is_vector.any():
            at_vectors, x_vectors, p_vectors = self._vectors(kind, content, is_base, is_vector)
            at = np.concatenate([at, at_vectors])
            order = np.argsort(at, kind="stable")
            at = at[order]
            x = np.concatenate([x, x_vectors])[order]
            p = np.concatenate([p, p_vectors])[order]
        t = self._times(kind, content, at)
        is_row = kind <= _OTHER_ROW
        rows = np.where(kind == _ROW, content & 0x7FF, -1)[is_row]
        y = last_before(rows, is_row, self._row, at)
        self._row = int(rows[-1]) if rows.size else self._row
        known = (t >= 0) & (y >= 0) & (x >= 0)
        if not known.all():
            self._kinds.early += int(np.count_nonzero(~known))
            t, x, y, p = t[known], x[known], y[known], p[known]
        return t, x, y, p

    def _times(self, kind: NDArray[np.uint8], content: NDArray[Any], at: Numbers) -> Numbers:
        """Return the time that holds at each of the words `at`."""
        is_time = (kind == _HIGH) | (kind == _LOW)
        value, is_high = content[is_time], kind[is_time] == _HIGH
        if not value.size:
            return np.full(at.size, self._t, np.int64)
        highs = np.concatenate([[self._high], self._counter(value[is_high])])
        high = highs[np.cumsum(is_high)]
        t = high << 12
        t[~is_high] += value[~is_high]
        # a HIGH that says what held already, as cameras repeat it, leaves the low bits as they are
        repeats = np.zeros(value.size, np.bool_)
        repeats[is_high] = highs[1:] == highs[:-1]
        if repeats.any():
            which = np.where(repeats, 0, np.arange(1, value.size + 1))
            t = np.concatenate([[self._t], t])[np.maximum.accumulate(which)]
        t[high < 0] = -1
        held = last_before(t, is_time, self._t, at)
        self._high, self._t = int(highs[-1]), int(t[-1])
        return held

    def _vectors(
        self,
        kind: NDArray[np.uint8],
        content: NDArray[Any],
        is_base: NDArray[np.bool_],
        is_vector: NDArray[np.bool_],
    ) -> tuple[Numbers, Numbers, Numbers]:
        """Return the word, column and polarity of each event in a vector."""
        moved = np.where(kind == _VECTOR_12, 12, 8) * is_vector
        moved = np.cumsum(moved) - moved  # by all vectors before
        at = np.flatnonzero(is_vector)
        bases = content[is_base].astype(np.int64)
        begin = last_before((bases & 0x7FF) - moved[is_base], is_base, self._base, at) + moved[at]
        polarity = last_before(bases >> 11, is_base, self._polarity, at)
        if bases.size:
            self._base = int(bases[-1] & 0x7FF) - int(moved[is_base][-1])
            self._polarity = int(bases[-1] >> 11)
        self._base += int(moved[-1]) + int(is_vector[-1]) * (12 if kind[-1] == _VECTOR_12 else 8)
        bits = np.where(kind[at] == _VECTOR_12, content[at], content[at] & 0xFF).astype("<u2")
        row, bit = np.nonzero(
            np.unpackbits(bits.view(np.uint8).reshape(-1, 2), axis=1, bitorder="little")
        )
        return at[row], begin[row] + bit, polarity[row]


DECODERS: dict[str, type[_Decoder]] = {
    "EVT2": Evt2Decoder,
    "EVT21": Evt21Decoder,
    "EVT3": Evt3Decoder,
}
"""Decoders by the name of the encoding."""


class Evt2Writer(Writer):
    """Writes EVT 2.0; see :class:`Writer`."""

    def __init__(self, request: Request, stack: ExitStack, path: Path) -> None:
        self._file = stack.enter_context(path.open("wb"))
        self._file.write(raw_header(request, "2.0"))
        self._file.write(np.array([_HIGH << 28], "<u4").data)
        self._high = 0

    def write_events(self, events: Events) -> None:
        """Append events."""
        for begin in range(0, events.size, _WRITTEN):
            part = events[begin : begin + _WRITTEN]
            t = np.ascontiguousarray(part["t"])
            words = part["p"].astype("<u4")
            for bits, value in (
                (_LOW_BITS, (t & 0x3F).astype("<u4")),
                (_ADDRESS_BITS, part["x"]),
                (_ADDRESS_BITS, part["y"]),
            ):
                words <<= bits
                words |= value
            high = t >> _LOW_BITS
            new = np.flatnonzero(np.diff(high, prepend=self._high))
            self._high = int(high[-1])
            self._file.write(np.insert(words, new, (high[new] | _HIGH << 28).astype("<u4")).data)


class Evt3Writer(Writer):
    """Writes EVT 3.0, encoded in threads; see :class:`Writer`."""

    def __init__(self, request: Request, stack: ExitStack, path: Path) -> None:
        self._file = stack.enter_context(path.open("wb"))
        self._file.write(raw_header(request, "3.0"))
        self._work = OrderedWork(request.threads - 1)
        stack.callback(self._work.abandon)
        self._state = -1, -1, -1  # high and low bits of the time, row

    def write_events(self, events: Events) -> None:
        """Append events."""
        for begin in range(0, events.size, _WRITTEN):
            part = events[begin : begin + _WRITTEN]
            far = np.flatnonzero(np.diff(part["t"] >> 12) > _WRITTEN) + 1
            for piece in np.split(part, far):
                self._pass_time(int(piece["t"][0] >> 12))
                self._work.submit(_evt3_words, piece, self._state, take=self._file.write)
                t = int(piece["t"][-1])
                self._state = t >> 12, t & 0xFFF, int(piece["y"][-1])

    def finish(self) -> None:
        """Write the remaining events, or the time at which nothing happened if there are none."""
        self._pass_time(0)
        self._work.finish()

    def _pass_time(self, high: int) -> None:
        """Write the high bits of all times up to one."""
        while self._state[0] < high:
            begin, end = self._state[0] + 1, min(self._state[0] + _WRITTEN, high)
            self._work.submit(_evt3_highs, begin, end, take=self._file.write)
            self._state = end, -1, self._state[2]


def _evt3_highs(begin: int, end: int) -> memoryview:
    """Return the words of the high bits of the times from `begin` to `end`."""
    return (np.arange(begin, end + 1) & 0xFFF | _HIGH << 12).astype("<u2").data


def _evt3_words(events: Events, state: tuple[int, int, int]) -> memoryview:
    """Return the words of events, after those that left high and low bits and row as in `state`."""
    high, low, row = events["t"] >> 12, (events["t"] & 0xFFF).astype(np.int32), events["y"]
    passed = np.diff(high, prepend=state[0])
    new_low = np.empty(events.size, np.bool_)
    new_low[0] = low[0] != state[1]
    new_low[1:] = (low[1:] != low[:-1]) | (passed[1:] > 0)
    new_row = np.empty(events.size, np.bool_)
    new_row[0] = row[0] != state[2]
    np.not_equal(row[1:], row[:-1], out=new_row[1:])

    place = np.cumsum(passed + new_low + new_row + 1) - 1  # of each event's last word
    words = np.empty(int(place[-1]) + 1, "<u2")
    words[place] = _COLUMN << 12 | events["p"].astype(np.uint16) << 11 | events["x"]
    words[place[new_row] - 1] = _ROW << 12 | row[new_row]
    words[(place - new_row)[new_low] - 1] = _LOW << 12 | low[new_low]
    steps = np.flatnonzero(passed)
    count = passed[steps]
    # the last HIGH before an event stands before its LOW, which a new HIGH always has
    last = (place - new_row)[steps] - 2
    back = np.repeat(np.cumsum(count), count) - 1 - np.arange(int(count.sum()))
    highs = np.repeat(high[steps], count) - back
    words[np.repeat(last, count) - back] = _HIGH << 12 | highs & 0xFFF
    return words.data


# ---- Events of the data sets N-MNIST and N-Caltech101, in files that end on ``.bin``.
#
# A file has no header. Each event has five bytes:
#
# ====== ==================================================
# byte   content
# ====== ==================================================
# 0, 1   column, row
# 2      bit 7: polarity, 1 is ON; the rest: time, high bits
# 3, 4   time [us], big endian; 23 bits in all
# ====== ==================================================
#
# A row of 240, which no sensor of these data sets has, is no event: times from there on are 8192
# us later. Pictures of N-MNIST have 34x34 pixels, others what their events need.
#
# References
# ----------
# .. [1] G. Orchard et al., "Converting Static Image Datasets to Spiking Neuromorphic Datasets Using
#    Saccades", Frontiers in Neuroscience 2015, doi:10.3389/fnins.2015.00437.


_LATER, _LATER_US = 240, 1 << 13
_SIDE = 34  # pixels of N-MNIST
_EVENTS_READ = 1 << 18  # events
_MOST_BACK = 0.1
"""Share of times before the last one from which on a file is something else."""


def open_nmnist(path: Path, facts: Facts) -> EventFile:
    """Open a file of these data sets; DataError if its times show that it is none."""

    def parts(told: Facts | None = facts) -> Iterator[Columns]:
        later = 0
        for data in blocks(path, 0, "(5,)u1", _EVENTS_READ, told):
            x, y, high, middle, low = data.astype(np.int64).T
            is_later = y == _LATER
            turns = later + np.cumsum(is_later)
            later = int(turns[-1])
            t = ((high & 0x7F) << 16 | middle << 8 | low) + turns * _LATER_US
            yield tuple(column[~is_later] for column in (t, x, y, high >> 7))

    size = count = back = beyond = 0
    for t, x, y, _ in parts(None):
        count += t.size
        back += int(np.count_nonzero(np.diff(t) < 0))
        beyond += int(np.count_nonzero(y > _LATER))
        size = max(size, int(np.max([x, y], initial=-1)) + 1)
    if beyond or back > _MOST_BACK * count:
        raise DataError(
            f"{path}: no file of N-MNIST or N-Caltech101, which alone are read of this suffix: of"
            f" {count} events {beyond} are in rows from {_LATER} on, and {back} times go back"
        )
    if size <= _SIDE:
        facts.state((_SIDE, _SIDE), "N-MNIST")
    facts.stated_unit = "us"
    return EventFile("nmnist", facts, parts)


class NmnistWriter(Writer):
    """Writes a file of N-MNIST; see :class:`Writer`."""

    def __init__(self, request: Request, stack: ExitStack, path: Path) -> None:
        self._file = stack.enter_context(path.open("wb"))

    def write_events(self, events: Events) -> None:
        """Append events."""
        data = np.empty((events.size, 5), np.uint8)
        t = events["t"]
        columns = events["x"], events["y"], events["p"] << 7 | t >> 16, t >> 8 & 0xFF, t & 0xFF
        for number, column in enumerate(columns):
            data[:, number] = column
        self._file.write(data.data)
