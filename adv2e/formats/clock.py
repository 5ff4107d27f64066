"""The unit of a recording's times: of its events, and of the frames beside them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.events import Events
from adv2e.sources.times.instants import seconds
from adv2e.sources.times.units import SETTLED, Unit, event_unit

_FEW = 100
"""So few events may well lie in a small part of the recording."""
_APART = 300
"""Events and frames that differ in length by this factor are in doubt."""


@dataclass(frozen=True)
class Beside:
    """Two or more frames beside the events: the unit of their times, and how these are written.

    Parameters
    ----------
    unit : Unit
    whole : bool
        As whole numbers.
    """

    unit: Unit
    whole: bool


@dataclass(frozen=True)
class Clock:
    """What is known of the unit of a recording's times.

    Where the times of frames and events are written in different ways, one of them as whole
    numbers, what the user says is meant for that one: the other is in seconds.

    Parameters
    ----------
    given : {'s', 'ms', 'us', 'ns'}, optional
        What the user says.
    stated : {'s', 'ms', 'us', 'ns'}, optional
        What we wrote, as the file says; it stays, so that other files beside it may be settled.
    beside : Beside, optional
        The frames.
    """

    given: str | None = None
    stated: str | None = None
    beside: Beside | None = None

    def of_events(
        self, t: NDArray[Any], x: NDArray[Any], y: NDArray[Any], size: Any, *, whole: bool
    ) -> Unit:
        """Return the unit of the times of events.

        Parameters
        ----------
        t, x, y : arrays, (events,)
            Times as the file has them, columns and rows; of all events, or of the first.
        size : (int, int) or None
            Width and height, where the file states them.
        whole : bool
            Times are written as whole numbers.
        """
        if self.stated is not None:
            return Unit(self.stated)
        if size is None:
            size = (int(x.max()) + 1, int(y.max()) + 1) if t.size else (1, 1)
        alike = self.beside is None or self.beside.whole == whole
        return event_unit(
            t,
            max(1, size[0] * size[1]),
            whole=whole,
            given=self.given if alike or whole else None,
            beside=self.beside.unit if self.beside is not None and alike else None,
        )

    def given_for_frames(self, *, whole: bool, events_whole: bool) -> str | None:
        """Return what the user says, if it is meant for the times of the frames."""
        return self.given if self.stated is None and (whole or not events_whole) else None


def disagreement(events: Events, times_ns: NDArray[np.int64] | None) -> list[str]:
    """Return what is to be told of events and frames that seem to be on different clocks.

    Parameters
    ----------
    events : Events
        Sorted by time.
    times_ns : array of int64 or None
        Times of the frames [ns].
    """
    if times_ns is None or len(times_ns) < 2 or len(events) < _FEW:
        return []
    begin, end = int(events["t"][0]) * 1000, int(events["t"][-1]) * 1000
    first, last = int(times_ns.min()), int(times_ns.max())
    length, frames_length = max(end - begin, 1), max(last - first, 1)
    alike = 1 / _APART < length / frames_length < _APART
    if alike and begin <= last and first <= end:
        return []
    return [
        f"events are from {seconds(begin)} to {seconds(end)} s, frames from {seconds(first)} to"
        f" {seconds(last)} s: are some in another unit? {SETTLED}"
    ]
