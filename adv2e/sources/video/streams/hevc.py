"""HEVC: sequence parameter sets and the supplemental information before pictures.

References
----------
.. [1] ITU-T H.265 (08/2021): 7.3.2.2 (sequence parameter set), 7.3.7 (sets of reference pictures),
   D.2 (supplemental enhancement information), E.2 (video usability information).
"""

from __future__ import annotations

from adv2e.sources.video.streams.base import Bits, Parser, Stream
from adv2e.sources.video.streams.nal import (
    StatedColours,
    messages,
    signal,
    unguarded,
    units_of_picture,
)

_LAST_SLICE, _SPS, _SEI = 31, 33, 39
_PICTURE_TIMING = 1
_ONE_FIELD = (1, 2, 9, 10, 11, 12)
_MOST_SETS = 64


class Hevc(Parser):
    """Parser of HEVC with start codes; OpenCV repeats in the pictures what stands before them."""

    def __init__(self) -> None:
        self._structure = False
        self._colours = StatedColours()

    def picture(self, data: bytes, stream: Stream) -> None:
        """Read parameter sets and messages up to the first slice."""
        for unit in units_of_picture(data):
            kind = unit[0] >> 1 & 63
            if kind == _SPS:
                self._parameters(Bits(unguarded(unit)[2:]), stream)
            elif kind == _SEI:
                self._messages(unguarded(unit)[2:], stream)
            elif kind <= _LAST_SLICE:
                break
        self._colours.tell(stream)

    def _messages(self, data: bytes, stream: Stream) -> None:
        for kind, content in messages(data):
            self._colours.hear(kind, content)
            if kind == _PICTURE_TIMING and self._structure:
                stream.interlaced |= content[0] >> 4 in _ONE_FIELD

    def _parameters(self, bits: Bits, stream: Stream) -> None:
        bits.skip(4)
        layers = bits.take(3)
        bits.skip(1)
        _skip_profiles(bits, layers)
        bits.ue()
        if bits.ue() == 3:
            bits.skip(1)
        bits.ue()
        bits.ue()
        if bits.flag():
            for _ in range(4):
                bits.ue()
        bits.ue()
        bits.ue()
        order_bits = bits.ue() + 4
        for _ in range(layers + 1 if bits.flag() else 1):
            for _ in range(3):
                bits.ue()
        for _ in range(6):
            bits.ue()
        if bits.flag() and bits.flag():
            _skip_scaling(bits)
        bits.skip(2)
        if bits.flag():
            bits.skip(8)
            bits.ue()
            bits.ue()
            bits.skip(1)
        _skip_reference_sets(bits)
        if bits.flag():
            for _ in range(bits.ue()):
                bits.skip(order_bits + 1)
        bits.skip(2)
        if bits.flag():
            self._usability(bits, stream)

    def _usability(self, bits: Bits, stream: Stream) -> None:
        self._colours.usual = signal(bits)
        bits.skip(1)
        stream.interlaced |= bits.flag()
        self._structure = bits.flag()


def _skip_profiles(bits: Bits, layers: int) -> None:
    bits.skip(96)
    present = [(bits.flag(), bits.flag()) for _ in range(layers)]
    if layers:
        bits.skip(2 * (8 - layers))
    for profile, level in present:
        bits.skip(88 * profile + 8 * level)


def _skip_scaling(bits: Bits) -> None:
    for size in range(4):
        for _ in range(0, 6, 3 if size == 3 else 1):
            if not bits.flag():
                bits.ue()
                continue
            if size > 1:
                bits.se()
            for _ in range(min(64, 1 << (4 + 2 * size))):
                bits.se()


def _skip_reference_sets(bits: Bits) -> None:
    sets, before = bits.ue(), 0
    if sets > _MOST_SETS:
        raise IndexError("no such sets")
    for number in range(sets):
        if number and bits.flag():
            bits.skip(1)
            bits.ue()
            # a picture is used, or not used but kept
            before = sum(bits.flag() or bits.flag() for _ in range(before + 1))
            continue
        before = bits.ue() + bits.ue()
        for _ in range(before):
            bits.ue()
            bits.skip(1)
