"""Times of frames: lists in text files, frame rates, and what a container's stamps stand for.

Decimal seconds are read as text and become integer nanoseconds without passing through floating
point, so that stamps of 1.47e9 s keep every digit.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from decimal import Decimal
from fractions import Fraction
from itertools import pairwise
from pathlib import Path
from statistics import median

import numpy as np
from numpy.typing import NDArray

from adv2e.errors import DataError
from adv2e.regular import read_text_bytes
from adv2e.ticks import LARGEST_NS

NS_PER_S = 10**9

_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d{1,3})?")


@dataclass(frozen=True)
class Stamp:
    """One line of a list of times."""

    t_ns: int
    line: int
    name: str | None


@dataclass(frozen=True)
class FrameRate:
    """Frames at an exact, constant rate [Hz]; the first is at zero."""

    hz: Fraction

    def time_ns(self, number: int) -> int:
        """Return the time [ns] of frame `number`, to the nearest nanosecond."""
        return round(Fraction(number * NS_PER_S) / self.hz)


def parse_ns(text: str, unit_ns: int = NS_PER_S) -> int:
    """Return the decimal number `text`, in units of `unit_ns`, as whole nanoseconds.

    Raises
    ------
    ValueError
        If the text is not a plain or scientific decimal number, or is beyond 146 years.
    """
    if not _NUMBER.fullmatch(text):
        raise ValueError(f"{text[:40]!r} is not a number")
    t_ns = round(Fraction(Decimal(text)) * unit_ns)
    if abs(t_ns) > LARGEST_NS:
        raise ValueError(f"{text[:40]!r} is out of range: over 146 years")
    return t_ns


def seconds(t_ns: int) -> str:
    """Return a time [ns] as text in seconds, all digits that count."""
    sign = "-" if t_ns < 0 else ""
    whole, part = divmod(abs(t_ns), NS_PER_S)
    return sign + (f"{whole}.{part:09d}".rstrip("0").rstrip("."))


def read_text(path: Path) -> str:
    """Return the text of a list of times; DataError unless it is a readable text file."""
    try:
        return read_text_bytes(path).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise DataError(f"{path}: not a text file; one time [s] a line is expected") from error
    except OSError as error:
        raise DataError(f"{path}: {error.strerror}") from error


WHOLE = "times have no decimal point: taken as microseconds"
"""What is told of files whose times are whole numbers, of events or of their frames."""
WHOLE_SECONDS = "times have no decimal point, but are too near for microseconds: taken as seconds"
_SHORTEST_US = 20
"""Frames that would be nearer than this, typically, are not listed in microseconds."""


def parse_list(text: str, label: str) -> tuple[list[Stamp], str]:
    """Read the list of frames of a recording; times without any decimal point are microseconds.

    So are those of its events: see :mod:`adv2e.recordings.text`.  Frames that would come faster
    than 50,000 a second are listed in whole seconds.

    Returns
    -------
    stamps : list of Stamp
    note : str
        What is to be told of their unit and order; empty for decimal seconds, sorted.

    Raises
    ------
    DataError
        As :func:`parse_times`.
    """
    unit_ns, unit = _unit_of(text, label)
    stamps = parse_times(text, label, unit_ns)
    return stamps, "; ".join(filter(None, (unit, order_note(stamps))))


def _unit_of(text: str, label: str) -> tuple[int, str]:
    """Return the unit of a list's times [ns], and what is to be told of it."""
    words = [words[0] for _, words in _lines(text, label, name_first=False)]
    if len(words) < 2 or not all(re.fullmatch(r"[+-]?\d{1,19}", word) for word in words):
        return NS_PER_S, ""
    listed = sorted(int(word) for word in words)
    if median(after - before for before, after in pairwise(listed)) < _SHORTEST_US:
        return NS_PER_S, WHOLE_SECONDS
    return 1000, WHOLE


def order_note(stamps: list[Stamp]) -> str:
    """Return what is to be told of the order that the lines of sorted stamps had, if anything."""
    for before, stamp in pairwise(stamps):
        if stamp.line < before.line:
            return f"line {before.line} is earlier than one before it: sorted by time"
    return ""


def parse_times(text: str, label: str, unit_ns: int = NS_PER_S) -> list[Stamp]:
    """Read ``t`` or ``t name`` lines, t in seconds, ``#`` comments allowed.

    Lines with names may stand in any order and are sorted by time (a name tells which frame is
    meant); lines without must increase, since their order is that of the frames.

    Parameters
    ----------
    text : str
        The list.
    label : str
        Name of the file, for messages.
    unit_ns : int
        Unit of the times [ns].

    Raises
    ------
    DataError
        On a line that cannot be read, a mixture of lines with and without names, a time or a name
        that occurs twice, times that do not increase, or an empty list; with the line's number.
    """
    stamps = []
    for number, words in _lines(text, label, name_first=False):
        stamps.append(_stamp(words[0], unit_ns, number, label, *words[1:]))
    return _checked(stamps, label)


def parse_info(text: str, label: str) -> list[Stamp]:
    """Read ``path t`` lines, t in microseconds (the ``info.txt`` of DVS-Voltmeter).

    Raises
    ------
    DataError
        As `parse_times`.
    """
    stamps = []
    for number, words in _lines(text, label, name_first=True):
        if len(words) < 2:
            raise DataError(f"{label} line {number}: expected 'path time', the time in us")
        stamps.append(_stamp(words[1], 1000, number, label, words[0]))
    return _checked(stamps, label)


def _lines(text: str, label: str, *, name_first: bool) -> list[tuple[int, list[str]]]:
    lines = []
    for number, line in enumerate(text.splitlines(), start=1):
        content = line.strip()
        if content and not content.startswith("#"):
            # names may hold spaces; numbers do not
            words = content.rsplit(maxsplit=1) if name_first else content.split(maxsplit=1)
            lines.append((number, words))
    if not lines:
        raise DataError(f"{label}: no times in it; one time a line is expected")
    return lines


def _stamp(text: str, unit_ns: int, line: int, label: str, name: str | None = None) -> Stamp:
    try:
        t_ns = parse_ns(text, unit_ns)
    except ValueError as error:
        unit = "seconds" if unit_ns == NS_PER_S else "us"
        raise DataError(
            f"{label} line {line}: {error}; a time in {unit} is expected there"
        ) from error
    if name is not None and name.startswith("#"):
        name = None
    return Stamp(t_ns, line, name)


def _checked(stamps: list[Stamp], label: str) -> list[Stamp]:
    named = stamps[0].name is not None
    lines: dict[str, int] = {}
    for stamp in stamps:
        if (stamp.name is not None) != named:
            raise DataError(
                f"{label} line {stamp.line}: all lines or none must name an image; line"
                f" {stamps[0].line} does{'' if named else ' not'}"
            )
        if stamp.name is not None and lines.setdefault(stamp.name, stamp.line) != stamp.line:
            raise DataError(
                f"{label} line {stamp.line}: {stamp.name} is on line {lines[stamp.name]} already"
            )
    if named:
        stamps = sorted(stamps, key=lambda stamp: stamp.t_ns)
    for before, stamp in pairwise(stamps):
        if stamp.t_ns <= before.t_ns:
            raise DataError(
                f"{label} line {stamp.line}: times must increase; {seconds(stamp.t_ns)} s is not"
                f" after the {seconds(before.t_ns)} s of line {before.line}"
            )
    return stamps


def seconds_to_ns(times: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return float64 times [s] as integer nanoseconds, with no loss beyond that of the float."""
    whole = np.floor(times)
    # the fraction is exact in float64, while t * 1e9 would round a second time
    return whole.astype(np.int64) * NS_PER_S + np.rint((times - whole) * NS_PER_S).astype(np.int64)


def constant_rate(
    stamps_ns: Sequence[int], *, stated_hz: float, tolerance_ns: int
) -> FrameRate | None:
    """Return the constant frame rate that stamps rounded to a coarse clock stand for, or None.

    The rates tried are the whole numbers and the whole numbers over 1.001 (24000/1001,
    30000/1001, ...) within 0.2 % of the stated or the mean rate, nearest first, then the stated
    rate itself.

    Parameters
    ----------
    stamps_ns : sequence of int
        Times of all frames, increasing [ns].
    stated_hz : float
        Rate that the container states; 0 if it does not.
    tolerance_ns : int
        How far a stamp may lie from its place at the constant rate: one tick of the clock [ns].
    """
    if len(stamps_ns) < 2:
        return None
    since_first = np.asarray(stamps_ns, dtype=np.int64) - stamps_ns[0]
    mean_hz = (len(stamps_ns) - 1) * NS_PER_S / max(int(since_first[-1]), 1)
    numbers = np.arange(len(stamps_ns))
    for hz in _candidates(stated_hz, mean_hz):
        places = numbers * (NS_PER_S / float(hz))
        if np.all(np.abs(since_first - places) <= tolerance_ns):
            return FrameRate(hz)
    return None


def _candidates(stated_hz: float, mean_hz: float) -> list[Fraction]:
    candidates = rates_near(stated_hz) + rates_near(mean_hz)
    if stated_hz > 0:
        candidates.append(Fraction(stated_hz).limit_denominator(1001))
    return [hz for hz in candidates if hz > 0]


def rates_near(about: float) -> list[Fraction]:
    """Return the usual rates within 0.2 % of one [Hz], nearest first: whole, or over 1.001."""
    whole, broadcast = Fraction(round(about)), Fraction(round(about * 1.001) * 1000, 1001)
    near = [hz for hz in (whole, broadcast) if hz > 0 and abs(float(hz) - about) <= 0.002 * about]
    return sorted(near, key=lambda hz: abs(float(hz) - about))
