r"""Paths of the pixels through an interval, and how many frames it needs.

With ``sampling.max_motion_px`` an interval gets as few frames as keep every pixel of both its
frames from moving further than that from one instant to the next,

.. math:: n = \min\left(L, \left\lceil v / d \right\rceil\right)

with the fastest velocity v on any path [px per interval] and the distance d.  It gets one where
nothing changes by more than 1 %.  It gets L of them where motion is not known: across a cut, in
frames too small for the search, where some pixel has none, or where what was found leaves more than
half of the change of light unexplained.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.light.interpolation.sequence import Beside
from adv2e.motion.acceleration import Bend, Side, bends, fastest
from adv2e.motion.estimate import Motion, estimate_motion, is_unchanged
from adv2e.motion.warping import UNKNOWN

Array = NDArray[Any]
Pair = tuple[Motion, Motion]
Bent = tuple[Bend, Bend] | None

_UNEXPLAINED_MOST = 0.5


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
    """

    def __init__(self, L: int, max_motion_px: float | None = None) -> None:
        self.L, self._max_motion_px = L, max_motion_px
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
        if not all(_is_known(one) for one in motion):
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
        found = estimate_motion(a, b)
        self._motions = [*self._motions[-2:], (a, b, found)]
        return found


def _is_known(motion: Motion) -> bool:
    return motion.unexplained <= _UNEXPLAINED_MOST and not np.any(motion.score >= UNKNOWN)
