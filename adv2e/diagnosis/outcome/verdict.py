"""Verdict on a recording: error on test data, what would have been seen, and wording."""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.comparison.distances import SIGMAS_US, smoothed_norms
from adv2e.config import Config
from adv2e.diagnosis.configurations import without_coupling
from adv2e.diagnosis.data import splits
from adv2e.diagnosis.data.splits import Stream
from adv2e.diagnosis.fitting.candidates import Candidate, neutral_value
from adv2e.diagnosis.hints.readouts import DRIFT
from adv2e.diagnosis.outcome.picture import pictures_of
from adv2e.diagnosis.prepare import Prepared
from adv2e.diagnosis.selection.reference import OF_RECORDINGS, Reference, State
from adv2e.diagnosis.selection.search import PER_LOOK, Outcome, Search
from adv2e.diagnosis.simulation.simulator import Simulator
from adv2e.diagnosis.statistics.metric import Ensemble, expanded
from adv2e.diagnosis.statistics.summary import BOTH
from adv2e.diagnosis.statistics.uncertainty import every
from adv2e.effects import label_of
from adv2e.reports.markup import known_keys
from adv2e.reports.result import Detectable, ErrorRow, Estimate, Verdict

_PARTLY = 0.8
"""Share of the residual that effects must explain to be named when something is left."""

_ERROR_PARTLY, _ERROR_EXPLAINED = 0.9, 0.75
"""The same of what the error can fall by, on the test data, when something is left, and when all
statistics are explained."""

_MOST = 0.5
"""Both shares of effects that are certain, as the events themselves show when they act: in bursts
of all pixels, at each frame or with a period of their own.  No other effect makes those."""


def verdict_of(outcome: Outcome, error: ErrorRow, interpolated: float = 0.0) -> Verdict:
    """Return the verdict.

    By the error of the declared model and of that where the search ended, and what interpolation
    between the frames adds to it, in squares.
    """
    if not outcome.state.fits:
        return "consistent" if outcome.complete else "unexplained"
    gone, at_most = _gone(error, interpolated)
    if not outcome.complete:
        certain = all(fit.candidate.is_seen for fit in outcome.state.fits)
        least = (_MOST, _MOST) if certain else (_PARTLY, _ERROR_PARTLY)
        partly = outcome.explained >= least[0] and gone >= least[1] and not _too_near(error)
        return "partly_explained" if partly else "unexplained"
    if at_most < _ERROR_EXPLAINED:
        return "unexplained"
    return "not_identifiable" if outcome.alternatives else "explained"


def _gone(error: ErrorRow, interpolated: float) -> tuple[float, float]:
    """Return the fall of the error as a share of the largest possible, and its bound (97.5 %).

    One where the error tells nothing of the effect.  Statistics fall for any effect that does some
    of what is missing; events come where they are measured only for those that do it where and when
    it happens.
    """
    before, after, floor = error.before, error.after, error.floor
    if before.interval is None or floor.interval is None or after.interval is None:
        return 1.0, 1.0
    if not before.interval[0] > math.hypot(floor.interval[1], 2.0 * interpolated):
        return 1.0, 1.0  # nor where there is none
    # no model with these frames comes nearer; how far they leave it is known to a factor of two
    nearest, at_least = (math.hypot(floor.value, k * interpolated) for k in (1.0, 2.0))
    gone = (before.value - after.value) / (before.value - nearest)
    return gone, (before.value - after.interval[0]) / (before.value - at_least)


def _too_near(error: ErrorRow) -> bool:
    """Tell whether simulations are farther from one another than from the recording.

    Then a simulation makes by chance what a cause makes in the recording.
    """
    after, floor = error.after.interval, error.floor.interval
    return after is not None and floor is not None and after[1] < floor[0]


def remark_of(verdict: Verdict, outcome: Outcome) -> str:
    """Return the remark that goes with a verdict, besides the effects and their values.

    It ends in the consequence for the user of the recording.
    """
    if verdict == "consistent":
        return "The recording is what the declared model makes: keep that model as it is."
    only_test = outcome.probability >= PER_LOOK
    where = " in the test data" * only_test
    share = f"{outcome.explained:.0%} of the difference"
    if verdict == "unexplained" and only_test and not outcome.state.fits:
        return (
            "Nothing is missing in the data for training and validation, but in the test data"
            f" something is: chance makes such a difference {outcome.test_probability:.0e} times."
            " Look at what differs before you use this model."
        )
    if verdict == "unexplained" and not outcome.state.fits:
        return (
            "Every effect that was tried leaves too much, or makes something else wrong: what is"
            " missing is not in the library."
        )
    if verdict == "unexplained":
        best = " and ".join(map(label_of, outcome.state.names))
        if outcome.complete:
            near = f"The nearest is {best}: numbers of events are then right, their times are not."
        else:
            near = f"The nearest is {best}: it would explain {share}, too little to be named."
        return f"{near} Do not add it."
    if verdict == "partly_explained":
        left = f"something is left{where}"
        return f"This explains {share}; {left}: use the model found, but know what still differs."
    if verdict == "not_identifiable":
        return (
            "These data cannot tell these effects apart: either model makes these events, and only"
            " another recording tells which is right."
        )
    if min(outcome.probability, outcome.test_probability) < PER_LOOK:
        return (
            f"This explains {outcome.explained:.1%} of the difference; the rest may be due to its"
            " fit: use the model found."
        )
    return "With this change nothing is left that these data show: use the model found."


# ---- Verdict on the outcome of a search, by the test data, which are used only here.


DRAWS = 12
"""Simulations of each model that the errors are made of."""

_FIRST_DRAW = 20_000


def drawn(simulator: Simulator, config: Config, first: int = _FIRST_DRAW) -> list[Stream]:
    """Return simulations of a model to compare with the recording."""
    return simulator.streams(config, range(first, first + DRAWS))


def conclude(prepared: Prepared, search: Search, outcome: Outcome) -> tuple[State, dict[str, Any]]:
    """Return the model that is reported, and what a diagnosis says of it beside the declared one.

    It is the declared one where no effect is named.  Verdict, remark, errors and pictures are by
    the names of a diagnosis.
    """
    scene, simulator = prepared.scene, prepared.reference.sampler.simulator
    simulator.begin("judging on data not used so far")

    def test(stream: Stream) -> Stream:
        return scene.split.chosen(stream, splits.TEST)

    measured = test(prepared.evidence.stream)

    def distances(streams: list[Stream]) -> Errors:
        return Errors.of(measured, list(map(test, streams)))

    kept, declared = outcome.state, search.declared
    before = after = drawn(simulator, declared.config)
    of_before = of_after = distances(before)
    interpolated = 0.0
    if kept is not declared:
        after = drawn(simulator, kept.config)
        of_after = distances(after)
        if prepared.between_frames is not None:
            bare, whole, of_whole = without_coupling(kept.config), after, of_after
            if bare != kept.config:
                whole = drawn(simulator, bare)
                of_whole = distances(whole)
            with closing(simulator.of(every(prepared.evidence, 2))) as fewer:
                half = drawn(fewer, bare, _FIRST_DRAW + DRAWS)
            interpolated = of_interpolation(
                measured,
                list(map(test, whole)),
                list(map(test, half)),
                float(of_whole.between.mean()),
            )
    rows = error_rows(of_before, of_after)
    verdict = verdict_of(outcome, rows[0], interpolated)
    if verdict in ("consistent", "unexplained") and kept is not declared:
        kept, after = declared, before
        rows = error_rows(of_before, of_before)
    pictures = pictures_of(scene, prepared.evidence.stream, before, after)
    told = {"verdict": verdict, "remark": remark_of(verdict, outcome), "errors": rows}
    return kept, {**told, **pictures}


# ---- The size of each effect that would have been seen.


_SEEN = 0.8
_ROUNDS = (range(1, 3), range(301, 305), range(305, 311))
"""Seeds of the recordings that are simulated at each size: first those of the starts.  In the end
those of the last two rounds count."""
_FARTHEST = 10.0
_SETTLED = 2.0
"""Factor by which the last round may still change a size that is told."""


def detectable(
    reference: Reference, declared: State, candidates: Sequence[Candidate]
) -> list[Detectable]:
    """Return the size of each effect that would have been seen about 8 times in 10.

    Recordings with the effect are simulated, from a mild start on, and judged as the real one is;
    how much more or less of it would just have been seen, as if what it changes grew in proportion,
    is tried in the next round.  Where no size within the physical range would have been seen, or
    none was settled on, there is none.
    """
    reference.begin("finding what could have been seen")
    mildest: dict[str, Candidate] = {}
    for candidate in candidates:
        if candidate.parameters:
            # how fast the clock of the frames is would be seen by itself
            extra = tuple((key, value) for key, value in candidate.extra if key != DRIFT)
            mildest.setdefault(candidate.name, replace(candidate, extra=extra))
    every = [_Size.of(candidate, declared.config) for candidate in mildest.values()]
    sizes, ensemble = every, declared.ensembles[BOTH]
    for seeds in _ROUNDS:
        if not sizes:
            break
        configs = [size.config(declared.config) for size in sizes]
        is_last = seeds == _ROUNDS[-1]
        sampler = reference.sampler if is_last else reference.sampler.rough
        sample = sampler.samples(configs, seeds)[:, :, BOTH]
        for size, rows in zip(sizes, sample, strict=True):
            recordings = reference.error.blurred(rows, BOTH, OF_RECORDINGS)
            factors = [_missing(ensemble, row) for row in recordings]
            size.change_by(factors, [*size.before, *factors] if is_last else factors)
        sizes = [size for size in sizes if math.isfinite(size.factor)]
    return [size.found(declared.config) for size in every]


@dataclass
class _Size:
    """An effect, the value of its first key where it does nothing, that now, and other keys'.

    `factor`: by which the last round changed it; infinite: it left the physical range.  `before`:
    factors on the size now by which recordings of that round say that it would have been seen.
    """

    candidate: Candidate
    neutral: float
    value: float
    rest: tuple[float, ...]
    factor: float = 1.0
    before: tuple[float, ...] = ()

    @classmethod
    def of(cls, candidate: Candidate, config: Config) -> _Size:
        """Return the first start that the physical range leaves room to grow from, if any."""
        neutral = neutral_value(config, candidate.parameters[0])
        made = [cls(candidate, neutral, start[0], start[1:]) for start in candidate.starts]
        return next((one for one in made if one._is_physical(one._changed(_FARTHEST))), made[0])

    def config(self, declared: Config) -> Config:
        values = (self.value, *self.rest)
        return self.candidate.applied(declared, self.candidate.scaled(values))

    def change_by(self, factors: Sequence[float], counted: Sequence[float]) -> None:
        """Take the size that most would have been seen at, by the factors that are `counted`."""
        factor = float(np.quantile(counted, _SEEN))
        self.before = tuple(one / factor for one in factors)
        wanted = self._changed(factor)
        self.factor = factor if self._is_physical(wanted) else math.inf
        self.value = wanted

    def _changed(self, factor: float) -> float:
        if math.isinf(self.neutral):
            return self.value / factor
        return self.neutral + factor * (self.value - self.neutral)

    def _is_physical(self, value: float) -> bool:
        return self.candidate.parameters[0].low <= value <= self.candidate.parameters[0].high

    def found(self, declared: Config) -> Detectable:
        key = self.candidate.parameters[0].key
        is_settled = 1.0 / _SETTLED <= self.factor <= _SETTLED
        unit = known_keys(type(declared))[key].unit
        return Detectable(self.candidate.name, key, self.value if is_settled else None, unit)


def _missing(ensemble: Ensemble, recording: NDArray[np.float64]) -> float:
    """Return the factor by which an effect must grow to be detected in a recording with it."""
    misfit_limit, largest_limit = ensemble.limits(PER_LOOK)
    # squares add up, single deviations grow in proportion
    misfit = (ensemble.misfit(recording) - ensemble.floor) / (misfit_limit - ensemble.floor)
    loudest = expanded(np.abs(ensemble.z(recording)).max())
    usual = expanded(ensemble.typical_largest)
    deviation = float((loudest - usual) / (expanded(largest_limit) - usual))
    factor = min(max(misfit, 1e-6) ** -0.5, 1.0 / max(deviation, 1e-6))
    return float(min(max(factor, 1.0 / _FARTHEST), _FARTHEST))


# ---- Distance between recording and simulations on the data that are looked at once.


NAME = "distance of measured and simulated events (ON +1, OFF -1), smoothed in time"
OF_MEAN = "the same from the mean of simulations, without the chance of each"
PAIRS = 20
"""Pairs of independent draws that the floor is the mean of."""

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Errors:
    """Of the simulations of one model, as parts of the norm of what was measured.

    To that, (simulations, scales), and between independent ones, (pairs, scales).
    """

    to_measured: Array
    between: Array

    @classmethod
    def of(cls, measured: Stream, simulations: Sequence[Stream]) -> Errors:
        unit = _norm(measured)
        return cls(
            np.array([_apart(measured, stream, unit) for stream in simulations]),
            np.array([_apart(a, b, unit) for a, b in _pairs(simulations)]),
        )

    @property
    def own(self) -> Array:
        """Square of what is each simulation's own chance, (scales,)."""
        return 0.5 * _mean_square(self.between)


def error_rows(before: Errors, after: Errors) -> list[ErrorRow]:
    """Return the error over all scales, at each scale, and of the mean of simulations.

    Random events cost, wherever they come: a model that makes them as the camera does is farther
    off by the first of these than one without.  The last is not moved by that: the distance d from
    one simulation and c from one to another are those from their mean by d^2 = m^2 + c^2/2.  The
    floor is that of the model found, `after`.
    """
    names = [NAME, *(f"{NAME} over {sigma / 1e3:g} ms" for sigma in SIGMAS_US)]
    first, second, floor = (
        [Estimate.of_draws(column) for column in (apart.mean(axis=1), *apart.T)]
        for apart in (before.to_measured, after.to_measured, after.between)
    )
    rows = [ErrorRow(*row) for row in zip(names, first, second, floor, strict=True)]
    squares = (*(_mean_square(one.to_measured) - one.own for one in (before, after)), after.own)
    roots = [Estimate(float(np.sqrt(np.maximum(one, 0.0)).mean())) for one in squares]
    rows.append(ErrorRow(OF_MEAN, roots[0], roots[1], roots[2], without_chance=True))
    return rows


def of_interpolation(
    measured: Stream, full: Sequence[Stream], half: Sequence[Stream], floor: float
) -> float:
    """Return the part of the error that interpolation between frames makes; it adds in squares.

    About half of the error that leaving out every second frame adds, within a factor of two:
    between a third, where frames resolve the motion, and all of it
    (:mod:`adv2e.diagnosis.statistics.uncertainty`).  `full`: simulations with all frames, whose
    error has the noise floor `floor`; `half`: with every second frame, of other seeds.
    """
    unit = _norm(measured)
    apart = np.mean([_apart(a, b, unit).mean() for a, b in zip(full, half, strict=True)])
    square = float(apart) ** 2 - floor**2
    return 0.5 * math.sqrt(square) if square > 0.0 else 0.0  # not a number: nothing measured


def _norm(measured: Stream) -> Array:
    return smoothed_norms([(measured.events(), 1.0)], measured.width, SIGMAS_US)


def _apart(a: Stream, b: Stream, unit: Array) -> Array:
    apart = smoothed_norms([(a.events(), 1.0), (b.events(), -1.0)], a.width, SIGMAS_US)
    return np.asarray(apart / np.where(unit > 0.0, unit, np.nan))


def _pairs(streams: Sequence[Stream]) -> list[tuple[Stream, Stream]]:
    """Return pairs that use every stream about as often."""
    n = len(streams)
    pairs = [(k, (k + gap) % n) for gap in range(1, n) for k in range(n) if k < (k + gap) % n]
    return [(streams[a], streams[b]) for a, b in pairs[: max(PAIRS, n)]]


def _mean_square(apart: Array) -> Array:
    """Return the mean square of distances (n, scales), nothing for none."""
    if not apart.size:
        return np.zeros(len(SIGMAS_US))
    return np.asarray((apart * apart).mean(axis=0))
