"""What the headers of a video file can say, whatever its container."""

from __future__ import annotations

import mmap
import struct
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from fractions import Fraction


@dataclass(frozen=True)
class Container:
    """What the headers of a video file say.

    Attributes
    ----------
    stamps_ns : list of int or None
        Times of all pictures in the order they are shown [ns], where the file lists them
        cheaply (MP4, Matroska, Y4M).
    tick_ns : int
        Step of the times in the file [ns], where it is coarse (Matroska, ASF).
    rate : Fraction or None
        The exact rate of a file that has no times but for that rate [Hz] (AVI, Y4M).
    decoding_times : bool
        The times in the file, if any, are those of decoding, or not all of them are there.
    pictures : int or None
        How many pictures the index lists, where it lists no times (AVI).
    end_ns : int or None
        When the last picture ends, from the first, as the headers state it (ASF, AVI) [ns].
    whole : bool
        Checksums prove that nothing is missing (Ogg).
    leading : int
        How many of the pictures are shown before the first in the file.
    tiny : int
        How many of those that are listed are too small to hold a picture.
    faults : list of str
        What is wrong with the structure, with where.
    doubts : list of str
        What may be wrong with it.
    """

    stamps_ns: list[int] | None = None
    tick_ns: int = 0
    rate: Fraction | None = None
    decoding_times: bool = False
    pictures: int | None = None
    end_ns: int | None = None
    whole: bool = False
    leading: int = 0
    tiny: int = 0
    faults: list[str] = field(default_factory=list)
    doubts: list[str] = field(default_factory=list)


TINY_BYTES = 8
"""Coded pictures of no more than this may stand for the one before them (MPEG-4's N-VOP)."""


class DamagedError(Exception):
    """What is wrong with the structure of a file."""


def cut_short(needed: int, present: int) -> DamagedError:
    """Return what is wrong with a file that ends before its structure does."""
    return DamagedError(
        f"cut short: it holds {present} bytes where at least {needed} belong; copy it again"
    )


def chained(
    data: mmap.mmap, place: int, measure: Callable[[mmap.mmap, int], int], padding: int = 0
) -> Iterator[tuple[int, int]]:
    """Yield where each part of a file begins and ends, whose parts follow one another.

    Parameters
    ----------
    data : mmap
    place : int
        Where the first part begins.
    measure : callable
        Returns the bytes of the part at a place; 0 if none begins there.
    padding : int
        How many zeros may stand at the end.

    Raises
    ------
    DamagedError
        Something else stands between two parts, or the last one is cut.
    """
    while place < len(data):
        try:
            size = measure(data, place)
        except (IndexError, struct.error):
            raise cut_short(len(data) + 1, len(data)) from None
        if size == 0:
            if len(data) - place <= padding and not data[place:].strip(b"\0"):
                return
            raise DamagedError(f"damaged at byte {place}")
        if place + size > len(data):
            raise cut_short(place + size, len(data))
        yield place, place + size
        place += size
