"""What a pole makes of a ramp, in closed form."""

from __future__ import annotations

import math

import numpy as np
from scipy import optimize


def times_behind_a_pole(
    change: float, length_s: float, corner_hz: float, level: float, end_s: float
) -> list[float]:
    """Return when the output of a pole has risen by multiples of `level`, until `end_s` [s].

    Its input rises by `change` in a line over `length_s`, and then stays.
    """
    rate, slope = 2.0 * math.pi * corner_hz, change / length_s

    def output(t: float) -> float:
        rising = min(t, length_s)
        lag = slope / rate * -math.expm1(-rate * rising)
        return slope * rising - lag * math.exp(-rate * (t - rising))

    levels = np.arange(level, output(end_s), level).tolist()
    return [optimize.brentq(lambda t, y: output(t) - y, 0.0, end_s, (y,), 1e-12) for y in levels]
