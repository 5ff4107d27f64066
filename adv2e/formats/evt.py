"""Events in EVT 2.0, 2.1 and 3.0, formats of Prophesee's cameras, in files that end on ``.raw``.

A header of lines (:mod:`adv2e.formats.percent_header`) says which it is.  Words follow, little
endian.  In EVT 2.0 they have 32 bits:

======= =========== ======================================== ==========================
kind    bits 28-31  bits 0-27
======= =========== ======================================== ==========================
OFF, ON 0x0, 0x1    22-27: time, low bits; 11-21: column;    an event
                    0-10: row
HIGH    0x8         time, from bit 6 on                      holds until the next one
others  0xA, E, F   triggers and what vendors add            left out
======= =========== ======================================== ==========================

Times have 34 bits [us], some 4.7 hours; then they begin again at zero, which is counted on reading.
A file that is written begins with time 0, because Metavision takes the first time off all others.
faery writes times from the first event on, and that as ``% t0`` in the header, which is added here.

EVT 2.1 has words of 64 bits.  Their upper half is a word of EVT 2.0, whose column is a multiple of
32; the lower half has a bit for each of 32 columns from there on, set for an event.  In the order
``legacy``, that of the IMX636, the upper half comes first.  It is read, and not written.

In EVT 3.0 words have 16 bits.  What a word says holds until another one of its kind:

========= =========== ===================================================
kind      bits 12-15  bits 0-11
========= =========== ===================================================
ROW       0x0         0-10: row
COLUMN    0x2         0-10: column; 11: polarity: an event
BASE      0x3         0-10: column, from which vectors count; 11: polarity
VECTOR    0x4, 0x5    12, or 8, columns: an event where a bit is set;
                      the base moves on by as many
LOW       0x6         time, low bits
HIGH      0x8         time, high bits; if they change, the low ones are 0
others    0x7, A, E,  triggers and what vendors add, left out
          0xF
========= =========== ===================================================

Times have 24 bits [us], so they begin again at zero every 16.8 s, which is counted on reading.  So
that every reader can count it, each HIGH is written, one every 4.096 ms, also where there is no
event, from time 0 on; up to 19 hours, which are 34 MB of such words.  Vectors are not written.
Rows of kind 0x1 are those of another type of event, which is left out.

References
----------
.. [1] Prophesee, "EVT 2.0 Format", https://docs.prophesee.ai/stable/data/encoding_formats/evt2.html;
   "EVT 2.1 Format", .../evt21.html; "EVT 3.0 Format", .../evt3.html.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.errors import DataError
from adv2e.events import Events
from adv2e.formats.event_file import Column, Columns, EventFile, Facts
from adv2e.formats.percent_header import Header, raw_header, read_header
from adv2e.formats.sink import Request, Writer
from adv2e.formats.words import Counter, Kinds, Numbers, blocks, last_before

_ROW, _OTHER_ROW, _COLUMN, _BASE, _VECTOR_12, _VECTOR_8, _LOW, _HIGH = 0, 1, 2, 3, 4, 5, 6, 8
_KINDS_3 = (_ROW, _COLUMN, _BASE, _VECTOR_12, _VECTOR_8, _LOW, 0x7, _HIGH, 0xA, 0xE, 0xF)
_USUAL = np.isin(np.arange(16), (_ROW, _COLUMN, _BASE, _VECTOR_12, _VECTOR_8, _LOW, _HIGH))
_NOWHERE = -(1 << 40)
_KINDS_2 = (0x0, 0x1, _HIGH, 0xA, 0xE, 0xF)
_LOW_BITS, _ADDRESS_BITS = 6, 11  # of words of EVT 2.0
_UPPER = {"little": 1, "legacy": 0}  # place of the upper half of a word
_READ = 1 << 19  # bytes
_WRITTEN = 1 << 16, 1 << 18  # events written at once, in EVT 2.0 and EVT 3.0
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
        (
            _size(options.get("width") or geometry[0]),
            _size(options.get("height") or geometry[2]),
        ),
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

    def __init__(self, request: Request, stack: ExitStack, *temporary: Path) -> None:
        (path,) = temporary
        self._file = stack.enter_context(path.open("wb"))
        self._file.write(raw_header(request, "2.0"))
        self._file.write(np.array([_HIGH << 28], "<u4").data)
        self._high = 0

    def write_events(self, events: Events) -> None:
        """Append events."""
        for begin in range(0, events.size, _WRITTEN[0]):
            part = events[begin : begin + _WRITTEN[0]]
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
    """Writes EVT 3.0; see :class:`Writer`."""

    def __init__(self, request: Request, stack: ExitStack, *temporary: Path) -> None:
        (path,) = temporary
        self._file = stack.enter_context(path.open("wb"))
        self._file.write(raw_header(request, "3.0"))
        self._high = self._low = self._row = -1

    def write_events(self, events: Events) -> None:
        """Append events."""
        for begin in range(0, events.size, _WRITTEN[1]):
            part = events[begin : begin + _WRITTEN[1]]
            far = np.flatnonzero(np.diff(part["t"] >> 12) > _WRITTEN[1]) + 1
            for piece in np.split(part, far):
                self._pass_time(int(piece["t"][0] >> 12))
                self._write(piece)

    def finish(self) -> None:
        """Write the time at which nothing happened, where there was no event."""
        self._pass_time(0)

    def _pass_time(self, high: int) -> None:
        """Write the high bits of all times up to one."""
        while self._high < high:
            highs = np.arange(self._high + 1, min(self._high + _WRITTEN[1], high) + 1)
            self._file.write((highs & 0xFFF | _HIGH << 12).astype("<u2").data)
            self._high, self._low = int(highs[-1]), -1

    def _write(self, events: Events) -> None:
        """Append events; the time before the first of them has passed."""
        high, low, row = events["t"] >> 12, (events["t"] & 0xFFF).astype(np.int32), events["y"]
        passed = np.diff(high, prepend=self._high)
        new_low = np.empty(events.size, np.bool_)
        new_low[0] = low[0] != self._low
        new_low[1:] = (low[1:] != low[:-1]) | (passed[1:] > 0)
        new_row = np.empty(events.size, np.bool_)
        new_row[0] = row[0] != self._row
        np.not_equal(row[1:], row[:-1], out=new_row[1:])
        self._high, self._low, self._row = int(high[-1]), int(low[-1]), int(row[-1])

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
        self._file.write(words.data)
