"""When the pictures of a video are shown."""

from __future__ import annotations

from collections.abc import Callable

from adv2e.sources.base import GivenTimes
from adv2e.sources.containers import Container
from adv2e.sources.times import NS_PER_S, FrameRate, Stamp, constant_rate

Clock = Callable[[int, int], int]
"""Time [ns] of a frame, from its number and its own stamp since the first [ns]."""


def clock_of(
    given: GivenTimes, listed: list[Stamp] | None, container: Container, fps: float
) -> Clock:
    """Return the clock of a video.

    Parameters
    ----------
    given : GivenTimes
        Times in place of the file's own.
    listed : list of Stamp or None
        The times in the file that `given` names, if it names one.
    container : Container
        What the file's headers say.
    fps : float
        Rate that FFmpeg found [Hz]; 0 if it found none.
    """
    if (rate := given.rate) is not None:
        return lambda number, _: rate.time_ns(number)
    if listed is not None:
        return lambda number, _: listed[number].t_ns
    return _snapped_rate(container, fps) or _own_time


def _snapped_rate(container: Container, fps: float) -> Clock | None:
    stamps_ns, tick_ns = container.stamps_ns, container.tick_ns
    if stamps_ns is None:
        return None
    # VP8 has blocks that are never shown, at the time of the block after them
    for times_ns in (stamps_ns, sorted(set(stamps_ns))):
        rate = constant_rate(times_ns, stated_hz=fps, tolerance_ns=tick_ns)
        if rate is not None:
            return _snapping(rate, tick_ns)
    return None


def _own_time(_: int, own_ns: int) -> int:
    return own_ns


def _snapping(rate: FrameRate, tick_ns: int) -> Clock:
    def time_ns(number: int, own_ns: int) -> int:
        at_number = rate.time_ns(number)
        if abs(at_number - own_ns) <= tick_ns:
            return at_number
        # frames that could not be shown are missing before this one
        return rate.time_ns(round(own_ns * rate.hz / NS_PER_S))

    return time_ns
