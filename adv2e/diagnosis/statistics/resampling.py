r"""What statistics owe to shifting frames by parts of a pixel, and how well that is known.

What is finer than a pixel is not in the frames, so that they cannot be shifted by parts of a pixel
without error, most of all where edges are sharp.  How much that changes a statistic s is told by
moving the frames of the declared model there and back, which adds nothing but the error, twice,
though less the second time, when what is finest is gone already:

.. math:: b = \tfrac{3}{4} (s_{there\ and\ back} - s_{as\ declared})

is taken off all simulations with that shift, and counted as uncertain by as much.

Recordings by a camera that sees its scene where it is depart from plain simulations with their
shift by 0.6 to 1.1 of that change (the six of eight recordings that it changes most), and single
statistics from that by some 0.6 of it.
"""

from __future__ import annotations

from adv2e.config import Config
from adv2e.diagnosis.fitting.keys import with_keys
from adv2e.diagnosis.fitting.simulations import Laboratory
from adv2e.diagnosis.statistics.frame_error import FrameError, beyond_chance

_SHARE = 0.75
_SEEDS = range(1, 17)
_STEP_PX = 0.05
"""Shifts that differ by less are given the same error, as it hardly changes."""


class Resampling:
    """Errors of simulations with shifted frames, each found when it is asked for first.

    Parameters
    ----------
    laboratory : Laboratory
    declared : Config
    """

    def __init__(self, laboratory: Laboratory, declared: Config) -> None:
        self._laboratory = laboratory
        self._unmoved = with_keys(declared, {"frames.shift_px": [0.0, 0.0]})
        self._held: dict[tuple[float, float], FrameError] = {}

    def error(self, config: Config) -> FrameError | None:
        """Return the error of a model's statistics; None where no part of a pixel is shifted."""
        x, y = (_STEP_PX * round(part / _STEP_PX) for part in config.frames.shift_px)
        if x == round(x) and y == round(y):
            return None
        if (x, y) not in self._held:
            self._held[x, y] = self._there_and_back((x, y))
        return self._held[x, y]

    def _there_and_back(self, shift_px: tuple[float, float]) -> FrameError:
        plain = self._laboratory.ensemble(self._unmoved, _SEEDS)
        back = self._laboratory.there_and_back(self._unmoved, shift_px, _SEEDS)
        bias = _SHARE * beyond_chance(back - plain)
        return FrameError(bias, abs(bias))
