"""The coded pictures of a video, listed without decoding them.

Containers that have no index of their pictures are read through once by FFmpeg's demultiplexer,
which takes little beside decoding: how many pictures there are and what is known of their times is
told before the work.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import cv2

from adv2e.sources.images.opencv import quiet
from adv2e.sources.video.containers.base import TINY_BYTES
from adv2e.sources.video.opening import openable

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


def list_packets(path: str) -> Packets:
    """Return the coded pictures of a video; none if it cannot be opened."""
    stamps: list[int] = []
    tiny = 0
    with quiet():
        with openable(path) as name:
            capture = cv2.VideoCapture(name, cv2.CAP_FFMPEG, [cv2.CAP_PROP_FORMAT, -1])
        failed = 0
        while capture.isOpened() and failed < RETRIES:
            if not capture.grab():
                failed += 1
                continue
            failed = 0
            good, data = capture.retrieve()
            if good and data is not None and data.size:
                stamps.append(stamp_of(capture))
                tiny += data.size <= TINY_BYTES
        capture.release()
    return arranged(stamps, tiny)


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
