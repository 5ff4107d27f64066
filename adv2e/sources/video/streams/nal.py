"""Units of H.264 and HEVC: how they are told apart, and what the two codecs write alike.

References
----------
.. [1] ITU-T H.264 (08/2021) and H.265 (08/2021): annex B (byte stream), D (supplemental
   enhancement information), E (video usability information).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise

from adv2e.sources.video.colours import Colours, is_stated
from adv2e.sources.video.streams.base import Bits, Stream

_START = b"\0\0\1"
_ANY_ASPECT = 255
_OTHER_TRANSFER = 147


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

    def hear(self, kind: int, content: bytes) -> None:
        """Take what a message says."""
        if kind == _OTHER_TRANSFER and content:
            self.other_transfer = content[0]

    def tell(self, stream: Stream) -> None:
        """Note the colours that count."""
        if is_stated(self.other_transfer):
            stream.state(replace(self.usual or Colours(), transfer=self.other_transfer))
        elif self.usual is not None:
            stream.state(self.usual)


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
