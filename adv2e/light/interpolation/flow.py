r"""Interpolation along the motion: edges move from one frame to the next instead of fading.

Optical flow is found in both directions (:mod:`adv2e.motion.estimate`).  For the time
l/L of the interval every pixel of both frames is sent its share of the way [1]_, which bends as the
frames before and after the interval tell (:mod:`adv2e.motion.acceleration`); where
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
``scripts/studies/interpolation.py`` has the numbers.

References
----------
.. [1] S. Baker, D. Scharstein, J. P. Lewis, S. Roth, M. J. Black, R. Szeliski, "A Database and
   Evaluation Methodology for Optical Flow", IJCV 92, 2011, doi:10.1007/s11263-010-0390-2
   (interpolation by sending pixels on, the photometrically best on top).
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.background import worker_pool
from adv2e.light.interpolation.linear import LinearUpsampler, check_pair
from adv2e.light.interpolation.sequence import NOTHING, Beside
from adv2e.motion.acceleration import Bend, Side, bends
from adv2e.motion.estimate import Motion, estimate_motion
from adv2e.motion.warping import compose, splat

Array = NDArray[Any]
Pair = tuple[Motion, Motion]


class FlowUpsampler:
    """Makes `L` frames of each interval along the motion, `threads` of them at a time."""

    def __init__(self, L: int, *, threads: int = 1) -> None:
        self.L = L
        self.threads = threads
        self._linear = LinearUpsampler(L)
        self._known: list[tuple[Array, Array, Pair | None]] = []

    def between(self, a: Array, b: Array, beside: Beside = NOTHING) -> Iterator[Array]:
        """Yield `L` frames, the last `b` itself; see :class:`.Upsampler`."""
        check_pair(a, b)
        motion = self._motion(a, b) if self.L > 1 else None
        if motion is None:
            yield from self._linear.between(a, b)
            return
        bent = bends(*motion, *self._sides(a, b, beside))
        first, second = np.ascontiguousarray(a), np.ascontiguousarray(b)

        def frame(step: int) -> Array:
            return warp(first, second, *motion, step / self.L, bent)

        if self.threads > 1:
            with worker_pool(self.threads) as pool:
                # no more at a time than threads, so that memory does not grow with L
                for start in range(1, self.L, self.threads):
                    yield from pool.map(frame, range(start, min(start + self.threads, self.L)))
        else:
            yield from map(frame, range(1, self.L))
        yield b

    def _sides(self, a: Array, b: Array, beside: Beside) -> tuple[Side | None, Side | None]:
        """Return the motion to what lies beside; none at all where only one side is there."""
        if beside.before is None or beside.after is None:
            return None, None
        before, after = self._motion(beside.before, a), self._motion(b, beside.after)
        if before is None or after is None:
            return None, None
        return Side(before[1], beside.span_before), Side(after[0], beside.span_after)

    def _motion(self, a: Array, b: Array) -> Pair | None:
        """Return the motion between two frames, found once for the three intervals that ask."""
        for first, second, found in self._known:
            if first is a and second is b:
                return found
        found = estimate_motion(a, b)
        self._known = [*self._known[-2:], (a, b, found)]
        return found


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
    compose(a, b, *from_a, *from_b, fraction, out)
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
