"""Clock offset: the frames are stamped late or early against the events.

    t = s + d

s           stamp of a frame
t           time on the camera's clock, which is the clock of the events
d           frames.clock_offset_us

If d is above 0, stamps are early: the events of a frame come later than it says.  Frames are moved
before anything else, so events come out on the camera's clock.  Usual causes are stamps of the
start or end of an exposure instead of its middle, and the clock of a computer.

References
----------
[1] J. Delmerico, T. Cieslewski, H. Rebecq, M. Faessler, D. Scaramuzza, "Are We Ready for Autonomous
    Drone Racing? The UZH-FPV Drone Racing Dataset", ICRA 2019, doi:10.1109/ICRA.2019.8793887
    (offsets between clocks are estimated).
"""

from __future__ import annotations

from typing import Any

from numpy.typing import NDArray

from adv2e.effects.hooks import Hooks, LightFrame

LABELS = {"clock_offset": "offset of the frames' clock"}
SEPARATED_BY = {
    "clock_offset": "fast and slow motion: the delay is the same for all pixels, speeds and light"
}


class ClockOffsetHooks(Hooks):
    """Moves all frames by `offset_us`."""

    stage = "frames"

    def __init__(self, offset_us: float) -> None:
        super().__init__()
        self._offset_ns = round(offset_us * 1e3)

    def light_now(self, t_ns: int, light: NDArray[Any]) -> LightFrame:
        return t_ns + self._offset_ns, light
