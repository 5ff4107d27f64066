"""What the container of a video states of its pictures: their colours, and whether they are fields.

Nothing here raises for a file that is damaged: then it may state what cannot be read, as FFmpeg
finds its way through much.

References
----------
.. [1] ISO/IEC 14496-12 and Apple, QuickTime File Format: sample descriptions, ``colr``, ``fiel``.
.. [2] VP Codec ISO Media File Format Binding: ``vpcC``.
.. [3] RFC 9559 (Matroska, WebM): ``Video``, ``Colour``.
"""

from __future__ import annotations

import mmap
import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import takewhile
from pathlib import Path

from adv2e.sources.video.colours import UNSTATED, Colours
from adv2e.sources.video.containers import matroska, mxf, y4m
from adv2e.sources.video.containers.base import DamagedError
from adv2e.sources.video.containers.matroska import variable
from adv2e.sources.video.containers.mp4 import FIRST, boxes

_WITHIN = (b"moov", b"trak", b"mdia", b"minf", b"stbl")
_SAMPLE_ENTRY = 86
"""Bytes of the description of pictures before the boxes in it, from its size on."""

_SEGMENT, _TRACKS, _TRACK, _TRACK_TYPE = 0x18538067, 0x1654AE6B, 0xAE, 0x83
_CLUSTER, _VIDEO, _COLOUR = 0x1F43B675, 0xE0, 0x55B0
_INTERLACED, _ALPHA = 0x9A, 0x53C0
_MATRIX, _TRANSFER, _PRIMARIES = 0x55B1, 0x55BA, 0x55BB


@dataclass(frozen=True)
class Stated:
    """What a container states.

    Attributes
    ----------
    colours : Colours
    interlaced : bool
        Pictures are two fields each.
    alpha_apart : bool
        Transparency is stored beside the pictures (WebM), where decoders do not look for it.
    readable : bool
        False where it may state more than is read here (MXF, or damaged).
    """

    colours: Colours = field(default_factory=Colours)
    interlaced: bool = False
    alpha_apart: bool = False
    readable: bool = True


def stated_by(path: str | Path) -> Stated:
    """Return what the container of a video states."""
    try:
        with (
            Path(path).open("rb") as file,
            mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data,
        ):
            return _read(data)
    except (DamagedError, OSError, ValueError, struct.error, IndexError):
        return Stated(readable=False)


def _read(data: mmap.mmap) -> Stated:
    if data[4:8] in FIRST:
        return _mp4(data)
    if data[:4] == matroska.MAGIC:
        return _matroska(data)
    if data[: len(y4m.MAGIC)] == y4m.MAGIC:
        fields = data[: max(data.find(b"\n", 0, 1000), 0)].split(b" ")
        return Stated(interlaced=any(field in (b"It", b"Ib", b"Im") for field in fields))
    return Stated(readable=data[:4] != mxf.MAGIC)


def _mp4(data: mmap.mmap) -> Stated:
    colours, interlaced, found = Colours(), False, False
    for kind, begin, end in _pictures(data, 0, len(data), is_video=False):
        found = True
        if kind == b"colr" and data[begin : begin + 4] in (b"nclx", b"nclc"):
            colours = Colours(*struct.unpack_from(">HHH", data, begin + 4))
        elif kind == b"vpcC" and end - begin >= 10:
            colours = Colours(*data[begin + 7 : begin + 10]).completed(colours)
        elif kind == b"fiel":
            interlaced = data[begin] == 2
    return Stated(colours, interlaced, readable=found)


def _pictures(
    data: mmap.mmap, start: int, stop: int, *, is_video: bool
) -> Iterator[tuple[bytes, int, int]]:
    """Yield kind, start and end of the description of the first video, and of the boxes in it."""
    for kind, begin, end in _boxes(data, start, stop):
        if kind == b"hdlr" and data[begin + 4 : begin + 8] != b"dhlr":
            is_video = data[begin + 8 : begin + 12] == b"vide"
        elif kind == b"stsd" and is_video:
            yield kind, begin, end
            yield from _boxes(data, begin + 8 + _SAMPLE_ENTRY, min(end, _entry_end(data, begin)))
            return
        elif kind in _WITHIN:
            found = list(_pictures(data, begin, end, is_video=is_video))
            if found:
                yield from found
                return


def _entry_end(data: mmap.mmap, begin: int) -> int:
    (size,) = struct.unpack_from(">I", data, begin + 8)
    return int(begin + 8 + size)


def _boxes(data: mmap.mmap, start: int, stop: int) -> Iterator[tuple[bytes, int, int]]:
    """Yield the boxes that lie within as a whole."""
    return takewhile(lambda box: box[2] <= stop, boxes(data, start, stop))


def _matroska(data: mmap.mmap) -> Stated:
    colours = dict.fromkeys((_PRIMARIES, _TRANSFER, _MATRIX), UNSTATED)
    interlaced, alpha, is_video = False, False, False
    for kind, begin, end in _elements(data):
        if kind == _TRACK_TYPE:
            if is_video:
                break  # the next track: the first video has been read
            is_video = data[begin] == 1
        elif kind == _INTERLACED and is_video:
            interlaced = data[end - 1] == 1
        elif kind == _ALPHA and is_video:
            alpha = data[end - 1] == 1
        elif kind in colours and is_video:
            colours[kind] = data[end - 1]
    return Stated(Colours(*colours.values()), interlaced, alpha, readable=is_video)


def _elements(data: mmap.mmap) -> Iterator[tuple[int, int, int]]:
    """Yield kind, start and end of the contents of elements before the first cluster."""
    place = 0
    while place < len(data):
        kind, place = variable(data, place, keep_marker=True)
        size, begin = variable(data, place, keep_marker=False)
        if kind == _CLUSTER:
            return
        yield kind, begin, begin + size
        into = kind in (_SEGMENT, _TRACKS, _TRACK, _VIDEO, _COLOUR)
        place = begin if into else begin + size
