r"""Black level: a constant that the numbers in the frames lack.

.. math:: DN = \max(DN_{frame} + b,\; 0)

with DN_frame the decoded light of the frame [DN of 255] and b = ``frames.black_level_dn``, added
after decoding (linear light), before the logarithm.  Frames show max(DN - b, 0) where their
pedestal was subtracted too far (b above 0); b below 0 takes a pedestal away that is still in them.
In the dark it decides the contrast: at 5 DN, b = 5 halves it.  Light that the frames show as 0 may
have been anything from 0 to b, and counts as b.

References
----------
.. [1] A. El Gamal, H. Eltoukhy, "CMOS image sensors", IEEE Circuits and Devices Magazine 21(3),
   2005, doi:10.1109/MCD.2005.1438751 (dark current, pedestal).
.. [2] R. W. Baldwin, M. Almatrafi, V. Asari, K. Hirakawa, "Event Probability Mask (EPM) and Event
   Denoising Convolutional Neural Network (EDnCNN) for Neuromorphic Cameras", CVPR 2020,
   arXiv:2003.08282 (fits one offset of the frames to the events).
"""

from __future__ import annotations

import numpy as np

from adv2e.effects.hooks import Frames, Hooks


class BlackLevelHooks(Hooks):
    """Adds `dn` to the light of the frames; less than none is none."""

    stage = "frames"

    def __init__(self, dn: float) -> None:
        super().__init__()
        self._dn = dn

    def light(self, frames: Frames) -> Frames:
        """Yield the frames with the constant."""
        for t_ns, light in frames:
            yield t_ns, np.maximum(light + light.dtype.type(self._dn), 0)
