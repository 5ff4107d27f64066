"""Windows of events, and what is made of each, in the files that E2VID and its relatives train on.

================================ ==================================================================
NAME/event_tensor_%010d.npy      voxel: float32, (bins, rows, columns); split: (2 bins, ...)
NAME/histogram_%010d.npy         histogram: uint8, (2 bins, rows, columns), OFF first
NAME/time_surface_%010d.npy      surface: float32, (2, rows, columns), OFF and ON
NAME/%010d.png                   picture: colours, (rows, columns, 3)
NAME/timestamps.txt              a line for each: its number and its time, the end of the window [s]
NAME/boundary_timestamps.txt     a line for each: its number, start and end of its window [s]
================================ ==================================================================

References
----------
.. [1] H. Rebecq et al., "High Speed and High Dynamic Range Video with an Event Camera", TPAMI 2021,
   doi:10.1109/TPAMI.2019.2963386; files as in github.com/uzh-rpg/rpg_e2vid and rpg_ramnet.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from itertools import count, pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.errors import DataError
from adv2e.events import Events, Window, cut, empty_events
from adv2e.options import MOST_EMPTY
from adv2e.representations.voxel_grid import (
    Grid,
    own_window,
    robust,
    signed_grid,
    split_grid,
    z_scored,
)

NORMALISATIONS: dict[str, Callable[[Grid], Grid]] = {
    "none": lambda grid: grid,
    "e2vid": z_scored,
    "event_cnn_minimal": robust,
}
"""By name: as counted; zero mean and unit deviation of the cells that are not zero; ``RobustNorm``.

``LegacyNorm`` of event_cnn_minimal is that of e2vid.
"""


@dataclass(frozen=True)
class VoxelSettings:
    """Settings of voxel grids.

    Attributes
    ----------
    bins : int
        Temporal bins.
    normalise : str
        One of `NORMALISATIONS`.
    polarity : {'signed', 'split'}
        One grid in which ON counts +1 and OFF -1; or one of ON above one of OFF.
    span : {'events', 'window'}
        The first and the last bin are at the first and the last event, as E2VID has it, or at the
        ends of the window.
    """

    bins: int = 5
    normalise: str = "none"
    polarity: str = "signed"
    span: str = "events"

    def grid(self, part: Slice, size: tuple[int, int]) -> Grid:
        """Return the grid of a window."""
        whole = part.start_us, part.stop_us
        window = own_window(part.events) if self.span == "events" else whole
        make = signed_grid if self.polarity == "signed" else split_grid
        return NORMALISATIONS[self.normalise](make(part.events, self.bins, size, window))


Save = Callable[[Path, "Slice"], object]
"""Writes what is made of a window; its path has no suffix."""


class WindowFiles:
    """What is made of windows, in a folder, and their times.

    Attributes
    ----------
    count : int
        Windows until now.
    """

    def __init__(self, folder: Path, stem: str, save: Save) -> None:
        self._folder, self._stem, self._save = folder, stem, save
        self.count = 0

    def __enter__(self) -> WindowFiles:
        self._folder.mkdir(parents=True)
        self._files = [
            (self._folder / name).open("w", encoding="ascii", newline="\n")
            for name in ("timestamps.txt", "boundary_timestamps.txt")
        ]
        return self

    def add(self, part: Slice) -> None:
        """Write what is made of a window."""
        self._save(self._folder / f"{self._stem}{self.count:010d}", part)
        start, stop = (f"{t / 1e6:.6f}" for t in (part.start_us, part.stop_us))
        for file, times in zip(self._files, (stop, f"{start} {stop}"), strict=True):
            file.write(f"{self.count} {times}\n")
        self.count += 1

    def __exit__(self, *_: object) -> None:
        for file in self._files:
            file.close()


def saved(path: Path, array: NDArray[Any]) -> None:
    """Write an array, with the suffix that it has."""
    np.save(path.with_name(f"{path.name}.npy"), array, allow_pickle=False)


# ---- Streams of events, cut into the windows of which networks are given a picture each.


@dataclass(frozen=True)
class Slice:
    """The events of a window.

    Attributes
    ----------
    start_us, stop_us : int
        First and last time of the window [us].
    events : array of EVENT_DTYPE
        Sorted.
    """

    start_us: int
    stop_us: int
    events: Events


def by_time(
    parts: Iterable[Events],
    first_us: int,
    length_us: int,
    label: str = "events",
    most_empty: int = MOST_EMPTY,
) -> Iterator[Slice]:
    """Yield windows of one length, [start, start + length), from `first_us` on.

    What is left at the end and is shorter than a window is left out.

    Raises
    ------
    DataError
        More than `most_empty` in a row have no event, as a wrong time makes them.
    """
    windows = ((start, start + length_us) for start in count(first_us, length_us))
    empty = 0
    for one in in_windows(parts, windows, to_the_end=False):
        empty = check_empty(one, empty, label, most_empty)
        yield one


def check_empty(one: Slice, empty: int, label: str, most: int) -> int:
    """Return how many windows in a row have no event; DataError if they are more than `most`."""
    empty = 0 if one.events.size else empty + 1
    if empty > most:
        raise DataError(
            f"{label}: no event in over {most:,} windows of"
            f" {(one.stop_us - one.start_us) / 1000:g} ms, to {one.stop_us * 1e-6:.3f} s:"
            " 'adv2e info' tells gaps that a wrong time makes; a longer --window makes fewer,"
            " --max-empty N allows N"
        )
    return empty


def by_count(parts: Iterable[Events], number: int) -> Iterator[Slice]:
    """Yield windows of so many events each; fewer at the end are left out."""
    held = empty_events()
    for part in parts:
        held = _joined(held, part)
        while held.size >= number:
            taken, held = held[:number], held[number:]
            yield Slice(int(taken["t"][0]), int(taken["t"][-1]), taken)


def between_images(parts: Iterable[Events], times_us: Iterable[int]) -> Iterator[Slice]:
    """Yield the windows from each image to the next, [image, next image)."""
    return in_windows(parts, pairwise(times_us), to_the_end=True)


def before_images(parts: Iterable[Events], times_us: list[int], length_us: int) -> Iterator[Slice]:
    """Yield the windows before each image, [image - length, image)."""
    return in_windows(parts, ((t - length_us, t) for t in times_us), to_the_end=True)


def _joined(held: Events, part: Events) -> Events:
    """Return both, of which the second may have a column more than an empty first."""
    return np.concatenate([held, part]) if held.size else part


def in_windows(
    parts: Iterable[Events], windows: Iterable[Window], *, to_the_end: bool
) -> Iterator[Slice]:
    """Yield the events of windows whose starts never decrease.

    Parameters
    ----------
    parts : iterable of arrays
        Sorted, and so are the events of all of them.
    windows : iterable of (int, int)
    to_the_end : bool
        Windows after the last event are wanted, too; else those that end at the last event or
        before it.
    """
    source = iter(parts)
    held = empty_events()
    ended = False
    for start, stop in windows:
        while not ended and not (held.size and held["t"][-1] >= stop):
            part = next(source, None)
            ended = part is None
            held = cut(held, start, held["t"][-1] + 1) if held.size else held
            held = held if part is None else _joined(held, part)
        if ended and not to_the_end and not (held.size and held["t"][-1] >= stop):
            return
        yield Slice(start, stop, cut(held, start, stop))
