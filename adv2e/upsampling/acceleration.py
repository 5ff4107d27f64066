r"""How paths bend: what moves faster, slower or elsewhere by the next frame does so gradually.

With f the motion of a pixel to the next frame and p that to the frame before, r times as far in
time, the path through all three is, at the share s of the interval to the next,

.. math:: x(s) = f s - c\, s (1 - s), \qquad c = \frac{f + p / r}{1 + r}

so that c is half the acceleration, in pixels per interval squared [1]_.  It is taken where the
pixel is seen in both frames, and as a mean over the pixels around.

The two frames of an interval give one c each.  Where they point to opposite sides there is none,
else the path bends by the lesser of the two: what is hit, starts or stops within an interval bends
on one side only, and is no parabola (a limiter, as of slopes in shock-capturing schemes [2]_).  At
both ends of a sequence, beside a cut and where intervals differ by more than a factor of 3, paths
are straight.

References
----------
.. [1] X. Xu, L. Siyao, W. Sun, Q. Yin, M.-H. Yang, "Quadratic Video Interpolation", NeurIPS 2019,
   arXiv:1911.00627 (the path through three frames).
.. [2] P. L. Roe, "Characteristic-Based Schemes for the Euler Equations", Annual Review of Fluid
   Mechanics 18, 1986, doi:10.1146/annurev.fl.18.010186.002005 (minmod).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from adv2e.upsampling.kernels import ONE_SIDED
from adv2e.upsampling.motion import Image, Motion

_LIKE_SPANS = 3.0
_AROUND_PX = 2.0
_KNOWN_LEAST = 0.2

Bend = tuple[Image, Image]
"""Columns and rows of c [px] at the pixels of a frame."""


@dataclass(frozen=True)
class Side:
    """Motion to the frame on the other side of one that ends an interval.

    Attributes
    ----------
    motion : Motion
        From the frame that ends the interval to the one beyond.
    span : float
        Time to that frame, in units of the interval.
    """

    motion: Motion
    span: float


def bends(
    there: Motion, back: Motion, before: Side | None, after: Side | None
) -> tuple[Bend, Bend]:
    """Return the bend of the paths of both frames of an interval.

    Parameters
    ----------
    there, back : Motion
        From the first frame to the second, and from the second to the first.
    before, after : Side or None
        From the first frame to the one before it, from the second to the one after it.
    """
    if before is None or after is None or not (_is_like(before.span) and _is_like(after.span)):
        return straight(there), straight(back)
    first, second = _bend(there, before), _bend(back, after)
    return _lesser(first, second, there), _lesser(second, first, back)


def straight(motion: Motion) -> Bend:
    """Return no bend."""
    return np.zeros_like(motion.u), np.zeros_like(motion.v)


def _is_like(span: float) -> bool:
    return 1.0 / _LIKE_SPANS <= span <= _LIKE_SPANS


def _bend(to: Motion, side: Side) -> Bend:
    """Return what one frame says; 0 where it says nothing."""
    away, span = side.motion, side.span
    known = ((to.score < ONE_SIDED) & (away.score < ONE_SIDED)).astype(np.float32)
    weight = _mean(known)
    told = weight >= _KNOWN_LEAST
    # what ends the interval at rest, or lies beside it, is not bent, to the last bit
    still = (to.u == 0.0) & (to.v == 0.0)
    found = []
    for there, back in ((to.u, away.u), (to.v, away.v)):
        c = (there + back / np.float32(span)) / np.float32(1.0 + span)
        mean = np.where(told, _mean(c * known) / np.maximum(weight, _KNOWN_LEAST), 0.0)
        found.append(np.where(still, 0.0, mean).astype(np.float32))
    return found[0], found[1]


def _mean(image: NDArray[Any]) -> Image:
    return cv2.GaussianBlur(image, (0, 0), _AROUND_PX)  # type: ignore[return-value]


def _lesser(own: Bend, others: Bend, motion: Motion) -> Bend:
    """Return `own`, shortened to the other frame's where that is less, 0 where it turns away."""
    rows, columns = motion.u.shape
    y, x = np.mgrid[:rows, :columns].astype(np.float32)
    x, y = x + motion.u, y + motion.v
    other = [
        cv2.remap(part, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE) for part in others
    ]
    along = own[0] * other[0] + own[1] * other[1]
    length, limit = np.hypot(*own), np.hypot(*other)
    share = np.where(along > 0.0, np.minimum(1.0, limit / np.maximum(length, 1e-12)), 0.0)
    share = share.astype(np.float32)
    return own[0] * share, own[1] * share
