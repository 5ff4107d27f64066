"""Decoding of the numbers of frames to light, by encoding and white of a configuration."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import DTypeLike, NDArray

from adv2e.effects.composition import overrides
from adv2e.effects.frames.encoding import LightDecoder, full_scale_of
from adv2e.label import ENCODING, guessed

if TYPE_CHECKING:  # 'adv2e info' does without the configuration, which takes time to import
    from adv2e.config.model import Frames, Sampling
    from adv2e.effects.hooks import Hooks
    from adv2e.light.sensor import Fitting
    from adv2e.sources.frame import Light


def encoding_for(frames: Frames, auto: str) -> str:
    """Return the encoding that a configuration asks for, `auto` being what ``auto`` means."""
    return auto if frames.encoding == "auto" else frames.encoding


def decoder_for(
    frames: Frames, dtype: DTypeLike, colour: bool, *, auto: str, white: float | None = None
) -> LightDecoder:
    """Return the decoder that a configuration asks for.

    `auto` is what ``encoding: auto`` means for the frames, `white` their number for white where
    that is not the one of the data type.
    """
    full_scale = frames.full_scale or white or full_scale_of(dtype)
    return LightDecoder(encoding_for(frames, auto), full_scale, dtype, colour)


def kernel_table(
    decoder: LightDecoder, sampling: Sampling, hooks: Iterable[Hooks], fitting: Fitting | None
) -> NDArray[np.float32] | None:
    """Return the table with which the kernel decodes grey frames itself; None: it takes light.

    A quarter of the memory traffic, but every instant looks its frames up again, and only linear
    interpolation, of frames as they are, without effects on the light (`hooks`), needs none before.
    """
    once = sampling.L == 1 and sampling.interpolation == "linear" and fitting is None
    as_read = once and not any(overrides(hook, "light") for hook in hooks)
    return decoder.grey_table if as_read else None


def light_text(light: Light, white: float, frames: Frames | None = None) -> str:
    """Return in one line which light the numbers of frames are taken for, why, and what changes it.

    `white` is the number that means white, unless the configuration says another.
    """
    encoding = encoding_for(frames, light.encoding) if frames else light.encoding
    full_scale = frames.full_scale if frames else None
    if frames and frames.encoding != "auto":
        why = ["as frames.encoding says"]
    else:
        why = [light.encoding_reason, "frames.encoding changes it"]
    if full_scale is not None:
        why.append("white as frames.full_scale says")
    elif light.full_scale_reason:
        why.append(f"white {light.full_scale_reason}")
    return f"{encoding}, white {full_scale or white:g} ({'; '.join(why)})"


def light_line(light: Light, white: float, frames: Frames | None = None) -> str:
    """Return the line that tells :func:`light_text`, which tells a guess where it is one."""
    line = f"frames are {light_text(light, white, frames)}"
    if light.is_stated or (frames and frames.encoding != "auto"):
        return line
    return guessed(line, ENCODING, light.encoding, why=light.encoding_reason)
