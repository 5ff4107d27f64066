"""Sources whose frames are all known before the first is read: images, recordings, stacks."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from adv2e.errors import DataError
from adv2e.sources.base import (
    GivenTimes,
    Image,
    Light,
    Pixels,
    Selection,
    Shot,
    Source,
    check_values,
)
from adv2e.sources.times import Stamp, parse_times, read_text

_LONG_S = 10.0
"""Mean time between frames from which on their times are doubted [s]."""


@dataclass(frozen=True)
class Picture:
    """A frame without a time: label for messages, name in lists (if any), loader."""

    label: str
    name: str | None
    load: Callable[[], Image | Pixels]


def given_shots(given: GivenTimes, pictures: Sequence[Picture], path: Path) -> list[Shot]:
    """Return the pictures at the times that the user gave.

    Parameters
    ----------
    given : GivenTimes
        A rate or a file.
    pictures : sequence of Picture
        Every picture, in order.
    path : Path
        Where they are, for messages.

    Raises
    ------
    DataError
        The file cannot be read or has times for other pictures.
    """
    if (rate := given.rate) is not None:
        return [Shot(rate.time_ns(n), p.label, p.load) for n, p in enumerate(pictures)]
    assert given.timestamps is not None
    label = str(given.timestamps)
    stamps = parse_times(read_text(given.timestamps), label)
    if len(stamps) != len(pictures):
        raise DataError(f"{label}: {len(stamps)} times for the {len(pictures)} frames of {path}")
    return listed_shots(stamps, label, pictures, path)


def listed_shots(
    stamps: Sequence[Stamp], label: str, pictures: Sequence[Picture], path: Path
) -> list[Shot]:
    """Return the pictures that a list of times names, or all in order if it names none.

    Raises
    ------
    DataError
        A picture is missing, with the line of the list; or a list without names is of another
        length.
    """
    if stamps[0].name is None or pictures[0].name is None:
        if len(stamps) != len(pictures):
            raise DataError(
                f"{label}: {len(stamps)} times for the {len(pictures)} frames of {path}"
            )
        pairs = zip(stamps, pictures, strict=True)
        return [Shot(stamp.t_ns, picture.label, picture.load) for stamp, picture in pairs]
    by_name = {picture.name: picture for picture in pictures}
    shots = []
    for stamp in stamps:
        # lists name pictures from where they were written: only the last part holds here
        name = PurePosixPath(stamp.name or "").name
        if name not in by_name:
            raise DataError(f"{label} line {stamp.line}: no image {name} in {path}")
        shots.append(Shot(stamp.t_ns, by_name[name].label, by_name[name].load))
    return shots


class ListedSource(Source):
    """A source whose frames and times are all known before the first is read.

    Parameters
    ----------
    path : Path
        What was opened.
    kind : str
        The kind of source.
    shots : sequence of Shot
        Every frame, in the order of time.
    selection : Selection
        Frames wanted.
    has_clock : bool
        Times are on a clock of the source's own.
    light : Light, optional
        What the numbers stand for, where the kind of source decides and not the image.

    Raises
    ------
    DataError
        Fewer than two frames, in all or selected, or an unreadable first frame.
    """

    def __init__(
        self,
        path: Path,
        kind: str,
        shots: Sequence[Shot],
        selection: Selection,
        *,
        has_clock: bool,
        light: Light | None = None,
    ) -> None:
        super().__init__(path, kind, selection, has_clock)
        self._shots = shots
        self._count()
        first = shots[0].load()
        self._describe(first, shots[0].label, light)
        image = first.image if isinstance(first, Pixels) else first
        check_values(image, shots[0].label)
        apart_s = (shots[-1].t_ns - shots[0].t_ns) * 1e-9 / (len(shots) - 1)
        if has_clock and apart_s > _LONG_S:
            self.doubts.append(f"{path}: frames are {apart_s:,.0f} s apart; times are in seconds")
        if image.dtype.kind == "f":
            self.largest = float(image.max())
        if self.largest is not None and self.largest > 1:
            self.notes.append(
                f"values above 1.0 (up to {self.largest:g} in the first frame); white is 1.0 unless"
                " frames.full_scale says otherwise"
            )

    def _count(self) -> None:
        if len(self._shots) < 2:
            raise DataError(
                f"{self.path}: {'a single frame' if self._shots else 'no frames'}; at least two"
                " are needed"
            )
        first_ns = self._shots[0].t_ns
        chosen = self.selection
        inside = (chosen.start_ns <= s.t_ns - first_ns <= chosen.stop_ns for s in self._shots)
        self.count = sum(inside)
        if self.count < 2:
            raise self._too_few(self.count, self._shots[-1].t_ns - first_ns)

    def shots(self) -> Iterator[Shot]:
        """Yield every frame, not loaded."""
        return iter(self._shots)
