"""Black level: a constant that the numbers in the frames lack.

    DN = max(DN_frame + b - k (1 - exp(-d/1.5)), 0)

DN_frame    decoded, linear light of the frame [DN of 255]
b           frames.black_level_dn
k           frames.black_depth_dn
d           distance to the nearest pixel that is not clipped at 0 [px]; infinite for those pixels

The constant is added after decoding and before the logarithm.  If b is above 0, the camera has
subtracted too large a pedestal, and its frames show max(DN - b, 0).  If b is below 0, a pedestal is
still in the frames and is taken away.  The black level decides the contrast in the dark: at 5 DN,
b = 5 halves it.

Light that the frames show as 0 may have been anything from 0 to b.  With k = 0 it counts as b.
Else it falls by up to k from the border of the clipped area to its middle, because edges go on
falling behind the clip.

References
----------
[1] A. El Gamal, H. Eltoukhy, "CMOS image sensors", IEEE Circuits and Devices Magazine 21(3), 2005,
    doi:10.1109/MCD.2005.1438751 (dark current, pedestal).
[2] R. W. Baldwin, M. Almatrafi, V. Asari, K. Hirakawa, "Event Probability Mask (EPM) and Event
    Denoising Convolutional Neural Network (EDnCNN) for Neuromorphic Cameras", CVPR 2020,
    arXiv:2003.08282 (fits one offset of the frames to the events).
"""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from adv2e.effects.hooks import Hooks, LightFrame

LABELS = {"black_level": "black level of the frames"}
SEPARATED_BY = {
    "black_level": "one motion over very dark parts: contrast is lost there and nowhere else"
}

_FALL_PX = 1.5


class BlackLevelHooks(Hooks):
    """Adds `dn` to the light of the frames, less up to `depth_dn` where they are clipped at 0."""

    stage = "frames"

    def __init__(self, dn: float, depth_dn: float = 0.0) -> None:
        super().__init__()
        self._dn, self._depth = dn, depth_dn

    def light_now(self, t_ns: int, light: NDArray[Any]) -> LightFrame:
        made = light + light.dtype.type(self._dn)
        if self._depth:
            made -= self._below(light)
        return t_ns, np.maximum(made, 0)

    def _below(self, light: NDArray[Any]) -> NDArray[Any]:
        """Return the depth of each pixel below black [DN]."""
        clipped = (light <= 0.0).astype(np.uint8)
        # the distance of what is not clipped is 0; exact, as steps would turn with the motion
        away = cv2.distanceTransform(clipped, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
        return np.asarray(self._depth * -np.expm1(away / -_FALL_PX), light.dtype)
