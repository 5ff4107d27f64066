"""The label that events carry: what of them was guessed, made up, clipped and left out.

A guess, and what is left out, is told in a line for people.  Such a line goes where all lines go,
as a text; what writes events, or reports of them, takes their label from it, and ``--strict``
refuses the guesses among them.  docs/label.md has the keys.
"""

from __future__ import annotations

import math
from array import array
from collections.abc import Callable, Container, Iterable, Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.errors import DataError

ENCODING, WHITE = "frames.encoding", "frames.full_scale"
"""Keys of what the numbers of frames stand for."""

_GAP = 1.5
"""Intervals between frames that are longer than so many usual ones are gaps."""


class Line(str):
    """A line for people, and its entry in a part of the label; `settle` says a guess better."""

    part: str
    entry: Any
    settle: str

    def __new__(cls, text: str, part: str = "", entry: Any = None, settle: str = "") -> Line:
        """Make one of a text; a copy is made of the text alone, and then filled."""
        line = super().__new__(cls, text)
        line.part, line.entry, line.settle = part, entry, settle
        return line

    def like(self, text: str) -> Line:
        """Return another text with the same entry."""
        return Line(text, self.part, self.entry, self.settle)


def guessed(text: str, what: str, value: Any, settle: str = "", why: str = "") -> Line:
    """Return a line that tells a guess.

    Parameters
    ----------
    text : str
        The line, without the name of a file: it may be the reason, too.
    what, value : str, object
        What is guessed, such as a key of the configuration, and what it is taken for.
    settle : str
        What says it; default: the key.
    why : str
        The reason, in a few words.
    """
    entry = {"what": what, "value": value, "why": why or text}
    return Line(text, "guessed", entry, settle or f"give --set {what}=...")


def left_out(text: str, entry: str = "") -> Line:
    """Return a line that tells what is left out; `entry` where the label has it shorter."""
    return Line(text, "left_out", entry or text)


def told_of(place: object, line: str) -> str:
    """Return a line with the name of its place before it, which the label leaves out."""
    text = f"{place}: {line}"
    return line.like(text) if isinstance(line, Line) else text


class Label:
    """The label of events in the making: lines that are told go by it.

    Parameters
    ----------
    tell : callable
        Takes the lines that it is called with.
    before : dict, optional
        Label that the events have already.
    said : collection of str
        Keys that somebody says, so that what was guessed of them does not count.

    Attributes
    ----------
    entries : dict
        The label, as files hold it; it grows with what comes.
    """

    def __init__(
        self, tell: Callable[[str], object] = str, before: Any = None, said: Container[str] = ()
    ) -> None:
        self._tell, self._said = tell, said
        self._guesses: dict[str, None] = {}
        self.entries: dict[str, Any] = dict(before) if isinstance(before, dict) else {}
        for part in ("guessed", "left_out"):
            held = self.entries.get(part)
            self.entries[part] = [*held] if isinstance(held, list) else []

    def __call__(self, line: str) -> None:
        """Tell a line, and take it."""
        self.add(line)
        self._tell(line)

    def add(self, *lines: str) -> None:
        """Take what of the lines belongs into the label."""
        for line in lines:
            if isinstance(line, Line) and line.part == "guessed":
                what, value = line.entry["what"], line.entry["value"]
                if what in self._said:
                    continue
                self._guesses[f"{what}: {value} is a guess: {line.settle}"] = None
            if isinstance(line, Line) and line.entry not in self.entries[line.part]:
                self.entries[line.part].append(line.entry)

    def refuse(self, path: object, *lines: str) -> None:
        """Take lines; raise DataError if there are guesses: it names all, and what says each."""
        self.add(*lines)
        if self._guesses:
            raise DataError(f"{path}: {'; '.join(self._guesses)}")


def report_of(metadata: Mapping[str, Any], lines: Iterable[str]) -> dict[str, Any] | None:
    """Return the label of events that were read, for a report, with the versions that made them.

    `metadata` are those of their file, `lines` what was told when it was read.  None: nothing is
    known of the events, and nothing was guessed to read them.
    """
    lines = [line for line in lines if isinstance(line, Line)]
    if not lines and "label" not in metadata:
        return None
    made = {name: metadata[name] for name in ("adv2e", "versions") if name in metadata}
    label = Label(before=metadata.get("label"))
    label.add(*lines)
    return {**made, **label.entries}


class Seen:
    """What frames show of themselves in passing, counted one by one.

    Parameters
    ----------
    white : float
        Their number for white.
    dtype : dtype
        That of their numbers.
    floor : float, optional
        Light up to which the pixel sees no difference, in numbers of the light that comes; None:
        there is none.
    """

    def __init__(self, white: float, dtype: np.dtype[Any], floor: float | None = None) -> None:
        top = white if dtype.kind == "f" else min(math.ceil(white), np.iinfo(dtype).max)
        # a number of the type of the frames: with others, it takes longer to compare
        self._top, self._floor, self._reaches = dtype.type(top), floor, top >= white
        self._times_ns = array("q")
        self._last: tuple[NDArray[Any] | None, Any] = None, None
        self._ends = np.zeros(2, np.int64)  # of the last frame: values at 0, and at white
        self._total = np.zeros(2, np.int64)
        self._values = self._pixels = self._dark = self._repeated = 0

    def add(self, t_ns: int, image: NDArray[Any], offset: Any, light: NDArray[Any]) -> None:
        """Take note of a frame: its time [ns], numbers, place on a path, and light."""
        last, place = self._last
        is_equal = image is last or (last is not None and _are_equal(image, last))
        if not is_equal:
            full = np.count_nonzero(image >= self._top) if self._reaches else 0
            self._ends[:] = image.size - np.count_nonzero(image), full
        self._total += self._ends
        self._repeated += is_equal and offset == place
        self._last = image, offset
        self._times_ns.append(t_ns)
        self._values += image.size
        if self._floor is not None:
            self._pixels += light.size
            self._dark += int(np.count_nonzero(light <= self._floor))

    def label(self, interpolation: str, exposure_us: float) -> dict[str, Any]:
        """Return ``made_up`` and ``clipped``; an exposure of 0 is not known [us]."""
        steps = np.diff(np.array(self._times_ns)) / 1000
        usual, whole = float(np.median(steps)), float(steps.sum())
        gaps = steps[steps > _GAP * usual]
        ends = (self._total / self._values).tolist()
        return {
            "made_up": {
                "interpolation": interpolation,
                "share": max(0.0, 1 - exposure_us * steps.size / whole),
                "interval_us": usual,
                "longest_us": float(steps.max()),
                "gaps": gaps.size,
                "gap_share": float(gaps.sum()) / whole,
                "repeated": self._repeated,
            },
            "clipped": dict(zip(("black", "white"), ends, strict=True))
            | ({} if self._floor is None else {"floor": self._dark / self._pixels}),
        }


def _are_equal(image: NDArray[Any], other: NDArray[Any]) -> bool:
    """Tell whether frames are equal; of most, some rows tell that they are not."""
    step = max(1, len(image) // 8)
    return np.array_equal(image[::step], other[::step]) and np.array_equal(image, other)


def rows_of(label: Any) -> Iterator[tuple[str, str]]:
    """Yield a label in pairs of a name and a short text, for people."""
    try:
        yield from list(_rows(label))
    except (AttributeError, KeyError, TypeError, ValueError):
        yield "label", "damaged: it is not as adv2e writes it"


def _rows(label: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    for one in label["guessed"]:
        yield "guessed", f"{one['what']} {one['value']} ({one['why']})"
    if "sha256" in label and not label["guessed"]:  # of others, only the copying is known
        yield "guessed", "nothing"
    if made_up := label.get("made_up"):
        told = "light between frames, by {interpolation} interpolation: {share:.3g} % of the time;"
        told += " frames are {interval_us:.6g} ms apart"
        scaled = {name: 100 * made_up[name] for name in ("share", "gap_share")}
        scaled |= {name: made_up[name] / 1000 for name in ("interval_us", "longest_us")}
        if made_up["gaps"]:
            told += "; {gaps} gaps of up to {longest_us:.6g} ms, {gap_share:.3g} % of the time"
        if made_up["repeated"]:
            told += "; {repeated} frames repeat the one before"
        yield "made up", told.format(**{**made_up, **scaled})
    if clipped := label.get("clipped"):
        told = "{black:.3g} % of the numbers are 0, {white:.3g} % are white"
        told += "; {floor:.3g} % of the pixels see no light" if "floor" in clipped else ""
        yield "clipped", told.format(**{name: 100 * share for name, share in clipped.items()})
    for one in label["left_out"]:
        yield "left out", str(one)
