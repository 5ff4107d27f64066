r"""Interpolation along the motion: edges move from one frame to the next instead of fading.

Optical flow is found in both directions (:mod:`adv2e.upsampling.motion`).  For the time l/L of the
interval every pixel of both frames is sent its share of the way [1]_; where several arrive, the one
whose light agrees best with the other frame is in front.  The light there is that of both frames at
the ends of this path, blended by l/L; of one frame where the other does not see it; and blended in
place where no motion is known, as :mod:`adv2e.upsampling.linear` does everywhere.  Light is
moved linear and unrounded; only the motion is found on a logarithmic 8-bit picture.

A pixel at rest that has the same light in both frames keeps it to the last bit, unless something
moves over it.  Frames too small for the search (see `SMALLEST`), equal frames and cuts are
interpolated linearly.

What it cannot do: motion is straight and even within an interval; light that changes while it
moves is blended; things smaller than their step from frame to frame, steps above about a fifth of
the picture's height, and textures that repeat within a few steps are mostly not found and fade as
with linear; the noise of dim frames is carried along, which makes more false events than blending
it in place.  ``scripts/study_interpolation.py`` has the numbers.

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

from adv2e.overlap import worker_pool
from adv2e.upsampling.kernels import compose, splat
from adv2e.upsampling.linear import LinearUpsampler, check_pair
from adv2e.upsampling.motion import Motion, estimate_motion


class FlowUpsampler:
    """Makes `L` frames of each interval along the motion, `threads` of them at a time."""

    def __init__(self, L: int, *, threads: int = 1) -> None:
        self.L = L
        self.threads = threads
        self._linear = LinearUpsampler(L)

    def between(self, a: NDArray[Any], b: NDArray[Any]) -> Iterator[NDArray[Any]]:
        """Yield `L` frames, the last `b` itself; see :class:`adv2e.upsampling.Upsampler`."""
        check_pair(a, b)
        motion = estimate_motion(a, b) if self.L > 1 else None
        if motion is None:
            yield from self._linear.between(a, b)
            return
        first, second = np.ascontiguousarray(a), np.ascontiguousarray(b)

        def frame(step: int) -> NDArray[Any]:
            return warp(first, second, *motion, step / self.L)

        if self.threads > 1:
            with worker_pool(self.threads) as pool:
                # no more at a time than threads, so that memory does not grow with L
                for start in range(1, self.L, self.threads):
                    yield from pool.map(frame, range(start, min(start + self.threads, self.L)))
        else:
            yield from map(frame, range(1, self.L))
        yield b


def warp(
    a: NDArray[Any], b: NDArray[Any], there: Motion, back: Motion, fraction: float
) -> NDArray[Any]:
    """Return the light at `fraction` of the way from `a` to `b`.

    Parameters
    ----------
    a, b : (rows, columns) float32 or float64, C order
        Light [DN].
    there, back : Motion
        From `a` to `b` and from `b` to `a`.
    fraction : float
        Above 0 and below 1.
    """
    out = np.empty_like(a)
    compose(a, b, *_arrivals(there, fraction), *_arrivals(back, 1.0 - fraction), fraction, out)
    return out


def _arrivals(
    motion: Motion, share: float
) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any], NDArray[Any]]:
    """Return flat u and v, and who arrives where with which score after `share` of the way."""
    best = np.empty_like(motion.score)
    source = np.zeros(motion.score.shape, np.int32)
    splat(motion.u, motion.v, motion.score, share, best, source)
    return motion.u.reshape(-1), motion.v.reshape(-1), best, source
