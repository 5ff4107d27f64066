"""What the headers of a video file can say, whatever its container."""

from __future__ import annotations

from dataclasses import dataclass, field
from fractions import Fraction

from adv2e.sources.video.colours import Colours


@dataclass
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
        How many pictures it states, where it lists no times (AVI, GIF).
    end_ns : int or None
        When the last picture ends, from the first, as the headers state it (ASF, AVI) [ns].
    leading : int
        How many of the pictures are shown before the first in the file.
    tiny : int
        How many of those that are listed are too small to hold a picture.
    colours : Colours
    interlaced : bool
        Pictures are two fields each.
    alpha_apart : bool
        Transparency is stored beside the pictures (WebM), where decoders do not look for it.
    opaque : bool
        No pixel is transparent, whatever kind they are of (GIF).
    readable : bool
        False where it may state colours that are not read here (damaged).
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
    leading: int = 0
    tiny: int = 0
    colours: Colours = field(default_factory=Colours)
    interlaced: bool = False
    alpha_apart: bool = False
    opaque: bool = False
    readable: bool = True
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
