"""Events in EVT 2.0 and 2.1, formats of Prophesee's cameras, in files that end on ``.raw``.

A header of lines (:mod:`adv2e.formats.percent_header`) is followed by words of 32 bits, little
endian:

======= =========== ======================================== ==========================
kind    bits 28-31  bits 0-27
======= =========== ======================================== ==========================
OFF, ON 0x0, 0x1    22-27: time, low bits; 11-21: column;    an event
                    0-10: row
HIGH    0x8         time, from bit 6 on                      holds until the next one
others  0xA, E, F   triggers and what vendors add            left out
======= =========== ======================================== ==========================

EVT 2.1 has words of 64 bits.  Their upper half is a word of EVT 2.0, whose column is a multiple of
32; the lower half has a bit for each of 32 columns from there on, set for an event.  In the order
``legacy``, that of the IMX636, the upper half comes first.  It is read, and not written.

Times have 34 bits [us], some 4.7 hours; then they begin again at zero, which is counted on reading.
A file that is written begins with time 0, because Metavision takes the first time off all others.
faery writes times from the first event on, and that as ``% t0`` in the header, which is added here.

References
----------
.. [1] Prophesee, "EVT 2.0 Format", https://docs.prophesee.ai/stable/data/encoding_formats/evt2.html;
   "EVT 2.1 Format", https://docs.prophesee.ai/stable/data/encoding_formats/evt21.html.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.events import Events
from adv2e.formats.event_file import Column, Columns, EventFile, Facts
from adv2e.formats.percent_header import Header, raw_header
from adv2e.formats.sink import Request, Writer
from adv2e.formats.words import Counter, Kinds, blocks, last_before

_HIGH = 0x8
_KINDS = (0x0, 0x1, _HIGH, 0xA, 0xE, 0xF)
_LOW_BITS = 6
_ADDRESS_BITS = 11
_BLOCK = 1 << 16  # words, or events to be written


def evt2_of(header: Header, facts: Facts, options: Mapping[str, str]) -> EventFile:
    """Return the events of a file whose header was read."""
    return _events(header, facts, "evt2", Evt2Decoder)


def evt21_of(header: Header, facts: Facts, options: Mapping[str, str]) -> EventFile:
    """Return the events of a file whose header was read, with the order of its words in it."""
    order = options.get("endianness", header.values.get("endianness", ""))
    return _events(header, facts, "evt21", partial(Evt21Decoder, order))


def _events(
    header: Header, facts: Facts, name: str, made: Callable[[], Evt2Decoder | Evt21Decoder]
) -> EventFile:
    begin = header.t0

    def parts() -> Iterator[Columns]:
        decoder = made()
        for words in blocks(header.path, header.size, decoder.word, _BLOCK, facts):
            t, x, y, p = decoder.events_of(words)
            yield t + begin, x, y, p
        facts.problems += decoder.problems()

    return EventFile(name, facts, parts)


class Evt2Decoder:
    """Decodes block after block, and holds what the words before said."""

    word, bits = "<u4", 34

    def __init__(self) -> None:
        self._counter, self._kinds = Counter(28), Kinds(*_KINDS)
        self._high = -1  # of the words before

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

    def problems(self) -> list[str]:
        """Return what is to be told of all words until now."""
        return self._kinds.problems()


class Evt21Decoder:
    """Decodes EVT 2.1; see :class:`Evt2Decoder`.

    Parameters
    ----------
    order : str
        ``little``, or ``legacy`` where the upper half of a word comes first; else the first words
        tell it.
    """

    word, bits = "(2,)<u4", 34

    def __init__(self, order: str = "") -> None:
        self._upper = {"little": 1, "legacy": 0}.get(order)
        self._evt2 = Evt2Decoder()

    def events_of(self, words: NDArray[Any]) -> Columns:
        """Return the events of some words, (n, 2)."""
        if self._upper is None:
            self._upper = _upper_half(words)
        at, t, x, y, p = self._evt2.placed(words[:, self._upper])
        masks = words[at, 1 - self._upper].astype("<u4").view(np.uint8).reshape(-1, 4)
        which, bit = np.nonzero(np.unpackbits(masks, axis=1, bitorder="little"))
        return t[which], x[which] + bit, y[which], p[which]

    def problems(self) -> list[str]:
        """Return what is to be told of all words until now."""
        return self._evt2.problems()


def _upper_half(words: NDArray[Any]) -> int:
    """Return which half of words in EVT 2.1 has their kind, by the kinds that there are.

    Columns of events are multiples of 32, and the lower half of a HIGH is empty.
    """
    fits = []
    for upper in (0, 1):
        half, other = words[:, upper], words[:, 1 - upper]
        kind = half >> 28
        is_event = (kind <= 1) & (half >> 11 & 0x1F == 0) & (other > 0)
        fits.append(int(np.count_nonzero(is_event | (kind == _HIGH) & (other == 0))))
    return int(fits[1] >= fits[0])


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
        for begin in range(0, events.size, _BLOCK):
            part = events[begin : begin + _BLOCK]
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
