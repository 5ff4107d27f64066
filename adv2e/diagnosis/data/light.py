"""Light of the recording's frames, as the declared model reads their numbers."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.config import Config
from adv2e.diagnosis.data.evidence import Evidence
from adv2e.diagnosis.data.scene import Scene
from adv2e.effects.frames.encoding import LightDecoder
from adv2e.light.decoding import decoder_for


def light_of(evidence: Evidence, declared: Config) -> NDArray[np.float32]:
    """Return the light of all frames [DN], (frames, rows, columns)."""
    return np.array(list(lights(evidence, declared)), np.float32)


def lights(evidence: Evidence, declared: Config) -> Iterator[NDArray[Any]]:
    """Yield the light of each frame [DN], (rows, columns)."""
    decoder = _decoder(evidence, declared)
    yield from map(decoder.decode, evidence.frames)


def scene_of(evidence: Evidence, declared: Config) -> Scene:
    """Return what the frames say of each pixel, as the declared model reads them."""
    light = light_of(evidence, declared)
    return Scene.of(light, evidence.times_s, quantum_dn(evidence, declared))


def quantum_dn(evidence: Evidence, declared: Config) -> float:
    """Return the step of the frames' numbers [DN]; zero for floating-point frames."""
    decoder = _decoder(evidence, declared)
    return 255.0 / decoder.full_scale if np.issubdtype(decoder.dtype, np.integer) else 0.0


def _decoder(evidence: Evidence, declared: Config) -> LightDecoder:
    image = evidence.frames[0]
    return decoder_for(
        declared.frames,
        image.dtype,
        image.ndim == 3,
        auto=evidence.encoding,
        white=evidence.white,
    )
