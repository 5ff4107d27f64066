"""Events in EVT 2.0, a format of Prophesee's cameras, in files that end on ``.raw``.

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

Times have 34 bits [us], some 4.7 hours; then they begin again at zero, which is counted on reading.
A file that is written begins with time 0, because Metavision takes the first time off all others.
faery writes times from the first event on, and that as ``% t0`` in the header, which is added here.

References
----------
.. [1] Prophesee, "EVT 2.0 Format", https://docs.prophesee.ai/stable/data/encoding_formats/evt2.html.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import numpy as np

from adv2e.events import Events
from adv2e.formats.event_file import Columns, EventFile, Facts
from adv2e.formats.percent_header import Header, raw_header
from adv2e.formats.sink import Request, Writer
from adv2e.formats.words import Counter, Kinds, blocks, last_before

_HIGH = 0x8
_KINDS = (0x0, 0x1, _HIGH, 0xA, 0xE, 0xF)
_LOW_BITS = 6
_ADDRESS_BITS = 11
_BLOCK = 1 << 16  # words, or events to be written


def evt2_of(header: Header, facts: Facts) -> EventFile:
    """Return the events of a file whose header was read."""
    begin = header.whole("t0") or 0

    def parts() -> Iterator[Columns]:
        counter, kinds = Counter(28), Kinds(*_KINDS)
        high = -1  # of the words before
        for words in blocks(header.path, header.size, "<u4", _BLOCK, facts):
            kind = (words >> 28).astype(np.uint8)
            is_high, is_event = kind == _HIGH, kind <= 1
            kinds.note(kind, is_high | is_event)
            highs = counter(words[is_high] & 0xFFF_FFFF)
            at = np.flatnonzero(is_event)
            held = last_before(highs, is_high, high, at)
            if high < 0 and held.size and held[0] < 0:
                known = held >= 0
                kinds.early += int(np.count_nonzero(~known))
                at, held = at[known], held[known]
            event = words[at]
            t = (held << _LOW_BITS) + (event >> 22 & 0x3F) + begin
            yield t, event >> 11 & 0x7FF, event & 0x7FF, kind[at]
            high = int(highs[-1]) if highs.size else high
        facts.problems += kinds.problems()

    return EventFile("evt2", facts, parts)


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
