"""H.264: parameter sets and the supplemental information before pictures.

References
----------
.. [1] ITU-T H.264 (08/2021): 7.3.2.1.1 (sequence parameter set), D.1 (supplemental enhancement
   information), E.1 (video usability information).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise

from adv2e.sources.colours import Colours, is_stated
from adv2e.sources.streams.base import Findings
from adv2e.sources.streams.bits import Bits

_START = b"\0\0\1"
_CHROMA_PROFILES = (100, 110, 122, 244, 44, 83, 86, 118, 128, 138, 139, 134, 135)
_SLICES, _SEI, _SPS = (1, 2, 5), 6, 7
_PICTURE_TIMING, _OTHER_TRANSFER = 1, 147
_ANY_ASPECT = 255
_ONE_FIELD, _LAST_OF_ONE_FRAME = (1, 2), 4


def units(data: bytes) -> Iterator[bytes]:
    """Yield the units between start codes, the bytes that guard against these still in them."""
    after = data.find(_START)
    while after >= 0:
        begin = after + len(_START)
        after = data.find(_START, begin)
        unit = data[begin : after if after >= 0 else len(data)]
        if unit:
            yield unit


def units_of_picture(data: bytes) -> Iterator[bytes]:
    """Yield the units of H.264 or HEVC, between start codes or each after its length.

    Copied from MP4 into another container they may keep lengths, which can look like start codes.
    """
    places = [0]
    while places[-1] < len(data):
        size = int.from_bytes(data[places[-1] : places[-1] + 4], "big")
        if not size or places[-1] + 4 + size > len(data):
            yield from units(data)
            return
        places.append(places[-1] + 4 + size)
    for begin, end in pairwise(places):
        yield data[begin + 4 : end]


def unguarded(unit: bytes) -> bytes:
    """Return a unit without the bytes that guard against start codes."""
    return unit.replace(b"\0\0\3", b"\0\0")


def messages(data: bytes) -> Iterator[tuple[int, bytes]]:
    """Yield kind and contents of supplemental enhancement information."""
    place = 0
    while place + 2 < len(data):  # the last byte only ends the unit
        numbers = []
        for _ in range(2):
            number = 0
            while data[place] == 0xFF:
                number, place = number + 255, place + 1
            numbers.append(number + data[place])
            place += 1
        kind, size = numbers
        yield kind, data[place : place + size]
        place += size


@dataclass
class StatedColours:
    """Colours of the parameter set, and the transfer that takes the place of its own.

    Broadcasts so state HLG, that receivers that do not know it may take it for BT.2020.
    """

    usual: Colours | None = None
    other_transfer: int = 0

    def tell(self, findings: Findings) -> None:
        """Note the colours that count."""
        if is_stated(self.other_transfer):
            findings.state(replace(self.usual or Colours(), transfer=self.other_transfer))
        elif self.usual is not None:
            findings.state(self.usual)


@dataclass
class _Timing:
    """Where a message about the timing of a picture has what."""

    skipped_bits: int = 0
    structure: bool = False


def signal(bits: Bits) -> Colours | None:
    """Read the part of the usability information that H.264 and HEVC share; None: no colours."""
    if bits.flag() and bits.take(8) == _ANY_ASPECT:
        bits.skip(32)
    if bits.flag():  # overscan
        bits.skip(1)
    colours = None
    if bits.flag():
        bits.skip(4)
        if bits.flag():
            colours = Colours(bits.take(8), bits.take(8), bits.take(8))
    if bits.flag():  # place of the chroma samples
        bits.ue()
        bits.ue()
    return colours


class H264:
    """Parser of H.264 with start codes."""

    def __init__(self) -> None:
        self._timing = _Timing()
        self._colours = StatedColours()

    def header(self, data: bytes, findings: Findings) -> None:
        """Nothing: OpenCV repeats in the pictures what stands there."""

    def picture(self, data: bytes, findings: Findings) -> None:
        """Read parameter sets and messages up to the first slice."""
        for unit in units_of_picture(data):
            kind = unit[0] & 31
            if kind == _SPS:
                self._parameters(Bits(unguarded(unit)[1:]), findings)
            elif kind == _SEI:
                self._messages(unguarded(unit)[1:], findings)
            elif kind in _SLICES:
                break
        self._colours.tell(findings)

    def _parameters(self, bits: Bits, findings: Findings) -> None:
        profile = bits.take(8)
        bits.skip(16)
        bits.ue()
        if profile in _CHROMA_PROFILES:
            _skip_chroma(bits)
        bits.ue()
        order = bits.ue()
        if order == 0:
            bits.ue()
        elif order == 1:
            bits.skip(1)
            for _ in range(2):
                bits.se()
            for _ in range(bits.ue()):
                bits.se()
        bits.ue()
        bits.skip(1)
        bits.ue()
        bits.ue()
        if not bits.flag():  # not frames alone
            # which pictures are fields, their slices say: some or all, or none
            findings.interlaced = True
            return
        bits.skip(1)
        if bits.flag():
            for _ in range(4):
                bits.ue()
        self._timing = _Timing()
        if bits.flag():
            self._usability(bits, findings)

    def _usability(self, bits: Bits, findings: Findings) -> None:
        self._colours.usual = signal(bits)
        if bits.flag():
            bits.skip(65)
        delays = 0
        schedules = 0
        for _ in range(2):
            if bits.flag():
                delays, schedules = _delays(bits), schedules + 1
        if schedules:
            bits.skip(1)
        self._timing = _Timing(delays, bits.flag())

    def _messages(self, data: bytes, findings: Findings) -> None:
        for kind, content in messages(data):
            if kind == _OTHER_TRANSFER and content:
                self._colours.other_transfer = content[0]
            elif kind == _PICTURE_TIMING and self._timing.structure:
                bits = Bits(content)
                bits.skip(self._timing.skipped_bits)
                structure = bits.take(4)
                scan = bits.take(2) if structure <= _LAST_OF_ONE_FRAME and bits.flag() else 0
                findings.interlaced |= structure in _ONE_FIELD or scan == 1


def _skip_chroma(bits: Bits) -> None:
    chroma = bits.ue()
    if chroma == 3:
        bits.skip(1)
    bits.ue()
    bits.ue()
    bits.skip(1)
    if bits.flag():
        for number in range(12 if chroma == 3 else 8):
            if bits.flag():
                _skip_scaling(bits, 16 if number < 6 else 64)


def _skip_scaling(bits: Bits, size: int) -> None:
    last = 8
    for _ in range(size):
        last = (last + bits.se()) % 256
        if last == 0:
            return


def _delays(bits: Bits) -> int:
    """Read a schedule of buffers; return the bits before the structure in a timing message."""
    count = bits.ue() + 1
    bits.skip(8)
    for _ in range(count):
        bits.ue()
        bits.ue()
        bits.skip(1)
    bits.skip(5)
    delays = bits.take(5) + bits.take(5) + 2
    bits.skip(5)
    return delays
