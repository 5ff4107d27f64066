"""What the headers of a video file can say, whatever its container."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Container:
    """What the headers of a video file say.

    Attributes
    ----------
    stamps_ns : list of int or None
        Times of all pictures in the order they are shown [ns], where the file lists them
        cheaply (Matroska).
    tick_ns : int
        Step of those times [ns].
    end_ns : int or None
        When the last picture ends, from the first (MP4, Matroska) [ns].
    exact_count : bool
        The number of pictures that FFmpeg reports was read from the file, not estimated.
    """

    stamps_ns: list[int] | None = None
    tick_ns: int = 0
    end_ns: int | None = None
    exact_count: bool = False


class DamagedError(Exception):
    """What is wrong with the structure of a file."""


def cut_short(needed: int, present: int) -> DamagedError:
    """Return what is wrong with a file that ends before its structure does."""
    return DamagedError(
        f"cut short: it holds {present} bytes where at least {needed} belong; copy it again"
    )
