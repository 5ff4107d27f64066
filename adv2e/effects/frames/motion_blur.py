"""Exposure blur of what moves: a frame smears it along its way, the events see it sharp.

    DN_frame(x) = 1/T * integral of DN(x - v s) ds from -T/2 to T/2

T           frames.exposure_us, or the exposure of each frame where a list says it
v           velocity at the time of the frame, the middle of its exposure

This takes the place of the module exposure_blur where frames are interpolated along the motion.
That module puts back what frames tell of changes in time, so it puts back nothing where the
exposure is shorter than the frame interval.  This one puts back what frames tell of motion.

Velocity comes from the optical flow to the frames before and after, as the slope of a path through
all three (adv2e.motion.estimate).  Where one of the frames does not show the pixel, it comes
from the other.  Where the two differ by more than half, as when something was hit meanwhile, the
slower one is taken.  A velocity holds for all pixels over which what moves was smeared, the longest
smear first.

B is the mean along the smear through each pixel.  It is its own transpose but for changes of v from
pixel to pixel.  Ten steps of the Richardson-Lucy iteration start from the frame itself:

    y  <-  y * B (DN_frame / (B y))

Light stays positive, and stays the same to the last bit where nothing moves.  What is finer than
the smear is not in the frame and cannot come back, and noise of the frames grows with what does
come back.  What moves too fast for the flow to be found stays blurred.

References
----------
[1] W. H. Richardson, "Bayesian-Based Iterative Method of Image Restoration", JOSA 62(1), 1972,
    doi:10.1364/JOSA.62.000055.
[2] Y.-W. Tai, P. Tan, M. S. Brown, "Richardson-Lucy Deblurring for Scenes under a Projective Motion
    Path", IEEE TPAMI 33(8), 2011, doi:10.1109/TPAMI.2010.222 (a path for every pixel).
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from adv2e.effects.hooks import Frames, Hooks
from adv2e.motion.estimate import Motion, estimate_motion
from adv2e.motion.warping import ONE_SIDED, UNKNOWN, smear, spread

Image = NDArray[np.float32]

_ITERATIONS = 10
_FOOT_DN = 0.5
"""Added to the light meanwhile: what is zero would stay zero, and what is dark follow its noise."""

_LEAST_PX = 0.1
"""Shorter smears are none."""

_AGREE_PX = 0.5
_AGREE = 0.5
_OUTLIERS_PX = 5


def velocity(
    after: Motion | None, span_after: float, before: Motion | None, span_before: float
) -> tuple[Image, Image] | None:
    """Return columns and rows a unit of time at a frame; None: no motion is known.

    `after` and `before` lead from it to the next frame and to the one before, in so much time.
    """
    sides = [
        (motion, span)
        for motion, span in ((after, span_after), (before, -span_before))
        if motion is not None
    ]
    if not sides:
        return None
    one = [
        tuple(_known(part, motion) / np.float32(span) for part in (motion.u, motion.v))
        for motion, span in sides
    ]
    if len(sides) == 1:
        found = one[0]
    else:
        (u, v), (ru, rv) = one
        # the slope at 0 of the parabola through three points
        share = np.float32(span_before / (span_after + span_before))
        both = u * share + ru * (1 - share), v * share + rv * (1 - share)
        speed, other = np.hypot(u, v), np.hypot(ru, rv)
        apart = np.hypot(u - ru, v - rv)
        unit = min(span_after, span_before)
        differ = apart > _AGREE * np.maximum(speed, other) + _AGREE_PX / unit
        seen, also = (motion.score < ONE_SIDED for motion, _ in sides)
        first = (seen & ~also) | ((seen == also) & differ & (speed <= other))
        second = (also & ~seen) | ((seen == also) & differ & (speed > other))
        found = (
            np.where(first, u, np.where(second, ru, both[0])),
            np.where(first, v, np.where(second, rv, both[1])),
        )
    smooth = [cv2.medianBlur(np.asarray(part, np.float32), _OUTLIERS_PX) for part in found]
    return smooth[0], smooth[1]  # type: ignore[return-value]


def _known(part: Image, motion: Motion) -> Image:
    return np.where(motion.score < UNKNOWN, part, np.float32(0.0))


def sharpened(light: NDArray[Any], u: Image, v: Image) -> NDArray[Any]:
    """Return the light [DN] of a frame in which each pixel is smeared over (u, v) pixels."""
    short = np.hypot(u, v) < _LEAST_PX
    wide_u, wide_v = np.empty_like(u), np.empty_like(v)
    none = np.float32(0.0)
    spread(np.where(short, none, u), np.where(short, none, v), wide_u, wide_v)
    blurred = np.maximum(light, 0) + light.dtype.type(_FOOT_DN)
    sharp, mean, factor = blurred.copy(), np.empty_like(blurred), np.empty_like(blurred)
    for _ in range(_ITERATIONS):
        smear(sharp, wide_u, wide_v, mean)
        smear(blurred / mean, wide_u, wide_v, factor)
        sharp *= factor
    at_rest = (wide_u == 0.0) & (wide_v == 0.0)
    return np.where(at_rest, light, np.maximum(sharp - light.dtype.type(_FOOT_DN), 0))


class MotionBlurHooks(Hooks):
    """Puts back what an exposure of `exposure_us` smeared, or `each_us` of each frame."""

    name = "exposure_blur"
    stage = "frames"

    def __init__(self, exposure_us: float, each_us: Sequence[float] = ()) -> None:
        super().__init__()
        self._exposure, self._each = exposure_us, each_us

    def light(self, frames: Frames) -> Frames:
        """Yield the light at the times of the frames, one behind."""
        before: Motion | None = None
        span_before = 1.0
        each = self._each or itertools.repeat(self._exposure)
        pairs = zip(_pairs(frames), each, strict=bool(self._each))
        for ((t_ns, light), following), exposure_us in pairs:
            after, span_after = None, 1.0
            back: Motion | None = None
            if following is not None:
                next_ns, other = following
                span_after = float(next_ns - t_ns)
                pair = estimate_motion(light, other) if span_after > 0 else None
                after, back = pair or (None, None)
            found = velocity(after, span_after, before, span_before)
            if found is None:
                yield t_ns, light
            else:
                u, v = (part * np.float32(exposure_us * 1e3) for part in found)
                yield t_ns, sharpened(np.ascontiguousarray(light), u, v)
            before, span_before = back, span_after


def _pairs(frames: Frames) -> Iterator[tuple[Any, Any]]:
    return itertools.pairwise(itertools.chain(frames, [None]))
