"""Codecs whose every picture stands by itself, with a header of its own.

References
----------
.. [1] SMPTE RDD 36:2015 (Apple ProRes), 5.1 (frame header).
.. [2] SMPTE ST 2019-1 (VC-3, DNxHD), coding parameters.
.. [3] ITU-T T.81 (JPEG), B.2.2 (frame header).
"""

from __future__ import annotations

import struct

from adv2e.sources.video.colours import Colours
from adv2e.sources.video.streams.base import Findings

_PRORES = b"icpf"
_BASELINE, _PROGRESSIVE, _SCAN = 0xC0, 0xC2, 0xDA


class ProRes:
    """Parser of ProRes."""

    def header(self, data: bytes, findings: Findings) -> None:
        """Nothing stands before the pictures."""

    def picture(self, data: bytes, findings: Findings) -> None:
        """Read the header of a picture."""
        if data[4:8] == _PRORES:
            findings.interlaced |= bool(data[20] >> 2 & 3)
            findings.state(Colours(data[22], data[23], data[24]))


class DnxHd:
    """Parser of DNxHD and DNxHR."""

    def header(self, data: bytes, findings: Findings) -> None:
        """Nothing stands before the pictures."""

    def picture(self, data: bytes, findings: Findings) -> None:
        """Read the header of a picture."""
        findings.interlaced |= bool(data[5] & 2)


class Dv:
    """Parser of DV, whose pictures are always two fields."""

    def header(self, data: bytes, findings: Findings) -> None:
        """Nothing stands before the pictures."""

    def picture(self, data: bytes, findings: Findings) -> None:
        """Note a picture."""
        findings.interlaced = True


class UtVideo:
    """Parser of Ut Video."""

    def header(self, data: bytes, findings: Findings) -> None:
        """Read the flags of the whole video."""
        (flags,) = struct.unpack_from("<I", data, 12)
        findings.interlaced |= bool(flags & 0x800)

    def picture(self, data: bytes, findings: Findings) -> None:
        """Pictures say no more."""


class MotionJpeg:
    """Parser of Motion JPEG.

    Parameters
    ----------
    height : int
        Rows that the container states; a picture of fewer is a field.
    """

    def __init__(self, height: int) -> None:
        self._height = height

    def header(self, data: bytes, findings: Findings) -> None:
        """Nothing stands before the pictures."""

    def picture(self, data: bytes, findings: Findings) -> None:
        """Read the size of a picture."""
        place = 2
        while data[place] == 0xFF and data[place + 1] != _SCAN:
            marker, size = struct.unpack_from(">xBH", data, place)
            if _BASELINE <= marker <= _PROGRESSIVE:
                (rows,) = struct.unpack_from(">H", data, place + 5)
                findings.interlaced |= 4 * rows < 3 * self._height
                return
            place += 2 + size
