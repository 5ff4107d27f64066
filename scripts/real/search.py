"""Effects added one by one, each fitted with thresholds matched anew, on one stretch of time."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from adv2e.comparison.windows import Windows
from adv2e.config import Config
from adv2e.diagnosis.candidates import Candidate, Knob
from real.model import Bench
from real.pattern import Place, pattern_search
from real.tried import EXACT, OWN, Added, label, of_the_camera

PRECISION = 0.001
MOST_SEEDS = 4
"""Simulated with seeds enough for the score to be known to this, at most so many."""
LEAST_GAIN = 0.003
"""An effect is added if it lowers the score by as much as this, and dropped if it no longer does:
three times what the score is known to."""
PASSES = 2
"""Rounds in which all that was added is refined together after each addition, at most."""
MOST = 12
"""Effects at most, with choices of the simulation."""
STEPS = (0.3, 0.15, 0.07)
MOVES = 4
"""Steps of the search over all keys, and how often each is repeated, at most."""


def enough_seeds(bench: Bench, config: Config, windows: Windows, first: int) -> tuple[int, ...]:
    """Return with which seeds the mean score is known to `PRECISION`, from `first` on."""
    seeds = tuple(range(first, first + MOST_SEEDS))
    spread = np.std([bench.score(config, windows, (seed,))[0] for seed in seeds], ddof=1)
    return seeds[: max(1, int(np.ceil((spread / PRECISION) ** 2)))]


class Search:
    """A search for a model of a recording, on one stretch of it.

    Parameters
    ----------
    bench : Bench
    windows : Windows
        What the model is fitted to.
    say : callable
        Takes lines that tell how it goes.
    """

    def __init__(self, bench: Bench, windows: Windows, say: Callable[[str], None]) -> None:
        self._bench, self._windows, self._say = bench, windows, say
        self._seeds: tuple[int, ...] = ()
        self._found: dict[Candidate, tuple[float, ...]] = {}
        self._measured_hz = bench.still_hz(windows)

    def run(self, declared: Config, only: Sequence[str] = ()) -> Iterator[Added]:
        """Yield the model after each step, the first as declared but thresholds.

        Choices of the simulation are tried first, effects of the camera with them then.  The keys
        of all that was added before are refined with each.  When nothing more is found all keys are
        sought together, which may make room for more.  What is no longer needed then is dropped.

        Parameters
        ----------
        declared : Config
        only : sequence of str
            Names of the effects of the camera to try; empty: all.
        """
        here = self._measured(self._bench.matched(declared, self._windows))
        yield here.named("thresholds")
        low_pass = declared.pixel.low_pass
        if low_pass is not None and low_pass.update != "exact":
            yield (here := self.trial(EXACT, (), here.config))
        base = here.config
        for step in self._additions(OWN, here):
            yield (here := step)
        here = self._measured(here.config)  # with references at random chance is another
        everything = [*OWN, *of_the_camera(declared, self._windows.duration_s, only)]
        grown = True
        while grown:
            before = len(self._found)
            for step in self._additions(everything, here):
                yield (here := step)
            grown = len(self._found) > before
            if grown and sum(len(one.knobs) for one in self._found) > 1:
                yield (here := self._settled(here).named("all keys together"))
        for step in self._removals(base, here):
            yield (here := step)

    def _measured(self, config: Config) -> Added:
        """Return how far a model is, with seeds enough for that from here on."""
        self._seeds = enough_seeds(self._bench, config, self._windows, config.seed)
        self._say(f"  seeds for each score: {len(self._seeds)}")
        score = self._bench.score(config, self._windows, self._seeds)
        return Added.plain("as it is", config, *score)

    def trial(self, candidate: Candidate, values: Sequence[float], base: Config) -> Added:
        """Return `base` with an effect, and how far it is."""
        changed = candidate.applied(base, candidate.inner(values))
        config = self._bench.matched(changed, self._windows)
        score, still_hz = self._bench.score(config, self._windows, self._seeds)
        return Added(candidate, tuple(values), config, score, still_hz)

    def _additions(self, group: Sequence[Candidate], here: Added) -> Iterator[Added]:
        """Yield the model with each effect of a group that brings it nearer, until none does."""
        left, whole = self._untried(group), True
        while True:
            if len(self._found) >= MOST:
                self._say(f"  {MOST} effects added: no more are tried")
                return
            tried = self._probed(left, here)
            best = self.refined(tried[0], here.config) if tried else here
            if here.score - best.score >= LEAST_GAIN:
                here = self._kept(best)
                yield replace(here, candidate=best.candidate, values=self._found[best.candidate])
                left, whole = self._untried(_promising(tried)), False
            elif whole:
                return
            else:  # those left out may have become worth it
                left, whole = self._untried(group), True

    def _untried(self, group: Iterable[Candidate]) -> list[Candidate]:
        """Return those that set or fit a key which nothing that was found does."""
        known = {key for one in self._found for key in _keys(one)}
        return [one for one in group if not _keys(one) <= known]

    def _probed(self, candidates: Sequence[Candidate], here: Added) -> list[Added]:
        """Return all candidates where their fits may start, the nearest first."""
        tried = [self.trial(one, probe, here.config) for one in candidates for probe in one.probes]
        tried.sort(key=lambda one: one.score)
        noisier = [one for one in tried if one.noisier(here, self._measured_hz)]
        fair = [one for one in tried if one not in noisier]
        self._say(f"  {here.score:.4f}; next: {_scores(fair[:6])}")
        if noisier:
            self._say(f"  make noise of their own in still pixels: {_scores(noisier)}")
        return fair

    def refined(self, best: Added, base: Config) -> Added:
        """Return an effect with its keys at a better place, by steps that halve."""
        candidate = best.candidate
        for k, knob in enumerate(candidate.knobs):
            step = 0.5 * _unit(knob, best.values[k])
            for share in (1.0, 0.5):
                here = np.array(candidate.inner(best.values))
                for way in (-1.0, 1.0):
                    place = here.copy()
                    place[k] += way * share * step
                    trial = self.trial(candidate, _outer(candidate.knobs, place), base)
                    best = min(best, trial, key=lambda one: one.score)
        return best

    def _kept(self, best: Added) -> Added:
        """Keep an effect, in place of those whose keys it holds; return all of it refined."""
        for one in [one for one in self._found if _keys(one) <= _keys(best.candidate)]:
            del self._found[one]
        self._found[best.candidate] = best.values
        here = best
        if len(self._found) < 2:
            return here
        for _ in range(PASSES):
            before = here.score
            for candidate in [one for one in self._found if one.knobs]:
                current = replace(here, candidate=candidate, values=self._found[candidate])
                better = self.refined(current, here.config)
                if better.score < here.score:
                    here, self._found[candidate] = better, better.values
            if before - here.score < LEAST_GAIN:
                break
        return here

    def _settled(self, last: Added) -> Added:
        """Return the last model with all keys of what was found sought together."""
        found = {
            (knob.key, knob.part): (knob, value)
            for one, values in self._found.items()
            for knob, value in zip(one.knobs, values, strict=True)
        }
        knobs, values = zip(*found.values(), strict=True)
        whole = Candidate("all keys", knobs, ())
        units = np.array([_unit(knob, value) for knob, value in found.values()])

        def at(place: Place) -> Added:
            return self.trial(whole, _outer(knobs, place * units), last.config)

        start = np.array(whole.inner(values)) / units
        first = replace(last, candidate=whole, values=values)
        best = pattern_search(at, start, first, STEPS, MOVES)
        settled = dict(zip(found, best.values, strict=True))
        for one in self._found:
            self._found[one] = tuple(settled[knob.key, knob.part] for knob in one.knobs)
        return best

    def _removals(self, base: Config, here: Added) -> Iterator[Added]:
        """Yield the model without each effect that is no longer needed, the latest first."""
        for one in list(reversed(self._found)):
            rest = {other: values for other, values in self._found.items() if other is not one}
            config = base
            for other, values in rest.items():
                config = other.applied(config, other.inner(values))
            without = self.trial(label(f"without {one.name}"), (), config)
            self._say(f"  {without.text()}: {without.score:.4f}")
            if without.score - here.score < LEAST_GAIN:
                here, self._found = without, rest
                yield here


def _keys(candidate: Candidate) -> frozenset[str]:
    """Return the keys that a candidate fits, or sets where it fits none."""
    fitted = {f"{knob.key}/{knob.part}" for knob in candidate.knobs}
    return frozenset(fitted or {key for key, _ in candidate.extra})


def _outer(knobs: Sequence[Knob], place: Place) -> tuple[float, ...]:
    return tuple(knob.outer(inner) for knob, inner in zip(knobs, place, strict=True))


def _unit(knob: Knob, value: float) -> float:
    """Return what counts as one on a knob's scale: a factor of e, or the value itself."""
    return 1.0 if knob.log else max(abs(knob.inner(value)), 1.0)


def _scores(tried: Iterable[Added]) -> str:
    return ", ".join(f"{one.text()} {one.score:.4f}" for one in tried)


def _promising(tried: Sequence[Added]) -> list[Candidate]:
    """Return the better half of what was tried, each once."""
    return list(dict.fromkeys(one.candidate for one in tried[: -(-len(tried) // 2)]))
