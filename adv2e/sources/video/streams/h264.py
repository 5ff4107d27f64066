"""H.264: parameter sets, the supplemental information before pictures, and headers of slices.

References
----------
.. [1] ITU-T H.264 (08/2021): 7.3.2.1.1 (sequence parameter set), 7.3.2.2 (picture parameter set),
   7.3.3 (slice header), D.1.3 (picture timing), E.1 (video usability information).
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, field

from adv2e.sources.video.streams.base import Bits, Parser, Stream
from adv2e.sources.video.streams.nal import (
    StatedColours,
    messages,
    signal,
    unguarded,
    units,
    units_of_picture,
)

_CHROMA_PROFILES = (100, 110, 122, 244, 44, 83, 86, 118, 128, 138, 139, 134, 135)
_SLICES, _SEI, _SPS, _PPS = (1, 2, 5), 6, 7, 8
_HEADER_BYTES = 32
"""Of a slice: more than what is read of its header takes."""
_PICTURE_TIMING = 1
_WHOLE_FRAME, _LAST_OF_ONE_FRAME, _LAST = 0, 4, 8
_FRAME_SCAN, _FIELD_SCAN = 0, 1


def _units_of_header(data: bytes) -> Iterator[bytes]:
    """Yield parameter sets, between start codes or as ISO/IEC 14496-15, 5.3.3.1 has them."""
    if data[:1] != b"\1":
        yield from units(data)
        return
    place = 5
    for mask in (31, 255):
        count, place = data[place] & mask, place + 1
        for _ in range(count):
            begin = place + 2
            place = begin + int.from_bytes(data[place:begin], "big")
            if place > begin:
                yield data[begin:place]


@dataclass
class _Timing:
    """Where a message about the timing of a picture has what."""

    skipped_bits: int = 0
    structure: bool = False


@dataclass
class _Sequence:
    """What a sequence parameter set says of slices and timing."""

    frame_number_bits: int = 0
    frames_only: bool = True
    fields_in_frames: bool = False
    timing: _Timing = field(default_factory=_Timing)


class H264(Parser):
    """Parser of H.264 with start codes."""

    def __init__(self) -> None:
        self._sequences: dict[int, _Sequence] = {}
        self._sequence_of: dict[int, int] = {}
        self._colours = StatedColours()

    def header(self, data: bytes, stream: Stream) -> None:
        """Read parameter sets: OpenCV repeats them in pictures that all can begin with, no others.

        Videos cut from such as have open groups of pictures may have none of these.
        """
        with suppress(IndexError):  # what is damaged there FFmpeg cannot read either
            for unit in _units_of_header(data):
                self._parameter_set(unit)

    def picture(self, data: bytes, stream: Stream) -> None:
        """Read parameter sets and messages up to the first slice, and how that is coded."""
        timing = b""
        for unit in units_of_picture(data):
            kind = unit[0] & 31
            if kind in (_SPS, _PPS):
                self._parameter_set(unit)
            elif kind == _SEI:
                timing = self._messages(unguarded(unit)[1:]) or timing
            elif kind in _SLICES:
                with suppress(IndexError):  # without a header it is no picture
                    self._slice(Bits(unguarded(unit[:_HEADER_BYTES])[1:]), timing, stream)
                break
        self._colours.tell(stream)

    def _parameter_set(self, unit: bytes) -> None:
        bits = Bits(unguarded(unit)[1:])
        if unit[0] & 31 == _SPS:
            self._parameters(bits)
        elif unit[0] & 31 == _PPS:
            self._sequence_of[bits.ue()] = bits.ue()

    def _parameters(self, bits: Bits) -> None:
        profile = bits.take(8)
        bits.skip(16)
        number, sequence = bits.ue(), _Sequence()
        if profile in _CHROMA_PROFILES:
            _skip_chroma(bits)
        sequence.frame_number_bits = bits.ue() + 4
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
        sequence.frames_only = bits.flag()
        if not sequence.frames_only:
            sequence.fields_in_frames = bits.flag()
        bits.skip(1)
        if bits.flag():
            for _ in range(4):
                bits.ue()
        self._sequences[number] = sequence
        if bits.flag():
            sequence.timing = self._usability(bits)

    def _usability(self, bits: Bits) -> _Timing:
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
        return _Timing(delays, bits.flag())

    def _messages(self, data: bytes) -> bytes:
        """Read messages, and return what is said of the timing of the picture."""
        timing = b""
        for kind, content in messages(data):
            self._colours.hear(kind, content)
            if kind == _PICTURE_TIMING:
                timing = content
        return timing

    def _slice(self, bits: Bits, timing: bytes, stream: Stream) -> None:
        """Note fields as FFmpeg does, which goes by the timing of a picture before its coding."""
        bits.ue()
        bits.ue()
        sequence = self._sequences.get(self._sequence_of.get(bits.ue(), -1))
        if sequence is None:
            return  # cannot be decoded, as at the start of a broadcast
        bits.skip(sequence.frame_number_bits)
        a_field = not sequence.frames_only and bits.flag()
        fields: bool | None = None
        if timing and sequence.timing.structure:
            fields = _timed_as_fields(Bits(timing), sequence.timing)
        stream.interlaced |= a_field or (sequence.fields_in_frames if fields is None else fields)


def _timed_as_fields(bits: Bits, timing: _Timing) -> bool | None:
    """Whether a message of timing could make FFmpeg flag a picture as fields; None: it is none."""
    bits.skip(timing.skipped_bits)
    structure = bits.take(4)
    if structure > _LAST:
        return None
    of_one_frame = structure <= _LAST_OF_ONE_FRAME
    scan = bits.take(2) if of_one_frame and bits.flag() else _FRAME_SCAN
    return scan == _FIELD_SCAN or (of_one_frame and structure != _WHOLE_FRAME)


def _skip_chroma(bits: Bits) -> None:
    chroma = bits.ue()
    if chroma == 3:
        bits.skip(1)  # FFmpeg decodes no planes that are coded apart
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
