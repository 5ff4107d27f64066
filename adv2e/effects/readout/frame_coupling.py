r"""Frame coupling: the readout of a frame disturbs the event pixels of the same sensor.

.. math:: d(t) = A \sum_{t_f < t} e^{-(t - t_f)/\tau}

is added to the signal of all pixels behind all poles, with A = ``amplitude`` [ln], tau = ``tau_us``
and t_f the times at which frames were read out: the end of each exposure, that is the time of the
frame on the camera's clock (after clock offset and drift) plus half of ``frames.exposure_us``.
The pixels are at rest at the first frame.  The leap is a rise over a twelfth of tau, the longest
step of time, after which it decays: nothing shows before the readout, and its height is met.  A
line through such a step of the decay is off by A/1152; intervals that begin when no more than that
is left, 7 tau after a readout, take the steps that they would without it.

References
----------
.. [1] C. Brandli, R. Berner, M. Yang, S.-C. Liu, T. Delbruck, "A 240 x 180 130 dB 3 us Latency
   Global Shutter Spatiotemporal Vision Sensor", IEEE JSSC 49(10), 2014,
   doi:10.1109/JSSC.2014.2342715 (frames and events of one photodiode).
"""

from __future__ import annotations

import math
from bisect import bisect_left
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from adv2e.effects.hooks import Frames, Hooks, Times, View
from adv2e.parameters import Fit, Section, parameter

_STEPS_PER_TAU = 12
_FADED = math.log(8.0 * _STEPS_PER_TAU**2)
"""Time constants after which what is left is what steps leave out of the decay at its start."""


@dataclass(frozen=True, kw_only=True)
class FrameCoupling(Section):
    """Disturbance of the event pixels by the readout of frames."""

    amplitude: float = parameter(
        unit="ln",
        meaning="leap of the signal at a readout; below 0: downwards",
        fit=Fit(-2.0, 2.0, 0.05),
    )
    tau_us: float = parameter(
        unit="us",
        meaning="time constant with which it decays",
        above=0,
        fit=Fit(20.0, 1e5, 300.0, log=True),
    )


class FrameCouplingHooks(Hooks):
    """Adds the disturbance to the signal.

    Parameters
    ----------
    parameters : FrameCoupling
    delay_us : float
        From a frame's time to its readout.
    every : int
        Of so many frames one was recorded, from the first on; the others were made between them.
    """

    stage = "readout"
    Parameters = FrameCoupling

    def __init__(self, parameters: FrameCoupling, delay_us: float = 0.0, every: int = 1) -> None:
        super().__init__(parameters)
        self._delay_s, self._every = delay_us * 1e-6, every
        self.step_us = parameters.tau_us / _STEPS_PER_TAU
        self._rise_s = self.step_us * 1e-6

    def begin(self, view: View) -> None:
        """Forget the frames of before."""
        super().begin(view)
        # of each readout: its time, and the sum of what all up to it have left at that time
        self._readouts: list[float] = []
        self._sums: list[float] = []

    def light(self, frames: Frames) -> Frames:
        """Yield the frames as they are, and note when they were read out."""
        tau_s = self.parameters.tau_us * 1e-6
        for number, (t_ns, light) in enumerate(frames):
            if number % self._every == 0:
                time = t_ns * 1e-9 + self._delay_s
                left = 0.0
                if self._readouts:
                    left = self._sums[-1] * float(np.exp((self._readouts[-1] - time) / tau_s))
                self._readouts.append(time)
                self._sums.append(1.0 + left)
            yield t_ns, light

    def signal(self, times_s: Times) -> NDArray[np.float64]:
        """Return the disturbance, (n,)."""
        readouts, sums = np.array(self._readouts), np.array(self._sums)
        last = np.searchsorted(readouts, times_s, "right") - 1
        waited = np.maximum(times_s - readouts[last], 0.0)
        tau_s = self.parameters.tau_us * 1e-6
        fading = np.exp(-(waited - self._rise_s) / tau_s)
        rising = waited / self._rise_s
        left = (sums[last] - 1.0) * fading + np.where(rising < 1.0, rising, fading)
        begun = (last >= 0) & (times_s > self.view.start_s)
        return np.where(begun, self.parameters.amplitude * left, 0.0)

    def longest_step_us(self, start_s: float, stop_s: float) -> float:
        """Return its step, and no limit where what was read out before has decayed."""
        before = bisect_left(self._readouts, stop_s) - 1
        faded_s = _FADED * self.parameters.tau_us * 1e-6
        quiet = before < 0 or start_s >= self._readouts[before] + faded_s
        return math.inf if quiet else self.step_us

    def passed(self, time_s: float) -> None:
        """Forget the readouts that no later time needs."""
        done = max(bisect_left(self._readouts, time_s) - 1, 0)
        del self._readouts[:done], self._sums[:done]
