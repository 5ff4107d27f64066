"""Clock drift: the clock of the frames does not run as fast as that of the events.

    t = s0 + (s - s0) (1 + rho)

s           stamp of a frame
s0          stamp of the first frame simulated
t           time on the camera's clock, which is the clock of the events
rho         frames.clock_drift_ppm / 1e6

If rho is above 0, the clock of the frames is slow.  The drift comes first, a clock offset is added
to it.  Frames are moved before anything else, so events come out on the camera's clock.

References
----------
[1] D. L. Mills, "Internet time synchronization: the network time protocol", IEEE Transactions on
    Communications 39(10), 1991, doi:10.1109/26.103043 (quartz clocks: 10 to 100 ppm).
"""

from __future__ import annotations

from typing import Any

from numpy.typing import NDArray

from adv2e.effects.hooks import Hooks, LightFrame, View

LABELS = {"clock_drift": "drift of the frames' clock"}
SEPARATED_BY = {
    "clock_drift": "a long recording: the delay between frames and events grows steadily"
}


class ClockDriftHooks(Hooks):
    """Stretches the times of the frames by `ppm`."""

    stage = "frames"
    _first_ns: int | None = None

    def __init__(self, ppm: float) -> None:
        super().__init__()
        self._ppm = ppm

    def begin(self, view: View) -> None:
        super().begin(view)
        self._first_ns = None

    def light_now(self, t_ns: int, light: NDArray[Any]) -> LightFrame:
        if self._first_ns is None:
            self._first_ns = t_ns
        return t_ns + round((t_ns - self._first_ns) * self._ppm * 1e-6), light
