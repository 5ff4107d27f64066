r"""What statistics owe to the interpolation between frames, and how well that is known.

Between frames a simulation knows nothing of the light.  What it makes up changes each statistic by
an error e, of which the change d tells that leaving out every second frame makes.  Where motion is
resolved, interpolation is wrong by what the light bends, to leading order by the square of the time
between frames, so that e = d/3 (Richardson extrapolation [1]_); where it is not, or moves along
optical flow, e is about as large but hardly goes with d.  So, in deviations of chance, compressed
(:mod:`adv2e.diagnosis.metric`),

.. math:: e = \tfrac{1}{4} d \pm \tfrac{1}{2} \sqrt{d^2 + \overline{d^2}},

with the mean over the statistics of a group: where one happens not to change, others of its kind
tell what to expect.  The first part is taken off all simulations.

``scripts/study_interpolation_error.py`` measures e, and what is left of it beside its doubt, on
scenes seen at 2000 frames a second of which a 4th to 64th is taken; numbers here were chosen on
others like them.

References
----------
.. [1] L. F. Richardson, "The approximate arithmetical solution by finite differences of physical
   problems", Philosophical Transactions of the Royal Society A 210, 1911,
   doi:10.1098/rsta.1911.0009.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.config import Config
from adv2e.diagnosis.evidence import Evidence
from adv2e.diagnosis.markers import Markers
from adv2e.diagnosis.metric import compressed, expanded
from adv2e.diagnosis.scene import Placed, Scene
from adv2e.diagnosis.simulations import Simulator
from adv2e.diagnosis.stream import Stream

Array = NDArray[np.float64]

_TAKEN_OFF = 0.25
_DOUBT = 0.5
_SPREAD = 0.5  # of the logarithm
_TAIL = 4.0
_FEWEST = 5
"""Frames that must be left for a simulation to say anything."""


@dataclass(frozen=True)
class InterpolationError:
    """Error of each statistic that is due to interpolation, in every view.

    Between frames, and between pixels (:mod:`adv2e.diagnosis.resampling`).

    Attributes
    ----------
    bias : (views, statistics)
        By how much simulations exceed what they would be without it, as far as is known.
    sd : (views, statistics)
        Uncertainty of that.
    """

    bias: Array
    sd: Array

    @classmethod
    def none(cls, shape: tuple[int, ...]) -> InterpolationError:
        """Return no error."""
        return cls(np.zeros(shape), np.zeros(shape))

    @classmethod
    def of(cls, full: Any, half: Any, groups: Sequence[str], least: Array) -> InterpolationError:
        """Return the error that follows from simulations with frames left out.

        Parameters
        ----------
        full, half : (seeds, views, statistics)
            With all frames, and with every second, of the same seeds.
        groups : sequence of str
            Of each statistic, which go together.
        least : (statistics,)
            Deviation below which each statistic is not trusted to be known.
        """
        deviation = np.maximum(full.std(axis=0, ddof=1), least)
        apart = (half - full) / deviation
        change = compressed(beyond_chance(apart))
        chance = np.minimum(apart.var(axis=0, ddof=1) / len(apart), 1.0)
        square = compressed(apart.mean(axis=0)) ** 2 - chance
        usual = np.empty_like(change)
        for group in dict.fromkeys(groups):
            own = np.array([one == group for one in groups])
            usual[:, own] = square[:, own].mean(axis=1, keepdims=True)
        doubt = _DOUBT * np.sqrt(change**2 + np.maximum(usual, 0.0))
        return cls(deviation * expanded(_TAKEN_OFF * change), deviation * doubt)

    def blurred(self, sample: Array, view: int, stream: int) -> Array:
        """Return simulations, (seeds, statistics), spread by what is uncertain.

        How far one recording is off in all is uncertain, too, and single statistics are off by more
        than the others.  The draws have a mean of zero, are the same for every model, and differ
        between streams.
        """
        random = np.random.default_rng([stream, view, len(sample)])
        single = random.standard_t(_TAIL, sample.shape) / np.sqrt(_TAIL / (_TAIL - 2.0))
        in_all = np.exp(_SPREAD * random.normal(size=(len(sample), 1)) - _SPREAD**2)
        draws = single * in_all
        return np.asarray(sample + (draws - draws.mean(axis=0)) * self.sd[view])

    def doubt(self, total: Array, view: int) -> float:
        """Return what is uncertain in deviations of chance, root mean square.

        Parameters
        ----------
        total : (statistics,)
            Deviations of chance and of what is uncertain together.
        view : int
        """
        chance = np.maximum(total**2 - self.sd[view] ** 2, 0.01 * total**2)
        return float(np.sqrt(np.mean(self.sd[view] ** 2 / chance)))


def beyond_chance(differences: Any) -> Array:
    """Return the mean over seeds, less what chance puts into it."""
    mean = differences.mean(axis=0)
    error = differences.std(axis=0, ddof=1) / np.sqrt(len(differences))
    return np.asarray(np.sign(mean) * np.sqrt(np.maximum(mean**2 - error**2, 0.0)))


def interpolation_error(
    evidence: Evidence,
    declared: Config,
    scene: Scene,
    markers: Markers,
    pilot: dict[int, Stream],
    simulator: Callable[[Evidence], Simulator],
) -> InterpolationError | None:
    """Simulate with frames left out, and return what the interpolation is worth.

    Parameters
    ----------
    evidence : Evidence
    declared : Config
    scene : Scene
    markers : Markers
    pilot : dict of Stream
        Simulations of all frames by their seeds.
    simulator : callable
        Makes a simulator of a recording.

    Returns
    -------
    InterpolationError or None
        None: too few frames to leave any out.
    """

    def measured(streams: list[Stream]) -> Any:
        return np.array([markers.measure(Placed.of(stream, scene)) for stream in streams])

    half = every(evidence, 2)
    if len(half.frames) < _FEWEST:
        return None
    with closing(simulator(half)) as made:
        left_out = made.map(lambda seed: made.stream(declared, seed), pilot)
    full = list(pilot.values())
    return InterpolationError.of(measured(full), measured(left_out), markers.titles, markers.least)


def every(evidence: Evidence, step: int) -> Evidence:
    """Return the recording with every `step`-th frame, and the last."""
    keep = sorted({*range(0, len(evidence.frames), step), len(evidence.frames) - 1})
    return replace(
        evidence, frames=[evidence.frames[k] for k in keep], times_s=evidence.times_s[keep]
    )
