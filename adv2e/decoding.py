"""How the numbers of frames become light, as a configuration says."""

from __future__ import annotations

from numpy.typing import DTypeLike

from adv2e.config.model import Frames
from adv2e.effects.frames.encoding import LightDecoder, full_scale_of


def decoder_for(frames: Frames, dtype: DTypeLike, colour: bool, *, auto: str) -> LightDecoder:
    """Return the decoder that a configuration asks for.

    Parameters
    ----------
    frames : Frames
        The configuration's section.
    dtype, colour
        Of the frames; see :class:`adv2e.effects.frames.encoding.LightDecoder`.
    auto : str
        What ``encoding: auto`` means for them.
    """
    encoding = auto if frames.encoding == "auto" else frames.encoding
    return LightDecoder(encoding, frames.full_scale or full_scale_of(dtype), dtype, colour)
