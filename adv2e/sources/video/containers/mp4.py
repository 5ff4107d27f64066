"""Index of MP4 and MOV files: when each picture is shown, where the last sample ends, and colours.

References
----------
.. [1] ISO/IEC 14496-12, ISO base media file format: boxes; ``mvhd``, ``mdhd``, ``elst``; ``stts``,
   ``ctts``, ``stsz``, ``stsc``, ``stco``, ``co64``; ``stsd``; 8.8 (fragments).
.. [2] Apple, QuickTime File Format: ``colr``, ``fiel``.
.. [3] VP Codec ISO Media File Format Binding: ``vpcC``.
"""

from __future__ import annotations

import mmap
import struct
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from adv2e.sources.times.instants import NS_PER_S
from adv2e.sources.video.colours import Colours
from adv2e.sources.video.containers.base import TINY_BYTES, Container, DamagedError, cut_short

FIRST = (b"ftyp", b"moov", b"mdat", b"wide", b"free", b"skip", b"pnot")
"""Kinds of box that a file can begin with."""

_OF_FRAGMENTS = frozenset(
    b"ftyp moov moof mdat sidx ssix styp mfra free skip emsg prft uuid udta meta wide pdin".split()
)
"""Kinds of box that a file of fragments has, numbered and one after another."""
_SAMPLE_ENTRY = 86
"""Bytes of the description of pictures before the boxes in it, from its size on."""

_Span = tuple[int, int]
"""Where the contents of a box begin and end."""


def examine(data: mmap.mmap, found: Container) -> None:
    """Note what the index says; DamagedError if it is missing or lists more than there is.

    What follows the last box, and boxes that hold no samples, may be anything: players ignore it.
    """
    found.readable = False
    top = list(boxes(data, 0, len(data)))
    index = [(start, stop) for kind, start, stop in top if kind == b"moov"]
    if not index or index[0][1] > len(data):
        raise DamagedError("cut short or never finished: its index ('moov') is missing")
    movie_scale, tracks = 0, []
    for kind, start, stop in boxes(data, *index[0]):
        if kind == b"mvhd":
            (movie_scale,) = struct.unpack_from(">I", data, start + (20 if data[start] else 12))
        elif kind == b"trak":
            tracks.append(_Track(data, start, stop))
    videos = [track for track in tracks if track.is_video]
    if videos:
        videos[0].describe(found)
    if any(kind in (b"moof", b"sidx") for kind, _, _ in top):
        _check_fragments(data, found)
        return
    end = max((track.end for track in tracks), default=0)
    if end > len(data):
        raise cut_short(end, len(data))
    if len(videos) != 1:  # which one FFmpeg takes is its own affair
        return
    stamps_ns = videos[0].stamps_ns(movie_scale) or []
    found.stamps_ns = sorted(stamps_ns) or None
    found.leading = sum(t < stamps_ns[0] for t in stamps_ns)
    found.tiny = videos[0].tiny
    found.doubts += videos[0].doubts


def boxes(data: mmap.mmap, start: int, end: int) -> Iterator[tuple[bytes, int, int]]:
    """Yield kind, start and end of the contents of each box between two places."""
    while start + 8 <= end:
        size, kind = struct.unpack_from(">I4s", data, start)
        head = 8
        if size == 1 and start + 16 <= end:
            (size,) = struct.unpack_from(">Q", data, start + 8)
            head = 16
        if not kind.strip(b"\0") or (size < head and size != 0):
            return  # padding after the last box
        stop = start + size if size else end
        yield kind, start + head, stop
        start = stop


def _check_fragments(data: mmap.mmap, found: Container) -> None:
    """Doubt what follows the last one; DamagedError if one is missing or cut."""
    before, end = None, 0
    for kind, start, stop in boxes(data, 0, len(data)):
        if kind not in _OF_FRAGMENTS:
            break
        if stop > len(data):
            raise cut_short(stop, len(data))
        end = stop
        if kind == b"moof":
            number = _number(data, start, stop)
            if before is not None and number > before + 1:
                raise DamagedError(f"damaged before byte {start}: fragments are missing")
            before = number
    if data.find(b"moof", end) >= 0:
        raise DamagedError(f"damaged at byte {end}")
    if end < len(data):
        found.doubts.append("bytes follow its last box: fragments may be missing")


def _number(data: mmap.mmap, start: int, stop: int) -> int:
    """Return the number of a fragment, whose boxes fill it."""
    number, end = 0, start
    for kind, begin, end in boxes(data, start, stop):
        if kind == b"mfhd":
            (number,) = struct.unpack_from(">I", data, begin + 4)
        elif kind == b"traf":
            _number(data, begin, end)
    if end != stop:
        raise DamagedError(f"damaged at byte {end}")
    return number


class _Track:
    """One track of the index."""

    def __init__(self, data: mmap.mmap, start: int, stop: int) -> None:
        self._data = data
        self._found: dict[bytes, _Span] = {}
        self._open(start, stop)
        handler = self._found.get(b"hdlr")
        self.is_video = handler is not None and data[handler[0] + 8 : handler[0] + 12] == b"vide"

    def _open(self, start: int, stop: int) -> None:
        for kind, begin, end in boxes(self._data, start, stop):
            if end > stop:
                raise DamagedError("its index ('moov') is damaged")
            if kind in (b"mdia", b"minf", b"stbl", b"edts"):
                self._open(begin, end)
            elif kind != b"hdlr" or kind not in self._found:  # minf may have one of its own
                self._found[kind] = begin, end

    def describe(self, found: Container) -> None:
        """Note what the description of its pictures says of colours and fields."""
        span = self._found.get(b"stsd")
        if span is None:
            return
        found.readable = True
        begin = span[0] + 8
        (size,) = struct.unpack_from(">I", self._data, begin)
        end = min(span[1], begin + size)
        for kind, place, stop in boxes(self._data, begin + _SAMPLE_ENTRY, end):
            if stop > end:
                return
            if kind == b"colr" and self._data[place : place + 4] in (b"nclx", b"nclc"):
                found.colours = Colours(*struct.unpack_from(">HHH", self._data, place + 4))
            elif kind == b"vpcC" and stop - place >= 10:
                codes = self._data[place + 7 : place + 10]
                found.colours = Colours(*codes).completed(found.colours)
            elif kind == b"fiel":
                found.interlaced = self._data[place] == 2

    @property
    def doubts(self) -> list[str]:
        """What is to be told of how its pictures are to be shown: all but quarter turns."""
        span = self._found.get(b"tkhd")
        if span is None:
            return []
        place = span[0] + (52 if self._data[span[0]] else 40)
        if place + 20 > span[1]:
            return []
        a, b, _, c, d = struct.unpack_from(">5i", self._data, place)
        if a * d - b * c < 0:
            return ["it is to be shown mirrored, which is not done; re-encode it upright"]
        if (a or d) and (b or c):
            return ["it is to be shown tilted, which is not done; re-encode it upright"]
        return []

    def _table(self, kind: bytes, layout: str, skip: int = 4) -> NDArray[np.int64]:
        """Return the (entries, columns) of a table; `skip` bytes stand before their number."""
        span = self._found.get(kind)
        codes = layout.split()
        item = np.dtype([(str(n), code) for n, code in enumerate(codes)])
        if span is None:
            return np.empty((0, len(codes)), np.int64)
        (count,) = struct.unpack_from(">I", self._data, span[0] + skip)
        first = span[0] + skip + 4
        if first + count * item.itemsize > span[1]:
            raise DamagedError("its index ('moov') is damaged")
        table = np.frombuffer(self._data[first : first + count * item.itemsize], item)
        columns = [table[str(n)].astype(np.int64) for n in range(len(codes))]
        return np.stack(columns, axis=1)

    def _sizes(self) -> NDArray[np.int64]:
        span = self._found.get(b"stsz")
        if span is None:
            return np.empty(0, np.int64)
        same, count = struct.unpack_from(">II", self._data, span[0] + 4)
        if same:  # no table follows; a count that is a lie must not fill the memory
            return np.full(min(count, len(self._data)), same, np.int64)
        return self._table(b"stsz", ">u4", skip=8)[:, 0]

    @property
    def end(self) -> int:
        """Where the last byte of its samples is, and one more."""
        offsets = self._table(b"stco", ">u4")[:, 0]
        if not offsets.size:
            offsets = self._table(b"co64", ">u8")[:, 0]
        runs, sizes = self._table(b"stsc", ">u4 >u4 >u4"), self._sizes()
        if not (offsets.size and len(runs) and sizes.size):
            return 0
        chunks = np.diff(np.append(runs[:, 0], offsets.size + 1))
        if (chunks < 0).any() or chunks.sum() != offsets.size:
            raise DamagedError("its index ('moov') is damaged")
        after = np.cumsum(np.repeat(runs[:, 1], chunks))
        total = np.append(0, np.cumsum(sizes))
        ends = np.minimum(after, sizes.size)
        starts = np.append(0, ends[:-1])
        return int((offsets + total[ends] - total[starts]).max())

    @property
    def tiny(self) -> int:
        """How many samples are too small to hold a picture."""
        return int(np.count_nonzero(self._sizes() <= TINY_BYTES))

    def stamps_ns(self, movie_scale: int) -> list[int] | None:
        """Return when its pictures are shown; None where more than a cut is made of it."""
        span = self._found.get(b"mdhd")
        if span is None:
            return None
        (scale,) = struct.unpack_from(
            ">I", self._data, span[0] + (20 if self._data[span[0]] else 12)
        )
        count = self._sizes().size
        durations = _expanded(self._table(b"stts", ">u4 >i4"), count)
        if not scale or durations.size != count or not count:
            return None
        shown = np.append(0, np.cumsum(durations)[:-1])
        if b"ctts" in self._found:
            later = _expanded(self._table(b"ctts", ">u4 >i4"), count)
            shown = shown + np.pad(later, (0, count - later.size))
        edits = self._edits()
        real = [(length, start) for length, start in edits if start >= 0]
        if len(real) > 1 or not movie_scale:
            return None
        if real:
            length, start = real[0]
            stop = start + (length * scale + movie_scale // 2) // movie_scale
            shown = shown[(shown >= start) & ((shown < stop) | (length == 0))]
        return [int(t) * NS_PER_S // scale for t in shown]

    def _edits(self) -> list[tuple[int, int]]:
        span = self._found.get(b"elst")
        wide = span is not None and self._data[span[0]] == 1
        table = self._table(b"elst", ">u8 >i8 >u4" if wide else ">u4 >i4 >u4")
        return [(int(length), int(start)) for length, start, _ in table]


def _expanded(table: NDArray[np.int64], most: int) -> NDArray[np.int64]:
    """Return the second column, each as often as the first says, no more than `most` in all."""
    times = np.diff(np.append(0, np.minimum(np.cumsum(table[:, 0]), most)))
    return np.repeat(table[:, 1], times)
