"""Drift of the contrast thresholds, as biases and temperature change.

    C(t) = C (1 + d t)

C           threshold, ON or OFF, of any pixel
d           pixel.thresholds.drift_per_s
t           time since the first frame

The leak keeps its speed, which the thresholds at the start set.

Applied in adv2e/pixel/steps.py.

References
----------
[1] Y. Nozaki, T. Delbruck, "Temperature and parasitic photocurrent effects in dynamic vision
    sensors", IEEE TED 64(8), 2017, doi:10.1109/TED.2017.2717848.
[2] R. Graca, B. McReynolds, T. Delbruck, "Shining light on the DVS pixel: a tutorial and discussion
    about biasing and optimization", CVPR Workshops 2023, arXiv:2304.04706 (thresholds follow from
    biases).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from adv2e.errors import ConfigError

LABELS = {"threshold_drift": "drift of the thresholds"}
SEPARATED_BY = {"threshold_drift": "the same motion early and late in a long recording"}


def drift_factors(since_s: NDArray[np.float64], per_s: float) -> NDArray[np.float64]:
    """Return the factor on all thresholds at times since the first frame [s], (n,).

    Raises
    ------
    ConfigError
        The thresholds reach zero within these times.
    """
    factors = 1.0 + per_s * since_s
    if np.any(factors <= 0.0):
        raise ConfigError(
            f"pixel.thresholds.drift_per_s: {per_s:g} 1/s takes the thresholds to zero"
            f" {-1.0 / per_s:.3g} s after the first frame, within the recording; must be above"
            f" {-1.0 / float(np.max(since_s)):.3g}"
        )
    return factors
