r"""Interpolation along the motion: edges move from one frame to the next instead of fading.

Optical flow is found in both directions (:mod:`adv2e.motion.estimate`).  For the time
l/L of the interval every pixel of both frames is sent its share of the way [1]_, which bends as the
frames before and after the interval tell (:mod:`adv2e.motion.estimate`); where
several arrive, the one whose light agrees best with the other frame is in front.  The light there
is that of both frames at the ends of this path, blended by l/L; of one frame where the other does
not see it; and blended in place where no motion is known, as
:mod:`adv2e.light.interpolation.linear` does everywhere.  Light is moved linear and unrounded; only
the motion is found on a logarithmic 8-bit picture.

A pixel at rest that has the same light in both frames keeps it to the last bit, unless something
moves over it.  Frames too small for the search (see `SMALLEST`), equal frames and cuts are
interpolated linearly.

What it cannot do: when something is hit is not told if that is in the middle of an interval, or
twice in three of them; light that changes while it moves is blended; things smaller than their step
from frame to frame, steps above about a fifth of the picture's height, and textures that repeat
within a few steps are mostly not found and fade as with linear; the noise of dim frames is carried
along, which makes more false events than blending it in place.
``docs/light.md`` has the numbers.

References
----------
.. [1] S. Baker, D. Scharstein, J. P. Lewis, S. Roth, M. J. Black, R. Szeliski, "A Database and
   Evaluation Methodology for Optical Flow", IJCV 92, 2011, doi:10.1007/s11263-010-0390-2
   (interpolation by sending pixels on, the photometrically best on top).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.light.interpolation.linear import NOTHING, Beside, LinearUpsampler, check_pair, ordered
from adv2e.motion.estimate import Bend, Motion, Side, bends, estimate_motion, fastest, is_unchanged
from adv2e.motion.warping import UNKNOWN, compose, splat

# ---- Paths of the pixels through an interval, and how many frames it needs.
#
# With ``sampling.max_motion_px`` an interval gets as few frames as keep every pixel of both its
# frames from moving further than that from one instant to the next,
#
# .. math:: n = \min\left(L, \left\lceil v / d \right\rceil\right)
#
# with the fastest velocity v on any path [px per interval] and the distance d. It gets one where
# nothing changes by more than 1 %. It gets L of them where motion is not known: across a cut, in
# frames too small for the search, where some pixel has none, or where what was found leaves more
# than half of the change of light unexplained.


Array = NDArray[Any]
Pair = tuple[Motion, Motion]
Bent = tuple[Bend, Bend] | None

_UNEXPLAINED_MOST = 0.5

GivenFlow = Callable[[int], NDArray[np.float32]]


@dataclass(frozen=True)
class Way:
    """Motion paths of the pixels from each frame of an interval to the other frame.

    Attributes
    ----------
    motion : (Motion, Motion), or None
        From the first frame to the second and back; None: not known.
    bent : (Bend, Bend), or None
        Bends of the paths; None: they are straight.
    count : int
        Frames that the interval gets.
    """

    motion: Pair | None
    bent: Bent
    count: int


class Paths:
    """Finds the paths of one interval after the other.

    Parameters
    ----------
    L : int
        Most frames an interval gets.
    max_motion_px : float, optional
        Furthest that a pixel may move from one frame to the next [px]; None: always `L` frames.
    given : callable, optional
        Returns the flow from a frame to the next by the number of the first, (rows, columns, 2);
        default: it is looked for.
    """

    def __init__(
        self, L: int, max_motion_px: float | None = None, given: GivenFlow | None = None
    ) -> None:
        self.L, self._max_motion_px, self._given = L, max_motion_px, given
        self._asked = 0
        self._motions: list[tuple[Array, Array, Pair | None]] = []
        self._last: tuple[Array, Array, Way] | None = None

    def of(self, a: Array, b: Array, beside: Beside) -> Way:
        """Return the motion paths from `a` to `b`; those of the last interval are kept."""
        if self._last is None or self._last[0] is not a or self._last[1] is not b:
            motion = self._motion(a, b)
            bent = None if motion is None else bends(*motion, *self._sides(a, b, beside))
            self._last = a, b, Way(motion, bent, self._count(a, b, motion, bent))
        return self._last[2]

    def count(self, a: Array, b: Array, beside: Beside) -> int:
        """Return the number of frames for the interval from `a` to `b`; it may need no motion."""
        return self.L if self._max_motion_px is None else self.of(a, b, beside).count

    def _count(self, a: Array, b: Array, motion: Pair | None, bent: Bent) -> int:
        if self._max_motion_px is None:
            return self.L
        if motion is None:
            return 1 if is_unchanged(a, b) else self.L
        if any(
            one.unexplained > _UNEXPLAINED_MOST or np.any(one.score >= UNKNOWN) for one in motion
        ):
            return self.L
        speeds = map(fastest, motion, bent or (None, None))
        return max(1, min(self.L, math.ceil(max(speeds) / self._max_motion_px)))

    def _sides(self, a: Array, b: Array, beside: Beside) -> tuple[Side | None, Side | None]:
        """Return the motion to the frames before and after; none if only one of them is there."""
        if beside.before is None or beside.after is None:
            return None, None
        before, after = self._motion(beside.before, a), self._motion(b, beside.after)
        if before is None or after is None:
            return None, None
        return Side(before[1], beside.span_before), Side(after[0], beside.span_after)

    def _motion(self, a: Array, b: Array) -> Pair | None:
        """Return the motion between two frames, found once for the three intervals that ask."""
        for first, second, found in self._motions:
            if first is a and second is b:
                return found
        # pairs of neighbours are asked for in their order, each once
        flow = None if self._given is None else self._given(self._asked)
        self._asked += 1
        found = estimate_motion(a, b, flow)
        self._motions = [*self._motions[-2:], (a, b, found)]
        return found


class FlowUpsampler:
    """Makes the frames of each interval along `paths`, `threads` of them at a time."""

    def __init__(self, paths: Paths, *, threads: int = 1) -> None:
        self._paths, self._threads = paths, threads

    def count(self, a: Array, b: Array, beside: Beside = NOTHING) -> int:
        """Return the number of frames that :meth:`between` makes."""
        return self._paths.count(a, b, beside)

    def between(self, a: Array, b: Array, beside: Beside = NOTHING) -> Iterator[Array]:
        """Yield the frames, the last `b` itself; see :class:`.Upsampler`."""
        check_pair(a, b)
        way = self._paths.of(a, b, beside)
        motion, bent, count = way.motion, way.bent, way.count
        if motion is None or count == 1:
            yield from LinearUpsampler(count).between(a, b)
            return
        first, second = np.ascontiguousarray(a), np.ascontiguousarray(b)

        def frame(step: int) -> Array:
            return warp(first, second, *motion, step / count, bent)

        yield from ordered(frame, count, self._threads)
        yield b


def warp(
    a: Array,
    b: Array,
    there: Motion,
    back: Motion,
    fraction: float,
    bent: tuple[Bend, Bend] | None = None,
) -> Array:
    """Return the light at `fraction` of the way from `a` to `b`, above 0 and below 1.

    `there` and `back` lead from `a` to `b` and from `b` to `a`, straight unless they are `bent`.
    """
    out = np.empty_like(a)
    first, second = (None, None) if bent is None else bent
    from_a = _arrivals(there, first, fraction)
    from_b = _arrivals(back, second, 1.0 - fraction)
    compose(a, b, from_a, from_b, fraction, out)
    return out


def _arrivals(
    motion: Motion, bend: Bend | None, share: float
) -> tuple[Array, Array, Array, Array, Array, Array]:
    """Return flat motion and bend, and who arrives where with which score after `share`."""
    best = np.empty_like(motion.score)
    source = np.zeros(motion.score.shape, np.int32)
    aside = (np.zeros_like(motion.u),) * 2 if bend is None else bend.at(share)
    splat(motion.u, motion.v, *aside, motion.score, share, best, source)
    u, v, p, q = (part.reshape(-1) for part in (motion.u, motion.v, *aside))
    return u, v, p, q, best, source
