"""Keys of the effects of a model, fitted to one stretch of a recording, thresholds matched anew."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from adv2e.comparison.windows import Windows
from adv2e.config import Config
from adv2e.diagnosis.fitting.candidates import Candidate, FitParameter
from real.model import Bench
from real.pattern import Place, pattern_search
from real.tried import Added, label

PRECISION = 0.001
MOST_SEEDS = 4
"""Simulated with seeds enough for the score to be known to this, at most so many."""
LEAST_GAIN = 0.003
"""A lower score counts from here on: three times what it is known to with seeds enough."""
PASSES = 2
"""Rounds in which all that was added is refined together after each addition, at most."""
LEADING = 6
"""So many of what is tried are tried with all seeds."""
STEPS = (0.3, 0.15, 0.07)
MOVES = 4
"""Steps of the search over all keys, and how often each is repeated, at most."""

Found = Mapping[Candidate, tuple[float, ...]]
"""Effects with the values of their keys, in the order in which they were added."""


Probe = tuple[Candidate, tuple[float, ...]]
"""An effect, and values from which its fit may start."""


@dataclass(frozen=True)
class Model:
    """What was found so far.

    Attributes
    ----------
    base : Config
        Without any of it.
    found : mapping of Candidate to tuple of float
    here : Added
        The step that led here, with configuration and score.
    """

    base: Config
    found: Found
    here: Added

    def lacks(self, candidate: Candidate) -> bool:
        """Tell whether a candidate sets or fits a key that nothing does which was found."""
        return not keys(candidate) <= {key for one in self.found for key in keys(one)}


class Fitter:
    """Tries configurations on one stretch of a recording.

    Parameters
    ----------
    bench : Bench
    windows : Windows

    Attributes
    ----------
    seeds : tuple of int
        With which configurations are tried.
    known_to : float
        Standard deviation of the mean score with them.
    """

    def __init__(self, bench: Bench, windows: Windows) -> None:
        self._bench, self._windows = bench, windows
        self.seeds: tuple[int, ...] = ()
        self.known_to = np.inf

    def measured(self, config: Config) -> Added:
        """Return how far a model is, with seeds enough for that from here on."""
        self.seeds, self.known_to = enough_seeds(self._bench, config, self._windows, config.seed)
        return Added.plain("as it is", config, *self._score(config))

    def _score(self, config: Config) -> tuple[float, float | None]:
        return self._bench.score(config, self._windows, self.seeds)

    def matched(self, config: Config) -> Config:
        """Return a configuration with thresholds that match the totals."""
        return self._bench.matched(config, self._windows)

    def trial(self, candidate: Candidate, values: Sequence[float], base: Config) -> Added:
        """Return `base` with an effect, and how far it is."""
        config = self.matched(candidate.applied(base, candidate.scaled(values)))
        return Added(candidate, tuple(values), config, *self._score(config))

    def ranked(self, starts: Iterable[Probe], base: Config) -> list[Added]:
        """Return effects where their fits may start, the nearest first.

        All are tried with one seed, and only those that then lead with all of them.
        """
        seeds, self.seeds = self.seeds, self.seeds[:1]
        tried = [self.trial(candidate, values, base) for candidate, values in starts]
        self.seeds = seeds
        tried.sort(key=_score_of)
        if len(seeds) > 1:
            leading = [self._again(one) for one in tried[:LEADING]]
            tried[:LEADING] = sorted(leading, key=_score_of)
        return tried

    def _again(self, tried: Added) -> Added:
        score, still_hz = self._score(tried.config)
        return replace(tried, score=score, still_hz=still_hz)

    def without(self, model: Model, one: Candidate) -> Model:
        """Return a model without an effect, all others as they are."""
        rest = {other: values for other, values in model.found.items() if other is not one}
        config = model.base
        for other, values in rest.items():
            config = other.applied(config, other.scaled(values))
        return Model(model.base, rest, self.trial(label(f"without {one.name}"), (), config))

    def refined(self, best: Added, base: Config) -> Added:
        """Return an effect with its keys at a better place, by steps that halve."""
        candidate = best.candidate
        for k, parameter in enumerate(candidate.parameters):
            step = 0.5 * _unit(parameter, best.values[k])
            for share in (1.0, 0.5):
                here = np.array(candidate.scaled(best.values))
                for way in (-1.0, 1.0):
                    place = here.copy()
                    place[k] += way * share * step
                    trial = self.trial(candidate, _outer(candidate.parameters, place), base)
                    best = min(best, trial, key=_score_of)
        return best

    def kept(self, model: Model, best: Added) -> Model:
        """Return a model with an effect more, in place of those whose keys it holds, refined."""
        added = best.candidate
        found = {one: values for one, values in model.found.items() if not keys(one) <= keys(added)}
        found[added] = best.values
        here = best
        for _ in range(PASSES if len(found) > 1 else 0):
            before = here.score
            for candidate in [one for one in found if one.parameters]:
                current = replace(here, candidate=candidate, values=found[candidate])
                better = self.refined(current, here.config)
                if better.score < here.score:
                    here, found[candidate] = better, better.values
            if before - here.score < LEAST_GAIN:
                break
        here = replace(here, candidate=added, values=found[added])
        return Model(model.base, found, here)

    def settled(self, model: Model) -> Model:
        """Return a model with all keys of what was found sought together, if there are several."""
        start = {
            (parameter.key, parameter.part): (parameter, value)
            for one, values in model.found.items()
            for parameter, value in zip(one.parameters, values, strict=True)
        }
        if len(start) < 2:
            return model
        parameters, values = zip(*start.values(), strict=True)
        whole = Candidate("all keys", parameters, ())
        units = np.array([_unit(parameter, value) for parameter, value in start.values()])

        def at(place: Place) -> Added:
            return self.trial(whole, _outer(parameters, place * units), model.here.config)

        first = replace(model.here, candidate=whole, values=values)
        best = pattern_search(at, np.array(whole.scaled(values)) / units, first, STEPS, MOVES)
        settled = dict(zip(start, best.values, strict=True))
        found = {
            one: tuple(settled[each.key, each.part] for each in one.parameters)
            for one in model.found
        }
        return Model(model.base, found, best.named("all keys together"))


def enough_seeds(
    bench: Bench, config: Config, windows: Windows, first: int
) -> tuple[tuple[int, ...], float]:
    """Return with which seeds the mean score is known to `PRECISION`, from `first` on.

    And to what it is known with them, as there are at most `MOST_SEEDS`.
    """
    seeds = tuple(range(first, first + MOST_SEEDS))
    spread = np.std([bench.score(config, windows, (seed,))[0] for seed in seeds], ddof=1)
    taken = seeds[: max(1, int(np.ceil((spread / PRECISION) ** 2)))]
    return taken, float(spread / np.sqrt(len(taken)))


def keys(candidate: Candidate) -> frozenset[str]:
    """Return the keys that a candidate fits, or sets where it fits none."""
    fitted = {f"{parameter.key}/{parameter.part}" for parameter in candidate.parameters}
    return frozenset(fitted or {key for key, _ in candidate.extra})


def _score_of(tried: Added) -> float:
    return tried.score


def _outer(parameters: Sequence[FitParameter], place: Place) -> tuple[float, ...]:
    return tuple(one.value_at(at) for one, at in zip(parameters, place, strict=True))


def _unit(parameter: FitParameter, value: float) -> float:
    """Return what counts as one on a parameter's scale: a factor of e, or the value itself."""
    return 1.0 if parameter.log else max(abs(parameter.scaled(value)), 1.0)
