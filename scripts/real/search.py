"""Which effects make a model nearer to a recording: added one by one, dropped, replaced."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from dataclasses import replace

from adv2e.comparison.windows import Windows
from adv2e.config import Config
from adv2e.diagnosis.fitting.candidates import Candidate
from real.fit import LEAST_GAIN, Fitter, Model, Probe, keys
from real.model import Bench
from real.tried import EXACT, OWN, Added, of_the_camera

Steps = Generator[Model, None, Model]
"""Yields the model after each step, returns the last, or the one it was given."""

MOST = 12
"""Effects at most, with choices of the simulation."""
MOST_SETTLED = 0.02
"""Seeking all keys together is not expected to lower the score by more."""


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
        self._fit, self._say = Fitter(bench, windows), say
        self._seconds, self._pulse = windows.duration_s, bench.pulse
        self._measured_hz = bench.still_hz(windows)
        self._noisy: set[Probe] = set()

    def run(self, declared: Config, only: Sequence[str] = ()) -> Iterator[Added]:
        """Yield the model after each step, the first as declared but thresholds.

        Choices of the simulation are tried first, effects of the camera with them then.  The keys
        of all that was added before are refined with each.  When nothing more is found all keys are
        sought together, which may make room for more.  What is no longer needed then is dropped.
        At last each effect is left out in turn and others are tried in its place, as what comes
        first when they are added one by one need not be right.

        Parameters
        ----------
        declared : Config
        only : sequence of str
            Names of the effects of the camera to try; empty: all.
        """
        for model in self._models(declared, only):
            yield model.here

    def _models(self, declared: Config, only: Sequence[str]) -> Steps:
        here = self._measured(self._fit.matched(declared))
        yield (model := _bare(here.named("thresholds")))
        low_pass = declared.pixel.low_pass
        if low_pass is not None and low_pass.update != "exact":
            yield (model := _bare(self._fit.trial(EXACT, (), here.config)))
        model = yield from self._additions(OWN, model)
        # with references at random chance is another
        model = replace(model, here=self._measured(model.here.config))
        everything = [*OWN, *of_the_camera(declared, self._seconds, only, self._pulse)]
        while True:
            model = yield from self._grown(everything, model)
            model = yield from self._removals(model)
            other = yield from self._replacements(everything, model)
            if other is model:
                return model
            model = other

    def _measured(self, config: Config) -> Added:
        here = self._fit.measured(config)
        count, known_to = len(self._fit.seeds), self._fit.known_to
        self._say(f"  seeds for each score: {count}, which is known to {known_to:.4f}")
        return here

    def _grown(self, group: Sequence[Candidate], model: Model) -> Steps:
        """Yield the model with more and more of a group, all keys sought together in between."""
        while True:
            before, model = model, (yield from self._additions(group, model))
            if model is before:
                return model
            settled = self._fit.settled(model)
            if settled is not model:
                yield (model := settled)

    def _additions(self, group: Sequence[Candidate], model: Model) -> Steps:
        """Yield the model with each effect of a group that brings it nearer, until none does."""
        left, whole = self._untried(group, model), True
        while True:
            if len(model.found) >= MOST:
                self._say(f"  {MOST} effects added: no more are tried")
                return model
            tried = self._probed(left, model.here)
            best = self._fit.refined(tried[0], model.here.config) if tried else model.here
            if model.here.score - best.score >= LEAST_GAIN:
                yield (model := self._fit.kept(model, best))
                left, whole = self._untried(_promising(tried), model), False
            elif whole:
                return model
            else:  # those left out may have become worth it
                left, whole = self._untried(group, model), True

    @staticmethod
    def _untried(group: Iterable[Candidate], model: Model) -> list[Candidate]:
        return [one for one in group if model.lacks(one)]

    def _probed(self, candidates: Sequence[Candidate], here: Added) -> list[Added]:
        """Return all candidates where their fits may start, the nearest first.

        What made noise of its own in still pixels once is not tried again.
        """
        starts = ((one, values) for one in candidates for values in one.starts)
        quiet = (start for start in starts if start not in self._noisy)
        tried = self._fit.ranked(quiet, here.config)
        noisier = [one for one in tried if one.noisier(here, self._measured_hz)]
        fair = [one for one in tried if one not in noisier]
        self._say(f"  {here.score:.4f}; next: {_scores(fair[:6])}")
        self._noisy.update((one.candidate, one.values) for one in noisier)
        if noisier:
            self._say(f"  make noise of their own in still pixels: {_scores(noisier)}")
        return fair

    def _removals(self, model: Model) -> Steps:
        """Yield the model without each effect that is no longer needed, the latest first."""
        for one in reversed([*model.found]):
            without = self._fit.without(model, one)
            self._say(f"  {without.here.text()}: {without.here.score:.4f}")
            if without.here.score - model.here.score < LEAST_GAIN:
                yield (model := without)
        return model

    def _replacements(self, group: Sequence[Candidate], model: Model) -> Steps:
        """Yield the model with others of a group in the place of an effect, if that is nearer."""
        for one in [one for one in model.found if one.parameters]:
            others = [other for other in group if not keys(other) <= keys(one)]
            self._say(f"  {model.here.score:.4f}; what takes the place of {one.name}?")
            without = self._fit.without(model, one)
            *_, other = [without, *self._additions(others, without)]
            if other.here.score - model.here.score < MOST_SETTLED:
                other = self._fit.settled(other)
            if model.here.score - other.here.score >= LEAST_GAIN:
                names = " + ".join(new.name for new in other.found if new not in model.found)
                name = f"{names or 'nothing'} in place of {one.name}"
                yield (model := replace(other, here=other.here.named(name)))
        return model


def _bare(here: Added) -> Model:
    return Model(here.config, {}, here)


def _scores(tried: Iterable[Added]) -> str:
    return ", ".join(f"{one.text()} {one.score:.4f}" for one in tried)


def _promising(tried: Sequence[Added]) -> list[Candidate]:
    """Return the better half of what was tried, each once."""
    return list(dict.fromkeys(one.candidate for one in tried[: -(-len(tried) // 2)]))
