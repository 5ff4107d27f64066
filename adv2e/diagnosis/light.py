"""Light of the recording's frames, as the declared model reads their numbers."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from adv2e.config import Config
from adv2e.diagnosis.evidence import Evidence
from adv2e.effects.frames.encoding import LightDecoder, full_scale_of


def light_of(evidence: Evidence, declared: Config) -> NDArray[np.float32]:
    """Return the light of all frames [DN], (frames, rows, columns)."""
    decoder, _ = _decoder(evidence, declared)
    return np.array([decoder.decode(image) for image in evidence.frames], np.float32)


def quantum_dn(evidence: Evidence, declared: Config) -> float:
    """Return the step of the frames' numbers [DN]; zero for floating-point frames."""
    _, full_scale = _decoder(evidence, declared)
    whole = np.issubdtype(evidence.frames[0].dtype, np.integer)
    return 255.0 / full_scale if whole else 0.0


def _decoder(evidence: Evidence, declared: Config) -> tuple[LightDecoder, float]:
    image = evidence.frames[0]
    colour = image.ndim == 3
    encoding = declared.frames.encoding
    if encoding == "auto":
        encoding = evidence.encoding
    full_scale = declared.frames.full_scale or full_scale_of(image.dtype)
    return LightDecoder(encoding, full_scale, image.dtype, colour), full_scale
