r"""What statistics owe to the interpolation between frames, and how well that is known.

Between frames a simulation knows nothing of the light.  What it makes up changes each statistic by
an error e, of which the change d tells that leaving out every second frame makes.  In deviations of
chance, compressed (:mod:`adv2e.diagnosis.metric`),

.. math:: e = \tfrac{1}{4} d \pm f \sqrt{\tfrac{1}{2} (d^2 + \overline{d^2})},

with the mean over the statistics of a group: where one happens not to change, others of its kind
tell what to expect.  The first part is taken off all simulations.

How much is uncertain, f, depends on whether the frames resolve the motion.  Where they do, frames
that are blended are wrong by what the light bends, to leading order by the square of the time
between them: e = d/3 (Richardson extrapolation [1]_), and leaving out three of four frames changes
five times as much as every second; where they do not, the two changes are about as large, as is e.
So the ratio r of the two tells what to expect, :math:`f = (1.2 / r)^{1.8}`.  Frames that are moved
along their optical flow are wrong where that is, whatever the time between them: e hardly goes with
d, nor f with r.

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
_MOVED = 0.7
_BLENDED = (0.2, 1.0)
_SPREAD = 0.45  # of the logarithm
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
    def of(
        cls, full: Any, half: Any, quarter: Any, groups: Sequence[str], least: Array
    ) -> InterpolationError:
        """Return the error that follows from simulations with frames left out.

        Parameters
        ----------
        full, half : (seeds, views, statistics)
            With all frames, and with every second, of the same seeds.
        quarter : (seeds, views, statistics), optional
            With every fourth frame, where frames are blended.
        groups : sequence of str
            Of each statistic, which go together.
        least : (statistics,)
            Deviation below which each statistic is not trusted to be known.
        """
        deviation = np.maximum(full.std(axis=0, ddof=1), least)

        def changed(sample: Any) -> Array:
            return compressed(beyond_chance((sample - full) / deviation))

        change = changed(half)
        share = _MOVED if quarter is None else _blended(changed(quarter), change)
        usual = _usual_squares((half - full) / deviation, groups)
        uncertain = expanded(share * np.sqrt((change**2 + usual) / 2.0))
        return cls(deviation * expanded(_TAKEN_OFF * change), deviation * uncertain)

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

    def left(step: int) -> Any:
        fewer = every(evidence, step)
        if len(fewer.frames) < _FEWEST:
            return None
        with closing(simulator(fewer)) as made:
            return measured(made.map(lambda seed: made.stream(declared, seed), pilot))

    half = left(2)
    if half is None:
        return None
    quarter = left(4) if declared.sampling.interpolation == "linear" else None
    full = measured(list(pilot.values()))
    return InterpolationError.of(full, half, quarter, markers.titles, markers.least)


def _usual_squares(differences: Any, groups: Sequence[str]) -> Array:
    """Return the mean squared change of each statistic's group, less what chance puts into it."""
    chance = np.minimum(differences.var(axis=0, ddof=1) / len(differences), 1.0)
    squares = compressed(differences.mean(axis=0)) ** 2 - chance
    usual = np.empty_like(squares)
    for group in dict.fromkeys(groups):
        own = np.array([one == group for one in groups])
        usual[:, own] = squares[:, own].mean(axis=1, keepdims=True)
    return np.maximum(usual, 0.0)


def _blended(of_quarter: Array, of_half: Array) -> float:
    """Return the share of the change that is uncertain where frames are blended.

    Parameters
    ----------
    of_quarter, of_half : (views, statistics)
        Changes that leaving out three of four frames makes, and every second.
    """
    square = float(np.mean(of_half**2))
    ratio = np.sqrt(np.mean(of_quarter**2) / square) if square > 0.0 else np.inf
    return float(np.clip((1.2 / ratio) ** 1.8, *_BLENDED))


def every(evidence: Evidence, step: int) -> Evidence:
    """Return the recording with every `step`-th frame, and the last."""
    keep = sorted({*range(0, len(evidence.frames), step), len(evidence.frames) - 1})
    return replace(
        evidence, frames=[evidence.frames[k] for k in keep], times_s=evidence.times_s[keep]
    )
