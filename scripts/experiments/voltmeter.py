r"""DVS-Voltmeter: its published equations, written anew.

Between two frames a pixel's voltage is a Brownian motion with drift.  With the light :math:`L` [DN]
of the two, its mean :math:`\bar L`, their time apart :math:`\Delta t` [us] and six constants

.. math::

    \mu = \frac{k_1}{\bar L + k_2} \frac{\Delta L}{\Delta t} + k_4 + k_5 \bar L, \qquad
    \sigma = \frac{k_3 \sqrt{\bar L}}{\bar L + k_2} + k_6 .

An event is fired when it has moved by 1 up (ON) or down (OFF); then it starts anew.  Algorithm 1
first draws which of both is reached, with distances :math:`a` up and :math:`b` down,

.. math:: P(\mathrm{ON}) = \frac{1 - e^{-2 \mu b / \sigma^2}}{1 - e^{-2 \mu (a + b) / \sigma^2}},

then the time, from the first passage of that level alone: an inverse Gaussian of mean
:math:`a / |\mu|` and shape :math:`a^2 / \sigma^2`, a Lévy distribution without drift.  (Brownian
motion that is known to reach a level against its drift takes as long as with the drift turned
round.)  A time past the end of the interval is no event; the voltage has then moved on by the
interval's share of the way.

What differs from the code of the authors: there, times against the drift are drawn another way,
which has no known distribution, and without drift ON and OFF are equally likely also where one is
nearer.  Both are rare.  That code asks for in-between frames and leaves them to the user; here they
are linear blends.

References
----------
.. [1] S. Lin, Y. Ma, Z. Guo, B. Wen, "DVS-Voltmeter: Stochastic Process-based Event Simulator for
   Dynamic Vision Sensors", ECCV 2022, equations 10 and 11, algorithm 1; constants of
   github.com/Lynn0306/DVS-Voltmeter, src/config.py.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.events import Events, make_events, sort_events
from experiments.clip import Clip

Values = NDArray[np.float64]

CONSTANTS = {
    "DVS346": (0.00018 * 29250, 20.0, 0.0001, 1e-7, 5e-9, 0.00001),
    "DVS240": (0.000094 * 47065, 23.0, 0.0002, 1e-7, 5e-8, 0.00001),
}
"""k1 to k6, times in us."""


def motion(
    before: NDArray[Any], after: NDArray[Any], step_us: float, constants: tuple[float, ...]
) -> tuple[Values, Values]:
    """Return drift [1/us] and deviation [1/sqrt(us)] of the voltage between two frames [DN]."""
    k1, k2, k3, k4, k5, k6 = constants
    light = 0.5 * (before.astype(np.float64) + after)
    change = (after.astype(np.float64) - before) / step_us
    return (k1 * change / (light + k2) + k4 + k5 * light, k3 * np.sqrt(light) / (light + k2) + k6)


def chance_of_on(up: Values, down: Values, drift: Values, deviation: Values) -> Values:
    """Return the chance that `up` is reached before `down`, both distances above 0."""
    pull = 2.0 * drift / deviation**2
    against = pull < 0
    near = np.where(against, up, down)  # with the drift turned round where it is against
    pull = np.abs(pull)
    with np.errstate(invalid="ignore"):
        along = np.expm1(-pull * near) / np.expm1(-pull * (up + down))
    along = np.where(pull * (up + down) < 1e-12, near / (up + down), along)
    return np.where(against, 1.0 - along, along)


def passage_times(
    distance: Values, drift: Values, deviation: Values, rng: np.random.Generator
) -> Values:
    """Draw first passage times of a level [us], with the drift towards it or none.

    As Michael, Schucany and Haas (1976), in a form in which nothing cancels and drift may be 0.
    """
    spread = 0.5 * (deviation * rng.standard_normal(len(distance))) ** 2 / distance
    root = drift + spread + np.sqrt(spread * (spread + 2.0 * drift))
    early = distance / root
    # the other root of the quadratic equation, in its share of the cases
    late = rng.random(len(distance)) * (distance + early * drift) > distance
    return np.divide(distance**2, drift**2 * early, out=early, where=late)


@dataclass(frozen=True)
class Voltmeter:
    """DVS-Voltmeter.

    Attributes
    ----------
    parts : int
        In-between steps of an interval.
    levels : (float, float)
        Distances up and down that fire; 1 as published.
    """

    parts: int = 10
    levels: tuple[float, float] = (1.0, 1.0)
    name: str = "dvs-voltmeter"
    nature: str = "its published equations, written anew (constants of the size of the sensor)"

    def events(self, clip: Clip, seed: int) -> Events:
        """Return the events of a clip."""
        rng = np.random.default_rng(seed)
        constants = CONSTANTS["DVS240" if clip.size[0] <= 240 else "DVS346"]
        moved = np.zeros(clip.size[0] * clip.size[1])
        steps = clip.blended(self.parts)
        t_ns, before = next(steps)
        found = []
        for next_ns, after in steps:
            of_step = motion(before.ravel(), after.ravel(), 1e-3 * (next_ns - t_ns), constants)
            found += self._step(moved, *of_step, 1e-3 * t_ns, 1e-3 * next_ns, rng)
            t_ns, before = next_ns, after
        pixels, times, signs = (np.concatenate(column) for column in zip(*found, strict=True))
        rows, columns = np.divmod(pixels, clip.size[0])
        return sort_events(make_events(np.rint(times), columns, rows, signs))

    def _step(
        self,
        moved: Values,
        drift: Values,
        deviation: Values,
        start: float,
        stop: float,
        rng: np.random.Generator,
    ) -> list[tuple[Any, ...]]:
        """Return pixels, times [us] and polarities of a step, in rounds; `moved` is kept up."""
        found: list[tuple[Any, ...]] = []
        at = np.arange(len(moved))
        now = np.full(len(moved), start)
        while len(at):
            up, down = self.levels[0] - moved[at], self.levels[1] + moved[at]
            on = rng.random(len(at)) < chance_of_on(up, down, drift[at], deviation[at])
            distance = np.where(on, up, down)
            took = passage_times(distance, np.abs(drift[at]), deviation[at], rng)
            fires = now + took < stop
            way = np.where(on, distance, -distance) * (stop - now) / took
            moved[at] = np.where(fires, 0.0, moved[at] + np.where(fires, 0.0, way))
            at, now, on = at[fires], (now + took)[fires], on[fires]
            found.append((at, now, on))
        return found

    def with_levels(self, on: float, off: float) -> Voltmeter:
        """Return it with other thresholds; 1 as published."""
        return replace(self, levels=(on, off))
