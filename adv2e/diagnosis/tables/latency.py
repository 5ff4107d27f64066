r"""Latency of a pixel: time from a step of the light to the first crossing of the threshold.

The log intensity x steps by S.  The first pole follows with the corner of the light after the step,
its slope limited to s; a second pole follows the first:

.. math:: \dot y = \max(-s, \min(s, w_1 (x - y))), \qquad \dot z = w_2 (y - z)

One pole alone crosses C at :math:`-\ln(1 - C/S)/w_1`, so that with a corner proportional to the
light the latency is proportional to 1/E.  Two poles have no closed form; the root is found.  At
rest before the step the reference is the signal, so no other part of the pixel (dead time, leak)
plays a part in the first event.

References
----------
.. [1] P. Lichtsteiner, C. Posch, T. Delbruck, "A 128x128 120 dB 15 us latency asynchronous temporal
   contrast vision sensor", IEEE JSSC 43(2), 2008, doi:10.1109/JSSC.2007.914337.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_ITERATIONS = 60
_NEAREST = 1e-6


def first_crossing(
    step: Array, threshold: Array, w1: Array, w2: float | None = None, slew: float | None = None
) -> Array:
    """Return the time [s] of the first crossing of the threshold, infinite where there is none.

    Of steps and thresholds [ln], above 0, (n,), with the corners of the poles after them [rad/s],
    and the greatest slope of the first pole's output [ln/s].
    """
    time = np.full(step.shape, np.inf)
    fires = threshold < step
    if not fires.any():
        return time
    response = _Response(step[fires], w1[fires], w2, slew)
    level = threshold[fires]
    time[fires] = response.first_pole_time(level) if w2 is None else response.root(level)
    return time


class _Response:
    """Response of the two poles to a step from rest."""

    def __init__(self, step: Array, w1: Array, w2: float | None, slew: float | None) -> None:
        self.step = step
        self.w1 = w1
        self.w2 = w2
        self.slew = np.inf if slew is None else slew
        # the first pole's lag when it is no longer limited, and when that is
        self.lag = np.minimum(step, self.slew / w1)
        self.limited = np.zeros_like(step) if slew is None else (step - self.lag) / slew

    def first_pole_time(self, level: Array) -> Array:
        """Return the time at which the first pole alone reaches `level`."""
        late = self.limited + np.log(self.lag / (self.step - level)) / self.w1
        if np.isinf(self.slew):
            return late
        return np.where(level <= self.step - self.lag, level / self.slew, late)

    def root(self, level: Array) -> Array:
        """Return the time at which the second pole reaches `level`, by Newton with a bracket."""
        assert self.w2 is not None
        low = self.first_pole_time(level)
        # once the first is past sqrt(q) of the step, the second goes sqrt(q) of the way from there
        share = np.sqrt(level / self.step)
        high = self.first_pole_time(self.step * share) - np.log1p(-share) / self.w2
        time = 0.5 * (low + high)
        for _ in range(_ITERATIONS):
            value, slope = self.signal(time)
            over = value > level
            high = np.where(over, time, high)
            low = np.where(over, low, time)
            with np.errstate(divide="ignore", invalid="ignore"):
                newton = time - (value - level) / slope
            inside = (newton > low) & (newton < high)
            after = np.where(inside, newton, 0.5 * (low + high))
            done = np.abs(after - time) <= 1e-9 * time
            time = after
            if done.all():
                break
        return time

    def signal(self, time: Array) -> tuple[Array, Array]:
        """Return the second pole's output and its slope at `time`."""
        assert self.w2 is not None
        w2 = self.w2
        w1 = np.where(np.abs(self.w1 / w2 - 1.0) < _NEAREST, w2 * (1.0 + _NEAREST), self.w1)
        limited = np.isfinite(self.slew) & (time < self.limited)
        part = self.lag * w2 / (w2 - w1)
        start = np.zeros_like(time)
        if np.isfinite(self.slew):
            start = self.slew * (self.limited + np.expm1(-w2 * self.limited) / w2)
        rest = self.step - start - part
        since = np.maximum(time - self.limited, 0.0)
        fast, slow = part * np.exp(-w1 * since), rest * np.exp(-w2 * since)
        value, slope = self.step - fast - slow, w1 * fast + w2 * slow
        if limited.any():
            ramp = self.slew * (time + np.expm1(-w2 * time) / w2)
            value = np.where(limited, ramp, value)
            slope = np.where(limited, -self.slew * np.expm1(-w2 * time), slope)
        return value, slope
