"""Reference for candidates: the recording, and simulations on the scale of the declared model."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from adv2e.config import Config
from adv2e.diagnosis.fitting.candidates import FITTED, NOTHING, Candidate
from adv2e.diagnosis.fitting.fitted import Fitted, parted
from adv2e.diagnosis.fitting.fitter import Fitter
from adv2e.diagnosis.statistics.groups import least_deviations
from adv2e.diagnosis.statistics.metric import Ensemble, Scale
from adv2e.diagnosis.statistics.summary import BOTH, VIEWS, Sampler
from adv2e.diagnosis.statistics.uncertainty import FrameError, Resampling
from adv2e.reports.result import Rejected

Array = NDArray[np.float64]

MANY, SOME = 100, 32
"""Simulations of a model that is kept, and of one that is tried."""
CATCHES_UP = 60.0
"""Log likelihood that a fit may gain when it is brought to its end."""
FURTHER = range(1001, 2001)
"""Seeds of those that tell how often chance makes what none of the many did."""

_OF_SCALES, _OF_MODELS, OF_RECORDINGS, _OF_SHIFTED = 1, 2, 3, 4
"""Purposes of simulations, as random streams: each draws frame errors of its own."""
_SEEDS = 4
"""Of one step of a fit; the last ones make a mean over twelve simulations."""
_LAST_ROUNDS = [range(first, first + _SEEDS) for first in range(21, 21 + 6 * _SEEDS, _SEEDS)]
_ROUNDS = 4
_SETTLED = 0.25  # deviations
_REACH = 0.4
"""Of the derivatives of fits that are near their end."""


@dataclass(frozen=True)
class State:
    """A model: configuration, the fits that made it, and its simulations in every view.

    `alternatives`: of effects that were added, others that cannot be told from them.
    """

    config: Config
    fits: tuple[Fitted, ...]
    ensembles: tuple[Ensemble, ...]
    alternatives: Mapping[str, frozenset[str]] = field(default_factory=dict)

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(fit.candidate.name for fit in self.fits)

    @property
    def left(self) -> float:
        """Share of the residual that is put down to the fit of its effects."""
        return max((fit.candidate.left for fit in self.fits), default=0.0)

    @property
    def is_undone(self) -> bool:
        """Its effects can all be undone in full: no more than usual is put down to their fit."""
        return self.left <= FITTED

    @property
    def rivals(self) -> list[str]:
        """Effects that cannot be told from those that were added, sorted."""
        return sorted(frozenset().union(*self.alternatives.values()) - set(self.names))

    def beyond(self, ground: State) -> tuple[Fitted, ...]:
        return self.fits[len(ground.fits) :]


@dataclass
class Rejections:
    """Reasons for which effects were not added: of each round, that of an effect's best form."""

    held: dict[str, Rejected] = field(default_factory=dict)
    _this_round: set[str] = field(default_factory=set)

    def new_round(self) -> None:
        """Let reasons take the place of earlier ones."""
        self._this_round.clear()

    def add(self, fit: Fitted, reason: str, *, final: bool = False) -> None:
        """Note the reason to reject an effect; `final` ones replace those of the same round."""
        name = fit.candidate.name
        if final or name not in self._this_round:
            self._this_round.add(name)
            self.held[name] = Rejected(name, reason, fit.settings)


class Reference:
    """The recording, the scales of its statistics, and the means to simulate.

    Parameters
    ----------
    observed : (views, statistics)
        Of the recording.
    error : FrameError, optional
        Of the statistics.
    log : callable
        Told of each step.
    nuisances : Candidate
        Keys that are not known: fitted with all effects, whatever these are.
    begin : callable
        Told of each stage, in a few words.
    """

    def __init__(
        self,
        sampler: Sampler,
        observed: Array,
        declared: Config,
        error: FrameError | None = None,
        log: Callable[[str], None] = lambda text: None,
        nuisances: Candidate = NOTHING,
        begin: Callable[[str], None] = lambda stage: None,
    ) -> None:
        self.sampler, self.observed, self.log, self.begin = sampler, observed, log, begin
        self.error = error or FrameError.none(observed.shape)
        self.declared, self.nuisances = declared, nuisances
        self._resampling, self.rejections = Resampling(sampler, declared), Rejections()

    @cached_property
    def scales(self) -> tuple[Scale, ...]:
        """Scales of the statistics, one a view, from simulations of the declared model."""
        # not the simulations that misfits are compared with: those would fit too well
        sample = self.sampler.sample(self.declared, range(MANY + 1, 2 * MANY + 1))
        statistics = self.sampler.statistics

        def of(view: int) -> Scale:
            rows = self.error.blurred(sample[:, view], view, _OF_SCALES)
            known = least_deviations(statistics.entries, statistics.least, rows.mean(axis=0))
            return Scale.of(rows, known)

        return tuple(map(of, range(VIEWS)))

    @property
    def doubt(self) -> float:
        """Uncertainty that frames leave in the statistics, in deviations of chance, RMS."""
        return self.error.doubt(self.error.chance(self.scales[BOTH].sd, BOTH), BOTH)

    def fitter(
        self, view: int, near: Config, sd: Array | None = None, *, rough: bool = False
    ) -> Fitter:
        """Return a fitter of candidates in one view of the data, for models near `near`.

        The bias of shifted frames is that of `near`.
        """
        sampler = self.sampler.rough if rough else self.sampler
        shifted = self._resampling.error(near)
        goal = self.observed[view] + (0.0 if shifted is None else shifted.bias[view])
        return Fitter(sampler, self.scales[view], goal, view, sd)

    def ensembles(
        self, config: Config, seeds: Sequence[int], beside: Config | None = None
    ) -> tuple[Ensemble, ...]:
        """Return, for each view, simulations of a configuration.

        `beside`: another that they are compared with.  What is as uncertain in that one, as its
        frames are shifted, is so in these, too: or else it would gain by its doubt alone.
        """
        sample, shifted = self.sampler.sample(config, seeds), self._resampling.error(config)
        doubted = None
        if shifted is None and beside is not None:
            doubted = self._resampling.error(beside)

        def of(view: int) -> Ensemble:
            rows = self.error.blurred(sample[:, view], view, _OF_MODELS)
            if shifted is not None:
                rows = shifted.blurred(rows - shifted.bias[view], view, _OF_SHIFTED)
            elif doubted is not None:
                rows = doubted.blurred(rows, view, _OF_SHIFTED)
            return Ensemble.of(self.scales[view], rows)

        return tuple(map(of, range(VIEWS)))

    def further(self, config: Config) -> tuple[Array, ...]:
        """Return, for each view, further simulations in compressed deviations."""
        return tuple(one.sample for one in self.ensembles(config, FURTHER))

    def tried(self, config: Config, beside: Config | None = None) -> tuple[Ensemble, ...]:
        """Return simulations of a configuration, often enough to judge it; see `ensembles`."""
        return self.ensembles(config, range(1, SOME + 1), beside)

    def compared(self, state: State, beside: State) -> State:
        """Return a model as it is compared with another, as often; see :meth:`ensembles`."""
        seeds = range(1, len(beside.ensembles[BOTH].sample) + 1)
        ensembles = self.ensembles(state.config, seeds, beside.config)
        return dataclasses.replace(state, ensembles=ensembles)

    def state(self, config: Config, fits: tuple[Fitted, ...] = ()) -> State:
        """Return a model, simulated often enough to build on it."""
        return State(config, fits, self.ensembles(config, range(1, MANY + 1)))

    def settled(self, fits: tuple[Fitted, ...], sd: Array) -> State:
        """Return the model of effects fitted together to the data for training and validation.

        How precise the fits are is told by its simulations.
        """
        joint = self.fitted(fits, sd, BOTH)
        state = self.state(joint.config)
        if joint.derivative.size:
            fitter = self.fitter(BOTH, joint.config, sd)
            fitter.set_covariance(joint, state.ensembles[BOTH].sample)
        return dataclasses.replace(state, fits=parted(joint, fits))

    def fitted(self, fits: tuple[Fitted, ...], sd: Array, view: int) -> Fitted:
        """Return the fit of all effects together in a view of the data."""
        joint = self._joined(fits)
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

    def _joined(self, fits: tuple[Fitted, ...]) -> Fitted:
        """Return one fit of all effects together, and of the nuisances, the last."""
        nuisances = self.nuisances
        joint = Candidate.joined([*(fit.candidate for fit in fits), nuisances])
        start = nuisances.scaled(nuisances.starts[0])
        point = np.concatenate([*(fit.point for fit in fits), start])
        return Fitted(joint, self.declared, point, reach=_REACH)

    def misfit(self, state: State, view: int = BOTH) -> float:
        return state.ensembles[view].misfit(self.observed[view])

    def likelihood(self, state: State, view: int = BOTH) -> float:
        return state.ensembles[view].log_likelihood(self.observed[view])
