"""The coded pictures of a video, gone through once without decoding them.

FFmpeg's demultiplexer takes little beside decoding.  How many pictures there are and what is known
of their times, where the container has no index, and what they say of themselves, is told before
the work.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import cv2
from numpy.typing import NDArray

from adv2e.sources.images.opencv import quiet
from adv2e.sources.video.containers.base import TINY_BYTES
from adv2e.sources.video.opening import openable
from adv2e.sources.video.streams import Stream, parser_of

if TYPE_CHECKING:
    from adv2e.sources.video.pyav import PyavCapture

RETRIES = 1000
"""How often the next picture may fail to come before that counts as the end."""


@dataclass(frozen=True)
class Jump:
    """A picture whose time is before that of others, or beyond reason: number and times [ns]."""

    number: int
    latest_ns: int
    t_ns: int


@dataclass(frozen=True)
class Packets:
    """Coded pictures in the order of the file.

    Attributes
    ----------
    count : int
        How many there are; empty ones, which stand for a picture repeated, are left out.
    known_ns : list of int
        Times that are stated, sorted and none twice, those of decoding where that is all there is;
        zero where FFmpeg begins to count [ns].
    complete : bool
        Each has a time, and no two the same.
    tiny : int
        How many are too small to hold a picture, and may stand for the one before them.
    leading : int
        How many are shown before the first in the file.
    unstamped : int
        How many have no time.
    back : Jump or None
        Where times begin again, if they do.
    """

    count: int
    known_ns: list[int]
    complete: bool
    tiny: int
    leading: int
    unstamped: int
    back: Jump | None


_REORDERED = 16
"""Pictures between which decoding may change the order."""
_HALF_WRAP_NS = 2**32 * 10**9 // 90_000
"""Clocks of MPEG streams begin again after twice this; FFmpeg takes going back for that."""


def read_packets(path: str, height: int, *, listed: bool) -> tuple[Stream, Packets | None]:
    """Return what the coded pictures of a video say, and when they are shown.

    Nothing is in one that cannot be opened.  `height` are the rows that its container states;
    `listed`: it lists the times of its pictures, and no more of them are read than say something.
    """
    stamps: list[int] = []
    tiny = 0
    with quiet(), openable(path) as name:
        capture = cv2.VideoCapture(name, cv2.CAP_FFMPEG, [cv2.CAP_PROP_FORMAT, -1])
        letters = (int(capture.get(cv2.CAP_PROP_FOURCC)) & 0xFFFFFFFF).to_bytes(4, "little")
        stream, parser = parser_of(letters.decode("latin-1").lower().strip("\0 "), height)
        try:
            if parser is not None:
                index = int(capture.get(cv2.CAP_PROP_CODEC_EXTRADATA_INDEX))
                good, extra = capture.retrieve(flag=index)
                _read(parser.header, extra.tobytes() if good and extra is not None else b"", stream)
            for data in _pictures(capture):
                if not listed:
                    stamps.append(stamp_of(capture))
                    tiny += data.size <= TINY_BYTES
                if parser is not None and stream.clear and not stream.interlaced:
                    _read(parser.picture, data.tobytes(), stream)
                elif listed:
                    break
        finally:
            capture.release()
    return stream, None if listed else arranged(stamps, tiny)


def _pictures(capture: cv2.VideoCapture) -> Iterator[NDArray[Any]]:
    failed = 0
    while capture.isOpened() and failed < RETRIES:
        if not capture.grab():
            failed += 1
            continue
        failed = 0
        good, data = capture.retrieve()
        if good and data is not None and data.size:
            yield data


def _read(read: Callable[[bytes, Stream], None], data: bytes, stream: Stream) -> None:
    try:
        read(data, stream)
    except (IndexError, struct.error):
        stream.clear = False


def stamp_of(capture: cv2.VideoCapture | PyavCapture) -> int:
    """Return the stamp of the picture just grabbed [ns]; zero where it has none."""
    return round(capture.get(cv2.CAP_PROP_POS_MSEC) * 1e6)


def arranged(stamps_ns: list[int], tiny: int = 0) -> Packets:
    """Return what stamps of coded pictures, as OpenCV gives them, say of their times."""
    count = len(stamps_ns)
    # two joined files have two pictures at zero that are there
    none_at_zero = stamps_ns.count(0) > 2
    stamps = [
        (number, stamp)
        for number, stamp in enumerate(stamps_ns)
        if stamp or number == 0 or not none_at_zero
    ]
    known = sorted({stamp for _, stamp in stamps})
    steps = sorted(after - before for before, after in pairwise(known))
    step = steps[len(steps) // 2] if steps else 0
    back: Jump | None = None
    latest = stamps[0][1] if stamps else 0
    for number, stamp in stamps:
        if latest - stamp > _REORDERED * step or stamp - latest > _HALF_WRAP_NS:
            back = Jump(number, latest, stamp)
            break
        latest = max(latest, stamp)
    return Packets(
        count=count,
        known_ns=known,
        complete=len(known) == count > 0,
        tiny=tiny,
        leading=sum(t < stamps[0][1] for t in known),
        unstamped=count - len(stamps),
        back=back,
    )
