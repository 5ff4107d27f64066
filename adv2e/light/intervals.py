"""Intervals between the frames that the pixel sees, gathered to parts for one call of the kernel.

Linear interpolation is a plan, not an array: each interval ends at a share of the way from one
input frame to the next, and the kernel blends them while it loads a strip.  Other interpolations
make frames of their own.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import chain
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from adv2e.config.model import Sampling
from adv2e.effects.frames.brightness import check_light
from adv2e.effects.hooks import LightFrame
from adv2e.errors import DataError
from adv2e.light.interpolation import make_upsampler
from adv2e.light.interpolation.linear import instant_ns, neighbours
from adv2e.sources.times.rates import seconds

if TYPE_CHECKING:
    from adv2e.light.interpolation.flow import GivenFlow

FRAME_BYTES = 16 << 20
"""Memory for the frames of one part."""

EVENTS = 1_000_000
"""Events that a part should not exceed, judged by the parts before; they are all in memory."""

LONGEST_S = 1000
"""Longest time from a frame to the next: the steps of a pixel grow with it [s]."""

_MOST = 64
_FIRST = 1


@dataclass(frozen=True)
class Part:
    """Intervals for one call of the kernel.

    Attributes
    ----------
    frames : (frames, rows, columns)
        Light [DN], or grey values to be decoded.
    before, share : (intervals + 1[ + 1],)
        The pixel's light at the start, at the end of each interval and, with the printed last
        interval, at the end of one more: `share` of the way from frame `before` to the next.
    times_ns : list of int
        Start, and end of each interval.
    last : (intervals + 1,) bool
        See :class:`adv2e.kernel.inputs.Schedule`.
    """

    frames: NDArray[Any]
    before: NDArray[np.int64]
    share: NDArray[np.float32]
    times_ns: list[int]
    last: NDArray[np.bool_]

    @property
    def until(self) -> NDArray[np.int64]:
        """Number of the next frame's instant, of instants of a frame; of others, of the next one.

        (intervals,); where nothing moves from frame to frame, nothing does in between.
        """
        at_frame = self.share[: len(self.times_ns)] == 1.0
        frames, following = np.flatnonzero(at_frame), np.arange(1, at_frame.size)
        following[frames[:-1]] = frames[1:]
        return following


@dataclass(frozen=True)
class _Instant:
    """A frame that the pixel sees: where it lies between the frames held."""

    before: int
    share: float
    t_ns: int
    ends: bool


class Intervals:
    """Cuts a sequence of frames into parts; neighbouring parts share their border.

    Parameters
    ----------
    t_ns, first : int, (rows, columns)
        Time and light, or grey values, of the first frame.
    threads : int
        For interpolations that take their time.
    given : callable, optional
        Flow; see :func:`adv2e.light.interpolation.make_upsampler`.
    whole : bool
        Parts end with frames of the input, whatever lies between these.
    """

    def __init__(
        self,
        t_ns: int,
        first: NDArray[Any],
        sampling: Sampling,
        *,
        threads: int,
        given: GivenFlow | None = None,
        whole: bool = False,
    ) -> None:
        self._L, self._whole = sampling.L, whole
        self._printed = sampling.last_interval == "printed"
        # without frames in between, there is nothing to interpolate
        linear = sampling.interpolation == "linear" or sampling.L == 1
        self._upsampler = None if linear else make_upsampler(sampling, threads=threads, given=given)
        self._first = t_ns, first
        self._number, self._before_ns = 0, t_ns
        per_frame = self._L if linear else 1
        frames = max(2, min(_MOST // per_frame + 2, FRAME_BYTES // max(1, first.nbytes)))
        # behind the border: up to two frames of it, and one that looks ahead
        dtype = first.dtype if first.dtype == np.uint8 else np.float32
        self._held = np.empty((frames + 3, *first.shape), dtype)
        self._most = max(1, min(_MOST, (frames - 1) * per_frame))
        self._size = min(_FIRST, self._most)
        self._held[0] = first
        self._count = 1
        self._instants = [_Instant(-1, 1.0, t_ns, False)]

    def expect(self, events: int) -> None:
        """Take notice of the events of the part before, to choose the size of the next."""
        wanted = int(EVENTS * self._size / max(events, 1))
        self._size = max(1, min(self._most, 4 * self._size, wanted))

    def parts(self, frames: Iterator[LightFrame], *, ends: bool = True) -> Iterator[Part]:
        """Yield the parts of the frames that follow; each is used up before the next.

        Unless they end there, more may follow in a later call, where interpolation is linear.

        Raises
        ------
        DataError
            A single frame, or times that do not increase, by a nanosecond for each instant.
        """
        ahead = 1 if self._printed else 0
        for instant in self._cut(self._checked(frames)):
            self._instants.append(instant)
            # the times of a part must not grow out of a packed event either
            long = instant.t_ns - self._instants[0].t_ns > LONGEST_S * 10**9
            count = len(self._instants) - 1 - ahead
            is_end = not self._whole or self._instants[count].ends
            if count >= (1 if long else self._size) and is_end:
                yield self._part(count)
                self._drop(count)
        if ends and self._number == 0:
            raise DataError("a single frame: at least two are needed")
        left = len(self._instants) - 1 - (0 if ends else ahead)
        if left > 0:
            yield self._part(left)
            self._drop(left)

    def state(self) -> tuple[Any, ...]:
        """Return the frames held, and all else that later parts depend on; not copied."""
        return self._held[: self._count], self._instants, self._number, self._before_ns

    def load(self, state: tuple[Any, ...]) -> None:
        """Go on from a state."""
        held, self._instants, self._number, self._before_ns = state
        self._count = len(held)
        self._held[: self._count] = held

    def _checked(self, frames: Iterator[LightFrame]) -> Iterator[LightFrame]:
        for number, (now_ns, now) in enumerate(frames, start=self._number + 1):
            before_ns = self._before_ns
            if now_ns <= before_ns:
                raise DataError(
                    f"frame {number}: its time {now_ns * 1e-9:.9f} s is not after the one before"
                    f" ({before_ns * 1e-9:.9f} s)"
                )
            if now_ns - before_ns < self._L:
                raise DataError(
                    f"frame {number}: {now_ns - before_ns} ns after the one before, too near for"
                    f" {self._L} instants from one to the other (sampling.L)"
                )
            if now_ns - before_ns > LONGEST_S * 10**9:
                raise DataError(
                    f"frame {number}: {seconds(now_ns - before_ns)} s after the one before, at"
                    f" {seconds(now_ns)} s; {LONGEST_S} s is the longest that is simulated: are"
                    " the times in another unit?"
                )
            yield now_ns, now
            self._number, self._before_ns = number, now_ns

    def _hold(self, frame: NDArray[Any]) -> int:
        self._held[self._count] = frame
        self._count += 1
        return self._count - 2

    def _cut(self, frames: Iterator[LightFrame]) -> Iterator[_Instant]:
        upsampler = self._upsampler
        if upsampler is None:
            count = self._L
            for now_ns, now in frames:
                before_ns = self._before_ns
                self._hold(now)
                for step in range(1, count + 1):
                    share, t_ns = step / count, instant_ns(before_ns, now_ns, step, count)
                    yield _Instant(self._count - 2, share, t_ns, step == count)
            return
        for (start_ns, a), (stop_ns, b), beside in neighbours(chain([self._first], frames)):
            count = upsampler.count(a, b, beside)
            for step, made in enumerate(upsampler.between(a, b, beside), start=1):
                t_ns = instant_ns(start_ns, stop_ns, step, count)
                check_light(made, f"a frame made {t_ns * 1e-9:.6f} s in")
                yield _Instant(self._hold(made), 1.0, t_ns, step == count)

    def _part(self, intervals: int) -> Part:
        used = self._instants
        last = np.zeros(intervals + 1, np.bool_)
        if self._printed:
            ends = [instant.ends for instant in used[1 : intervals + 2]]
            last[: len(ends)] = ends
        return Part(
            frames=self._held[: self._count],
            before=np.array([instant.before for instant in used], np.int64),
            share=np.array([instant.share for instant in used], np.float32),
            times_ns=[instant.t_ns for instant in used[: intervals + 1]],
            last=last,
        )

    def _drop(self, intervals: int) -> None:
        """Forget the intervals of a part and the frames that no later one needs."""
        kept = self._instants[intervals:]
        # the border instant may need the frame before it, too
        first = kept[0].before + (1 if kept[0].share == 1.0 else 0)
        self._held[: self._count - first] = self._held[first : self._count].copy()
        self._count -= first
        self._instants = [
            _Instant(instant.before - first, instant.share, instant.t_ns, instant.ends)
            for instant in kept
        ]
