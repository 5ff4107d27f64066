r"""Exposure blur: a frame is the mean of the light over its exposure.

.. math:: DN_{frame}(t) = \frac{1}{T} \int_{t - T/2}^{t + T/2} DN(\tau)\, d\tau
"""

from __future__ import annotations

from adv2e.effects.hooks import Frames, Hooks


class ExposureBlurHooks(Hooks):
    """Undoes."""

    stage = "frames"

    def __init__(self, exposure_us: float) -> None:
        super().__init__()
        self._exposure_ns = exposure_us * 1e3

    def light(self, frames: Frames) -> Frames:
        """Yield."""
        yield from frames
