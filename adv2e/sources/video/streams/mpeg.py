"""MPEG-2, MPEG-4 part 2 and Motion JPEG: the headers before pictures.

References
----------
.. [1] ITU-T H.262 (02/2012): 6.2.2.3 (sequence extension), 6.2.2.4 (sequence display extension),
   6.2.3.1 (picture coding extension).
.. [2] ISO/IEC 14496-2:2004: 6.2.2 (visual object), 6.2.3 (video object layer).
.. [3] ITU-T T.81 (JPEG), B.2.2 (frame header).
"""

from __future__ import annotations

import struct

from adv2e.sources.video.colours import Colours
from adv2e.sources.video.streams.base import Bits, Parser, Stream
from adv2e.sources.video.streams.nal import units

_SLICES, _EXTENSION = range(0x01, 0xB0), 0xB5
_SEQUENCE, _DISPLAY, _CODING = 1, 2, 8
_WHOLE_FRAME = 3

_LAYERS, _VISUAL_OBJECT, _PICTURE = range(0x20, 0x30), 0xB5, 0xB6
_ANY_ASPECT = 15


class Mpeg2(Parser):
    """Parser of MPEG-2."""

    def __init__(self) -> None:
        self._progressive = True

    def header(self, data: bytes, stream: Stream) -> None:
        """Read what MP4 and Matroska keep apart."""
        self.picture(data, stream)

    def picture(self, data: bytes, stream: Stream) -> None:
        """Read extensions up to the first slice of each picture."""
        for unit in units(data):
            if unit[0] in _SLICES:
                return
            if unit[0] != _EXTENSION:
                continue
            bits = Bits(unit[1:])
            kind = bits.take(4)
            if kind == _SEQUENCE:
                bits.skip(8)
                self._progressive = bits.flag()
            elif kind == _DISPLAY:
                bits.skip(3)
                if bits.flag():
                    stream.state(Colours(bits.take(8), bits.take(8), bits.take(8)))
            elif kind == _CODING and not self._progressive:
                bits.skip(18)
                structure = bits.take(2)
                bits.skip(8)
                stream.interlaced |= structure != _WHOLE_FRAME or not bits.flag()


class Mpeg4(Parser):
    """Parser of MPEG-4 part 2."""

    def header(self, data: bytes, stream: Stream) -> None:
        """Read what stands before all pictures."""
        self.picture(data, stream)

    def picture(self, data: bytes, stream: Stream) -> None:
        """Read headers up to the picture."""
        for unit in units(data):
            if unit[0] == _PICTURE:
                return
            if unit[0] == _VISUAL_OBJECT:
                _read_object(Bits(unit[1:]), stream)
            elif unit[0] in _LAYERS:
                _read_layer(Bits(unit[1:]), stream)


def _read_object(bits: Bits, stream: Stream) -> None:
    if bits.flag():
        bits.skip(7)
    if bits.take(4) != 1 or not bits.flag():
        return
    bits.skip(4)
    if bits.flag():
        stream.state(Colours(bits.take(8), bits.take(8), bits.take(8)))


def _read_layer(bits: Bits, stream: Stream) -> None:
    bits.skip(9)
    version = 1
    if bits.flag():
        version = bits.take(4)
        bits.skip(3)
    if bits.take(4) == _ANY_ASPECT:
        bits.skip(16)
    if bits.flag():
        bits.skip(3)
        if bits.flag():
            bits.skip(79)
    shape = bits.take(2)
    if shape == 3 and version != 1:
        bits.skip(4)
    bits.skip(1)
    ticks = bits.take(16)
    bits.skip(1)
    if bits.flag():
        bits.skip(max((ticks - 1).bit_length(), 1))
    if shape == 0:
        bits.skip(29)
    stream.interlaced |= bits.flag()


_BASELINE, _PROGRESSIVE, _SCAN = 0xC0, 0xC2, 0xDA


class MotionJpeg(Parser):
    """Parser of Motion JPEG: a picture of fewer rows than the container states is a field."""

    def __init__(self, height: int) -> None:
        self._height = height

    def picture(self, data: bytes, stream: Stream) -> None:
        """Read the size of a picture."""
        place = 2
        while data[place] == 0xFF and data[place + 1] != _SCAN:
            marker, size = struct.unpack_from(">xBH", data, place)
            if _BASELINE <= marker <= _PROGRESSIVE:
                (rows,) = struct.unpack_from(">H", data, place + 5)
                stream.interlaced |= 4 * rows < 3 * self._height
                return
            place += 2 + size
