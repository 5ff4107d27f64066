"""FFV1: whether a picture is two fields.

The headers go through the range coder that the pictures go through.

References
----------
.. [1] RFC 9043 (FFV1): 3.8.1 (range coding), 4.3 (configuration record), 4.5 (frame), 4.6 (slice
   header).
"""

from __future__ import annotations

from adv2e.sources.video.streams.base import Findings

_CUSTOM_TABLE = 2
_TOP_FIELD_FIRST, _BOTTOM_FIELD_FIRST = 1, 2
_CONTEXTS = 32


def _usual_transitions() -> list[int]:
    """Return the state after a one, for each state; RFC 9043 prints the table."""
    one = 1 << 32
    factor = one // 20
    after = [0] * 256
    last, share = 0, one // 2
    for _ in range(128):
        state = max((256 * share + one // 2) >> 32, last + 1)
        if last and last < 256 and state <= 248:
            after[last] = state
        share += ((one - share) * factor + one // 2) >> 32
        last = state
    for state in range(8, 249):
        if after[state]:
            continue
        share = (state * one + 128) >> 8
        share += ((one - share) * factor + one // 2) >> 32
        after[state] = min(max((256 * share + one // 2) >> 32, state + 1), 248)
    return after


_USUAL = _usual_transitions()


class _RangeDecoder:
    def __init__(self, data: bytes, after_one: list[int]) -> None:
        self._data, self.after_one = data, after_one
        self._low, self._range, self._place = int.from_bytes(data[:2], "big"), 0xFF00, 2

    def bit(self, states: list[int], number: int) -> bool:
        state = states[number]
        part = self._range * state >> 8
        self._range -= part
        if self._low < self._range:
            one, states[number] = False, (256 - self.after_one[256 - state]) & 0xFF
        else:
            self._low -= self._range
            self._range = part
            one, states[number] = True, self.after_one[state]
        while self._range < 0x100:
            self._range <<= 8
            byte = self._data[self._place] if self._place < len(self._data) else 0
            self._low = (self._low << 8) + byte
            self._place += 1
        return one

    def number(self, states: list[int], signed: bool = False) -> int:
        if self.bit(states, 0):
            return 0
        size = 0
        while self.bit(states, 1 + min(size, 9)):
            size += 1
            if size > 31:
                raise IndexError("no number")
        value = 1
        for place in range(size - 1, -1, -1):
            value = 2 * value + self.bit(states, 22 + min(place, 9))
        return -value if signed and self.bit(states, 11 + min(size, 10)) else value


class Ffv1:
    """Parser of FFV1."""

    def __init__(self) -> None:
        self._version = 0
        self._tables = 0
        self._after_one = _USUAL

    def header(self, data: bytes, findings: Findings) -> None:
        """Read the configuration record, which versions before 3 have not."""
        if not data:
            return
        decoder = _RangeDecoder(data, _USUAL)
        states = [128] * _CONTEXTS
        self._version = decoder.number(states)
        if self._version < 3:
            return
        decoder.number(states)
        if decoder.number(states) == _CUSTOM_TABLE:
            self._after_one = [0] + [
                (_USUAL[state] + decoder.number(states, signed=True)) & 0xFF
                for state in range(1, 256)
            ]
        decoder.number(states)
        decoder.number(states)
        chroma = decoder.bit(states, 0)
        decoder.number(states)
        decoder.number(states)
        alpha = decoder.bit(states, 0)
        self._tables = 1 + (chroma or self._version < 4) + alpha

    def picture(self, data: bytes, findings: Findings) -> None:
        """Read the header of the first slice."""
        if self._version < 3:
            return
        decoder = _RangeDecoder(data, _USUAL)
        decoder.bit([128], 0)
        decoder.after_one = self._after_one
        states = [128] * _CONTEXTS
        for _ in range(4 + self._tables):
            decoder.number(states)
        structure = decoder.number(states)
        findings.interlaced |= structure in (_TOP_FIELD_FIRST, _BOTTOM_FIELD_FIRST)
