r"""Clock drift: the clock of the frames does not run as fast as that of the events.

.. math:: t = s_0 + (s - s_0)\,(1 + \rho)

with s the stamp of a frame, s_0 that of the first one simulated, t the time on the camera's clock,
the one of the events, and rho = ``frames.clock_drift_ppm`` 1e-6: above 0, the clock of the frames
is slow.  The drift comes first, a clock offset on top.  Frames are moved before anything else, so
events come out on the camera's clock.

References
----------
.. [1] D. L. Mills, "Internet time synchronization: the network time protocol", IEEE Transactions on
   Communications 39(10), 1991, doi:10.1109/26.103043 (quartz clocks: 10 to 100 ppm).
"""

from __future__ import annotations

from adv2e.effects.hooks import Frames, Hooks


class ClockDriftHooks(Hooks):
    """Stretches the times of the frames by `ppm`."""

    stage = "frames"

    def __init__(self, ppm: float) -> None:
        super().__init__()
        self._ppm = ppm

    def light(self, frames: Frames) -> Frames:
        """Yield the frames at their times."""
        first_ns: int | None = None
        for t_ns, light in frames:
            first_ns = t_ns if first_ns is None else first_ns
            yield t_ns + round((t_ns - first_ns) * self._ppm * 1e-6), light
