"""Frame coupling: the readout of a frame disturbs the event pixels of the same sensor.

    d(t) = A sum over frames of (l(t - t_f) - l(t - t_f - w))
    l(s) = 0 for s < 0, s/r for 0 <= s < r, exp(-(s - r)/tau) from there on

d           disturbance, added to the signal of all pixels behind all poles
A           amplitude [ln]
tau         tau_us
w           width_us: the signal leaps back so long after it leapt; with 0 it only decays
r           rise_us; if that is 0, a twelfth of tau, or of w where that is shorter
t_f         time at which a frame was read out: the end of its exposure, and delay_us more, or less
            if that is below 0

The end of an exposure is the time of the frame on the camera's clock (after clock offset and drift)
plus half of frames.exposure_us.

With period_us, other frames than those of the recording are read out, such as every 20th of a
film's: t_f = delay_us + k period_us on the camera's clock, for all whole k.

All pixels that are within A of a threshold fire at the leap, and others when the signal leaps back.
When a DAVIS240C watches a scene in motion, these are a tenth of all events: ON in the 0.4 ms before
each frame, OFF in about a millisecond after it.

The pixels are at rest at the first frame: there is no leap before it, but with period_us, those
before have gone on, and what is left of them is there from the beginning.  A rise is the longest
step of time there: nothing shows before the leap, and its height is met.  A line through a step of
a twelfth of tau of the decay is off by A/1152.  Intervals that begin when no more than that is
left, 7 tau after a leap has risen, take the steps that they would without it.

Added to the pixels in adv2e/pixel/steps.py and adv2e/kernel/stepped/signal.py.

References
----------
[1] C. Brandli, R. Berner, M. Yang, S.-C. Liu, T. Delbruck, "A 240 x 180 130 dB 3 us Latency Global
    Shutter Spatiotemporal Vision Sensor", IEEE JSSC 49(10), 2014, doi:10.1109/JSSC.2014.2342715
    (frames and events of one photodiode).
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections import deque
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.effects.hooks import Frames, Hooks, LightFrame, Times, View
from adv2e.parameters import Fit, Section, parameter

LABELS = {"frame_coupling": "disturbance by the readout of frames"}
SEPARATED_BY = {
    "frame_coupling": "a scene at rest at two frame rates: the bursts stay with the frames"
}

_STEPS_PER_TAU = 12
_SAME_S = 1e-9
_ROUNDED_S = 1e-6
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
    delay_us: float = parameter(
        0.0,
        unit="us",
        meaning="from the end of an exposure to the leap, below 0: before it; with period_us: the"
        " time of a leap, on the clock of the events",
        fit=Fit(-1e5, 1e5, 0.0),
    )
    width_us: float = parameter(
        0.0,
        unit="us",
        meaning="after so long the signal leaps back; 0: it only decays",
        at_least=0,
        fit=Fit(20.0, 1e5, 1000.0, log=True),
    )
    rise_us: float = parameter(
        0.0,
        unit="us",
        meaning="time that a leap takes; 0: a twelfth of tau_us or width_us",
        at_least=0,
        fit=Fit(1.0, 1e4, 30.0, log=True),
    )
    period_us: float = parameter(
        0.0,
        unit="us",
        meaning="from leap to leap; 0: a leap at each frame",
        at_least=0,
        fit=Fit(1e3, 1e6, 40_000.0, log=True),
    )


class FrameCouplingHooks(Hooks):
    """Adds the disturbance to the signal.

    Parameters
    ----------
    exposed_us : float
        From a frame's time to the end of its exposure.
    every : int
        Of so many frames one was recorded, from the first on; the others were made between them.
    """

    stage = "readout"
    Parameters = FrameCoupling

    def __init__(self, parameters: FrameCoupling, exposed_us: float = 0.0, every: int = 1) -> None:
        super().__init__(parameters)
        self._period_s, self._every = parameters.period_us * 1e-6, every
        self._delay_s = (parameters.delay_us + (0.0 if self._period_s else exposed_us)) * 1e-6
        self._width_s = parameters.width_us * 1e-6
        self._tau_s = parameters.tau_us * 1e-6
        shorter_us = min(parameters.tau_us, parameters.width_us or math.inf)
        self._rise_us = parameters.rise_us or shorter_us / _STEPS_PER_TAU
        self._rise_s = self._rise_us * 1e-6
        self.step_us = parameters.tau_us / _STEPS_PER_TAU

    def begin(self, view: View) -> None:
        super().begin(view)
        # of each leap: its time, and the sum of what all up to it have left at that time
        self._leaps: list[float] = []
        self._sums: list[float] = []
        self._number = 0
        if self._period_s:
            lasts_s = self._rise_s + self._width_s + _FADED * self._tau_s
            first_s = view.start_s - _SAME_S - lasts_s - self._delay_s
            self._next = math.ceil(first_s / self._period_s)

    @property
    def looks_ahead(self) -> bool:
        """True if frames disturb what was before them."""
        return not self._period_s and self._delay_s < 0.0

    def light(self, frames: Frames) -> Frames:
        """Yield the frames as they are, each once all leaps before it are known."""
        ahead_ns = math.ceil(-self._delay_s * 1e9) if self.looks_ahead else 0
        held: deque[LightFrame] = deque()
        for frame in frames:
            held.append(self.light_now(*frame))
            while held and held[0][0] + ahead_ns <= frame[0]:
                yield held.popleft()
        yield from held

    def light_now(self, t_ns: int, light: NDArray[Any]) -> LightFrame:
        if self._period_s:  # other frames than this one
            while (leap_s := self._next * self._period_s + self._delay_s) <= t_ns * 1e-9:
                self._leap(leap_s)
                self._next += 1
            return t_ns, light
        leap_s = t_ns * 1e-9 + self._delay_s
        if self._number % self._every == 0 and leap_s >= self.view.start_s - _SAME_S:
            self._leap(leap_s)
        self._number += 1
        return t_ns, light

    def _leap(self, time: float) -> None:
        left = 0.0
        if self._leaps:
            left = self._sums[-1] * float(np.exp((self._leaps[-1] - time) / self._tau_s))
        self._leaps.append(time)
        self._sums.append(1.0 + left)

    def signal(self, times_s: Times) -> NDArray[np.float64]:
        left = self._left(times_s)
        if self._width_s:
            left = left - self._left(times_s - self._width_s)
        from_s = -math.inf if self._period_s else self.view.start_s
        return np.where(times_s > from_s, self.parameters.amplitude * left, 0.0)

    def _left(self, times_s: Times) -> NDArray[np.float64]:
        """Return the unit step response: the sum over past readouts t_f of exp(-(t - t_f) / tau).

        With a rise time, each decays from the end of its linear rise on.
        """
        if not self._leaps:
            return np.zeros(len(times_s))
        leaps, sums = np.array(self._leaps), np.array(self._sums)
        last = np.searchsorted(leaps, times_s, "right") - 1
        # those that have risen decay alike; frames may follow one another faster than a leap rises
        risen = np.searchsorted(leaps, times_s - self._rise_s, "right") - 1
        waited = np.maximum(times_s - self._rise_s - leaps[risen], 0.0)
        left = np.where(risen >= 0, sums[risen] * np.exp(-waited / self._tau_s), 0.0)
        for more in range(int((last - risen).max(initial=0))):
            rising = (times_s - leaps[last - more]) / self._rise_s
            left += np.where(last - more > risen, np.minimum(rising, 1.0), 0.0)
        return left

    def longest_step_us(self, start_s: float, stop_s: float) -> float:
        """Return the step that resolves the disturbance [us]; no limit once it has decayed."""
        backs = (0.0, self._width_s) if self._width_s else (0.0,)
        return min(self._step_us(start_s - back, stop_s - back) for back in backs)

    def _step_us(self, start_s: float, stop_s: float) -> float:
        before = bisect_left(self._leaps, stop_s) - 1
        if before < 0 or start_s >= self._leaps[before] + self._rise_s + _FADED * self._tau_s:
            return math.inf
        rises = start_s < self._leaps[before] + self._rise_s
        return min(self._rise_us, self.step_us) if rises else self.step_us

    def passed(self, time_s: float) -> None:
        """Forget the leaps that no later time needs."""
        # a later time may be less by as much as it is rounded
        needed_s = time_s - self._width_s - self._rise_s - _ROUNDED_S
        done = max(bisect_left(self._leaps, needed_s) - 1, 0)
        del self._leaps[:done], self._sums[:done]
