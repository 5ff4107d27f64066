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
``adv2e/light/README.md`` has the numbers.

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

from adv2e.light.interpolation.linear import LinearUpsampler, check_pair
from adv2e.light.interpolation.paths import Paths
from adv2e.light.interpolation.sequence import NOTHING, Beside, ordered
from adv2e.motion.acceleration import Bend
from adv2e.motion.estimate import Motion
from adv2e.motion.warping import compose, splat

Array = NDArray[Any]


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
