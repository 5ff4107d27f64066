r"""Black level: a constant that the numbers in the frames lack.

.. math:: DN = \max\left(DN_{frame} + b - k \left(1 - e^{-d / 1.5}\right),\; 0\right)

with DN_frame the decoded light of the frame [DN of 255] and b = ``frames.black_level_dn``, added
after decoding (linear light), before the logarithm.  Frames show max(DN - b, 0) where their
pedestal was subtracted too far (b above 0); b below 0 takes a pedestal away that is still in them.
In the dark it decides the contrast: at 5 DN, b = 5 halves it.

Light that the frames show as 0 may have been anything from 0 to b.  With k = 0 it counts as b.
Else it falls by up to k = ``frames.black_depth_dn`` from the border of what is clipped to its
middle, as edges go on falling behind the clip; d is the distance to the nearest pixel that is not
clipped [px], and infinite for those.

References
----------
.. [1] A. El Gamal, H. Eltoukhy, "CMOS image sensors", IEEE Circuits and Devices Magazine 21(3),
   2005, doi:10.1109/MCD.2005.1438751 (dark current, pedestal).
.. [2] R. W. Baldwin, M. Almatrafi, V. Asari, K. Hirakawa, "Event Probability Mask (EPM) and Event
   Denoising Convolutional Neural Network (EDnCNN) for Neuromorphic Cameras", CVPR 2020,
   arXiv:2003.08282 (fits one offset of the frames to the events).
"""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from adv2e.effects.hooks import Frames, Hooks

_FALL_PX = 1.5


class BlackLevelHooks(Hooks):
    """Adds `dn` to the light of the frames, less up to `depth_dn` where they are clipped at 0."""

    stage = "frames"

    def __init__(self, dn: float, depth_dn: float = 0.0) -> None:
        super().__init__()
        self._dn, self._depth = dn, depth_dn

    def light(self, frames: Frames) -> Frames:
        """Yield the frames with the constant."""
        for t_ns, light in frames:
            made = light + light.dtype.type(self._dn)
            if self._depth:
                made -= self._below(light)
            yield t_ns, np.maximum(made, 0)

    def _below(self, light: NDArray[Any]) -> NDArray[Any]:
        """Return how far each pixel is below black [DN]."""
        clipped = (light <= 0.0).astype(np.uint8)
        # the distance of what is not clipped is 0; exact, as steps would turn with the motion
        away = cv2.distanceTransform(clipped, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
        return np.asarray(self._depth * -np.expm1(away / -_FALL_PX), light.dtype)
