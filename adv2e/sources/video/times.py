"""When the pictures of a video are shown, and whether all of them came out of the decoder.

Containers differ in what they say.  MP4, Matroska, MPEG-TS and others state when each picture is
shown.  AVI knows nothing but a rate, and when pictures are decoded; ASF states times of
decoding; MPEG-PS states a time for some pictures.  FFmpeg passes on what there is, and has nothing
for the last pictures of those, as they leave the decoder after its last packet.

OpenCV leaves out what its decoder refuses, and says nothing.  Pictures that were expected and did
not come tell, but for those that no decoder shows: pictures before the first that can stand alone,
and second fields where each field is stored as a picture.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable, Sequence
from fractions import Fraction
from itertools import pairwise
from statistics import median

import numpy as np

from adv2e.sources.times.instants import NS_PER_S, seconds
from adv2e.sources.times.rates import FrameRate, constant_rate, rates_near
from adv2e.sources.video.containers import Container
from adv2e.sources.video.packets import Packets

Clock = Callable[[int, int | None], int]
"""Time [ns] of a frame, from its number and its own stamp since the first [ns], if it has one.

It is asked for all frames in their order, once.
"""

_NEAR_NS = 2000
"""By so much may stamps of a decoder differ from those of an index."""
_MOVED = 4.5
"""Intervals by which FFmpeg's guesses are off where times are those of decoding."""
_ROUNDED = 0.02
"""Intervals by which times are off that FFmpeg fills in, in whole ticks."""
_CLEAR_SHARE = 0.5
"""Share of the pictures whose times are known from which on their mean tells the rate."""


class VideoTimes:
    """What is known of the times of a video's pictures, before any is decoded.

    Parameters
    ----------
    container : Container
        What the headers say.
    packets : Packets or None
        The coded pictures, where the headers do not list them.
    fps : float
        Rate that FFmpeg found [Hz]; 0 if it found none.

    Attributes
    ----------
    shown_ns : list of int
        When the pictures are shown as far as that is known, sorted [ns].
    expected : int or None
        How many pictures there are; None where nothing tells.
    rate : FrameRate or None
        The rate at which all pictures are, where there is one.
    doubts : list of str
        What is guessed, and what may be wrong.
    """

    def __init__(self, container: Container, packets: Packets | None, fps: float) -> None:
        self._container, self._packets = container, packets
        self._snaps_within_ns = container.tick_ns
        self._grid: Fraction | None = None
        self.rate: FrameRate | None = None
        self.doubts: list[str] = []
        if packets is None:
            stamps_ns = container.stamps_ns or []
            self.shown_ns = sorted(set(stamps_ns))
            counted = len(self.shown_ns)
            if container.rate is not None:
                self.rate = FrameRate(container.rate)
            elif container.tick_ns:
                self.rate = _behind(stamps_ns, container.tick_ns, fps)
        else:
            self.shown_ns, counted = packets.known_ns, packets.count
            if container.decoding_times or packets.unstamped:
                self._grid = container.rate
                self._find_rate(container, packets, fps)
        self.expected = max(counted, container.pictures or 0) or None
        steps = [after - before for before, after in pairwise(self.shown_ns)]
        if self.rate is not None:
            self._usual_ns = self.rate.time_ns(1)
        else:
            nominal = NS_PER_S / fps if fps > 0 else NS_PER_S
            self._usual_ns = round(median(steps) if steps else nominal)
        last_ns = self.shown_ns[-1] - self.shown_ns[0] if self.shown_ns else 0
        if container.end_ns and last_ns + _MOVED * self._usual_ns < container.end_ns:
            self.doubts.append(
                f"it states a length of {seconds(container.end_ns)} s, and its last picture is at"
                f" {seconds(last_ns)} s: cut short or damaged"
            )

    def _find_rate(self, container: Container, packets: Packets, fps: float) -> None:
        known, count = packets.known_ns, packets.count
        hz = None
        if not packets.back and not packets.tiny:
            hz = _standing(known, count, container.rate, fps, container.tick_ns or 1000)
        if hz is not None:
            self.rate, self._snaps_within_ns = FrameRate(hz), round(_MOVED * NS_PER_S / hz)
        if count > len(known):
            rest = f"taken at {float(hz):.6g} frames a second" if hz else "the others follow"
            self.doubts.append(f"it states times for {len(known)} of its {count} frames: {rest}")

    @property
    def zero_means_none(self) -> bool:
        """Whether a frame beyond the first whose stamp is zero has none."""
        return self._packets is not None

    def lost(self, stamps_ns: Sequence[int | None]) -> int:
        """Return how many pictures are missing, from the stamps of those that came [ns].

        Stamps are as FFmpeg counts them, not from the first that came.
        """
        if self.expected is None:
            return 0
        known = self._packets or self._container
        shown_ns = self.shown_ns
        if self._packets is None:  # FFmpeg counts from the first
            shown_ns = [t_ns - shown_ns[0] for t_ns in shown_ns]
        lost = lost_pictures(self.expected, stamps_ns, shown_ns, known.leading)
        return max(lost - known.tiny, 0)

    def clock(self, *, in_order: bool = True) -> Clock:
        """Return a clock for one pass over the frames.

        `in_order`: stamps that are those of decoding are brought into the order of showing, as
        OpenCV does.
        """
        previous = -self._usual_ns
        packets = self._packets
        of_decoding = not in_order and self._container.decoding_times
        listed = of_decoding and packets is not None and packets.complete

        def time_ns(number: int, own_ns: int | None) -> int:
            nonlocal previous
            if self.rate is not None:
                previous = self._at_rate(self.rate, number, None if of_decoding else own_ns)
            elif listed and number < len(self.shown_ns):
                previous = self.shown_ns[number] - self.shown_ns[0]
            elif own_ns is not None:
                previous = own_ns if self._grid is None else _snapped(own_ns, self._grid)
            else:
                previous += self._usual_ns
            return previous

        return time_ns

    def _at_rate(self, rate: FrameRate, number: int, own_ns: int | None) -> int:
        at_number = rate.time_ns(number)
        if own_ns is None or abs(at_number - own_ns) <= self._snaps_within_ns:
            return at_number
        # frames that could not be shown are missing before this one
        return _snapped(own_ns, rate.hz)


def _snapped(own_ns: int, hz: Fraction) -> int:
    return FrameRate(hz).time_ns(round(own_ns * hz / NS_PER_S))


def _behind(stamps_ns: Sequence[int], tick_ns: int, fps: float) -> FrameRate | None:
    """Return the rate behind stamps of a coarse clock."""
    # VP8 has blocks that are never shown, at the time of the block after them
    for times_ns in (stamps_ns, sorted(set(stamps_ns))):
        rate = constant_rate(times_ns, stated_hz=fps, tolerance_ns=tick_ns)
        if rate is not None:
            return rate
    return None


def _standing(
    known_ns: Sequence[int], count: int, stated: Fraction | None, fps: float, tick_ns: int
) -> Fraction | None:
    """Return the rate at which `count` pictures are if some of them are at the times known."""
    if not known_ns or count < 2:
        return None
    span_ns = known_ns[-1] - known_ns[0]
    clear = len(known_ns) > _CLEAR_SHARE * count
    tried = [stated] if stated is not None else []
    for about in (fps, (len(known_ns) - 1) * NS_PER_S / span_ns if clear and span_ns else 0):
        tried += rates_near(about)
    if clear and fps > 0:
        tried.append(Fraction(fps).limit_denominator(1001))
    since_first = np.array(known_ns, dtype=np.int64) - known_ns[0]
    for hz in tried:
        places = since_first * (float(hz) / NS_PER_S)
        numbers = np.rint(places)
        within = max(2 * tick_ns * float(hz) / NS_PER_S, _ROUNDED)
        near = np.all(np.abs(places - numbers) <= within) and np.all(np.diff(numbers) > 0)
        if near and numbers[-1] < count:
            return hz
    return None


def lost_pictures(
    expected: int, stamps_ns: Sequence[int | None], shown_ns: Sequence[int], leading: int = 0
) -> int:
    """Return how many of the expected pictures are missing behind the first that came.

    `stamps_ns` are those of the pictures that came; FFmpeg has none for those that it held back to
    the end.  `shown_ns` are when all are shown on the same clock, as far as known, sorted;
    `leading` of them are before the first in the file, at which that clock may begin.
    """
    missing = expected - len(stamps_ns)
    if missing <= 0:
        return 0
    if abs(expected - 2 * len(stamps_ns)) <= 2 and _is_even(stamps_ns):
        return 0  # two fields a picture
    held = 0
    for stamp in reversed(stamps_ns):
        if stamp is not None:
            break
        held += 1
    first = next((stamp for stamp in stamps_ns if stamp is not None), 0)
    # the first comes out late by as many as are held back, and by those that could not be shown
    before = max(bisect_left(shown_ns, first - _NEAR_NS) - held, leading)
    return max(missing - before, 0)


def _is_even(stamps_ns: Sequence[int | None]) -> bool:
    steps = [b - a for a, b in pairwise(stamps_ns) if a is not None and b is not None]
    return len(steps) > 2 and max(steps) - min(steps) <= 0.05 * median(steps)
