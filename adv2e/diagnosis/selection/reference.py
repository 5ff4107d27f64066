"""What candidates are measured against: the recording, and simulations on the declared scale."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.config import Config
from adv2e.diagnosis.fitting.candidates import NOTHING_KNOWN, Candidate, Knob, neutral_value
from adv2e.diagnosis.fitting.fit import Fitted, Fitter
from adv2e.diagnosis.fitting.simulations import Laboratory
from adv2e.diagnosis.selection.rejections import Rejections
from adv2e.diagnosis.statistics import BOTH, VIEWS
from adv2e.diagnosis.statistics.frame_error import FrameError
from adv2e.diagnosis.statistics.metric import Model, Scale
from adv2e.diagnosis.statistics.resampling import Resampling

Array = NDArray[np.float64]

MANY, SOME = 100, 32
"""Simulations of a model that is kept, and of one that is tried."""

_OF_SCALES, _OF_MODELS, OF_RECORDINGS, _OF_SHIFTED = 1, 2, 3, 4
"""What simulations stand for, each with draws of its own of what is uncertain in them."""
_SEEDS = 6
_LAST_ROUNDS = [range(first, first + _SEEDS) for first in range(21, 57, _SEEDS)]
_ROUNDS = 4
_SETTLED = 0.25  # deviations
_REACH = 0.4
"""Of the derivatives of fits that are near their end."""


@dataclass(frozen=True)
class State:
    """A model: configuration, the fits that made it, and its simulations in every view.

    Attributes
    ----------
    config : Config
    fits : tuple of Fitted
    models : tuple of Model
        One a view.
    alternatives : mapping of str to frozenset of str
        Of effects that were added, others that cannot be told from them.
    """

    config: Config
    fits: tuple[Fitted, ...]
    models: tuple[Model, ...]
    alternatives: Mapping[str, frozenset[str]] = field(default_factory=dict)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the effects that were added."""
        return tuple(fit.candidate.name for fit in self.fits)

    def beyond(self, ground: State) -> tuple[Fitted, ...]:
        """Return the effects that were added to those of another model."""
        return self.fits[len(ground.fits) :]


@dataclass(frozen=True)
class Bench:
    """The recording, the scales of its statistics, and the means to simulate.

    Attributes
    ----------
    laboratory : Laboratory
    observed : (views, statistics)
        Of the recording.
    declared : Config
    scales : tuple of Scale
        One a view.
    error : FrameError
        Of the statistics.
    resampling : Resampling
        Of models that shift the frames.
    log : callable
        Told of each step.
    free : tuple of Knob
        Keys that are not known: fitted with all effects, whatever these are.
    rejections : Rejections
    """

    laboratory: Laboratory
    observed: Array
    declared: Config
    scales: tuple[Scale, ...]
    error: FrameError
    resampling: Resampling
    log: Callable[[str], None]
    free: tuple[Knob, ...] = ()
    rejections: Rejections = field(default_factory=Rejections)

    @classmethod
    def of(
        cls,
        laboratory: Laboratory,
        observed: Array,
        declared: Config,
        error: FrameError | None,
        log: Callable[[str], None],
        free: tuple[Knob, ...] = (),
    ) -> Bench:
        """Return the bench of a declared model, which is simulated for the scales."""
        error = error or FrameError.none(observed.shape)
        # not the simulations that misfits are compared with: those would fit too well
        sample = laboratory.ensemble(declared, range(MANY + 1, 2 * MANY + 1))
        least = laboratory.markers.least
        scales = tuple(
            Scale.of(error.blurred(sample[:, view], view, _OF_SCALES), least)
            for view in range(VIEWS)
        )
        resampling = Resampling(laboratory, declared)
        return cls(laboratory, observed, declared, scales, error, resampling, log, free)

    def fitter(
        self, view: int, near: Config, sd: Array | None = None, *, first_look: bool = False
    ) -> Fitter:
        """Return what fits candidates in one view of the data, to models near one.

        Simulations with shifted frames are as far off as those of that model.  A `first_look` takes
        rougher ones.
        """
        laboratory = self.laboratory.for_a_first_look if first_look else self.laboratory
        shifted = self.resampling.error(near)
        goal = self.observed[view] + (0.0 if shifted is None else shifted.bias[view])
        return Fitter(laboratory, self.scales[view], goal, view, sd)

    def models(self, config: Config, sample: Any) -> tuple[Model, ...]:
        """Return the models of a configuration's simulations, (seeds, views, statistics)."""
        shifted = self.resampling.error(config)

        def of(view: int) -> Model:
            rows = self.error.blurred(sample[:, view], view, _OF_MODELS)
            if shifted is not None:
                rows = shifted.blurred(rows - shifted.bias[view], view, _OF_SHIFTED)
            return Model.of(self.scales[view], rows)

        return tuple(map(of, range(VIEWS)))

    def tried(self, config: Config) -> tuple[Model, ...]:
        """Return the models of a configuration, simulated often enough to judge it."""
        return self.models(config, self.laboratory.ensemble(config, range(1, SOME + 1)))

    def state(self, config: Config, fits: tuple[Fitted, ...] = ()) -> State:
        """Return a model, simulated often enough to build on it."""
        sample = self.laboratory.ensemble(config, range(1, MANY + 1))
        return State(config, fits, self.models(config, sample))

    def settled(self, fits: tuple[Fitted, ...], sd: Array) -> State:
        """Return the model of effects fitted together to the data for fitting and judging.

        How precise the fits are is told by its simulations.
        """
        joint = self.fitted(fits, sd, BOTH)
        state = self.state(joint.config)
        if joint.derivative.size:
            fitter = self.fitter(BOTH, joint.config, sd)
            fitter.set_covariance(joint, state.models[BOTH].sample)
        return dataclasses.replace(state, fits=parted(joint, fits))

    def fitted(self, fits: tuple[Fitted, ...], sd: Array, view: int) -> Fitted:
        """Return the fit of all effects together in a view of the data."""
        joint = _joined(fits, self.declared, self.free)
        for _ in range(_ROUNDS):
            fitter = self.fitter(view, joint.config, sd)
            fitter.improve([joint], range(11, 11 + _SEEDS))
            if joint.moved < _SETTLED:
                break
        if joint.derivative.size:
            self.fitter(view, joint.config, sd).refine(joint, _LAST_ROUNDS)
            if joint.moved > 1.0:
                names = " and ".join(fit.candidate.name for fit in fits)
                self.log(f"  {names}: the last step of the fit moved it by {joint.moved:.1f} sd")
        return joint

    def misfit(self, state: State, view: int = BOTH) -> float:
        """Return how far the recording is from a model."""
        return state.models[view].misfit(self.observed[view])

    def likelihood(self, state: State, view: int = BOTH) -> float:
        """Return the log likelihood of the recording under a model."""
        return state.models[view].log_likelihood(self.observed[view])


def likely_of_a_fit(knobs: int) -> int:
    """Return about how many simulations it takes to fit so many keys together."""
    return _SEEDS * (2 * (knobs + 3) + 4 * (2 * knobs + 1))


def _joined(fits: tuple[Fitted, ...], declared: Config, free: tuple[Knob, ...]) -> Fitted:
    """Return one fit of all effects together, and of the keys that are not known, the last."""
    knobs = (*(knob for fit in fits for knob in fit.candidate.knobs), *free)
    extra = tuple(pair for fit in fits for pair in fit.candidate.extra)
    defaults = tuple(pair for fit in fits for pair in fit.candidate.defaults)
    known = tuple(pair for fit in fits for pair in fit.candidate.known_or_not)
    known += (NOTHING_KNOWN,) * len(free)
    name = " and ".join(fit.candidate.name for fit in fits)
    unknown = [knob.inner(neutral_value(declared, knob)) for knob in free]
    place = np.concatenate([*(fit.place for fit in fits), unknown])
    pulse = next((fit.candidate.pulse for fit in fits), None)
    joint = Candidate(name, knobs, (), extra, defaults, known=known, pulse=pulse)
    return Fitted(joint, declared, place, reach=_REACH)


def parted(joint: Fitted, fits: tuple[Fitted, ...]) -> tuple[Fitted, ...]:
    """Return the effects of a joined fit, each with its own place and covariance."""
    result, start = [], 0
    for fit in fits:
        stop = start + len(fit.candidate.knobs)
        own = slice(start, stop)
        place, covariance = joint.place[own], joint.covariance[own, own]
        result.append(Fitted(fit.candidate, fit.base, place, joint.misfit, covariance=covariance))
        start = stop
    return tuple(result)
