"""Effects added one by one, each fitted with thresholds matched anew, on one stretch of time."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from adv2e.comparison.windows import Windows
from adv2e.config import Config
from adv2e.diagnosis.candidates import Candidate, Knob
from adv2e.diagnosis.library import Hints, library
from real.model import Bench

LEAST_GAIN = 0.005
"""An effect is added if it lowers the score by as much as this."""
PASSES = 2
"""Rounds in which all that was added is refined together after each addition, at most."""
MOST = 9
"""Effects at most, with choices of the simulation."""
STEPS = (0.3, 0.15, 0.07)
MOVES = 4
"""Steps of the search over all keys at the end, and how often each is repeated, at most."""
NOISE_HZ = 0.1
NOISES = ("leak", "photo_leak", "shot_noise", "photoreceptor_noise", "hot_pixels")
"""What makes events by itself is not added if it moves still pixels farther from the measured rate
by more [Hz]: noise at random costs this score less than events in the wrong place, and is no
explanation.  Other effects change the rate of still pixels through the thresholds that match the
totals, by which noise of the frames fires, which is no noise of the camera's."""

EXACT = Candidate("exact filter", (), ((),), (("pixel.low_pass.update", "exact"),))
"""Replaces the printed filter, whose gain is known to be wrong, whatever that does to the score."""

OWN = (
    Candidate(
        "interpolation",
        (),
        ((),),
        (("sampling.interpolation", "flow"), ("sampling.last_interval", "corrected")),
    ),
    Candidate("initial_reference", (), ((),), (("pixel.initial_reference", "random"),)),
    Candidate(
        "log_response",
        (Knob("pixel.log_response.linear_below", 1.01, 100.0),),
        ((2.72,), (10.0,), (40.0,)),
        (("pixel.log_response.floor", 0.5),),
    ),
)
"""What is no effect of the camera, but of how its frames were simulated."""

CLIPPED_BLACK = Candidate(
    "clipped_black",
    (
        Knob("frames.black_level_dn", 0.02, 100.0),
        Knob("frames.black_depth_dn", 0.01, 100.0),
    ),
    ((9.0, 3.0), (14.0, 5.0)),
)
"""Beside the black level of the library: how far light falls on where it is clipped at black."""

UNSEEN = {
    "thresholds": "matched to the totals each time",
    "photoreceptor_noise": "solved pixel by pixel: too slow to search over",
    "source_follower": "solved pixel by pixel: too slow to search over",
    "timestamp_tick": "does not move this score",
    "readout": "does not move this score at these rates",
    "threshold_drift": "not within half a second",
    "clock_drift": "not within half a second",
    "hot_pixels": "a few pixels do not move this score",
    "dead_pixels": "a few pixels do not move this score",
    "frame_coupling": "bound to the frames, as is interpolation: not to be told here",
}
"""Effects of the library that are left out, and why."""


@dataclass(frozen=True)
class Added:
    """An effect that was added, or the best of those that were not."""

    candidate: Candidate
    values: tuple[float, ...]
    config: Config
    score: float
    still_hz: float | None

    @classmethod
    def plain(
        cls, name: str, config: Config, score: float = np.nan, still_hz: float | None = None
    ) -> Added:
        """Return a step that adds no key."""
        return cls(Candidate(name, (), ((),)), (), config, score, still_hz)

    def noisier(self, before: Added, measured_hz: float | None) -> bool:
        """Tell whether it takes the still pixels away from what was measured."""
        if measured_hz is None or self.still_hz is None or before.still_hz is None:
            return False
        miss, was = abs(self.still_hz - measured_hz), abs(before.still_hz - measured_hz)
        return miss > was + NOISE_HZ

    def text(self) -> str:
        """Return name and values."""
        keys = self.candidate.parameters(self.candidate.inner(self.values))
        named = ((key.rpartition(".")[2], value) for key, value in keys.items())
        values = ", ".join(f"{key} {_short(value)}" for key, value in named)
        return f"{self.candidate.name}{f' ({values})' if values else ''}"


def _short(value: object) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def forward(
    bench: Bench,
    declared: Config,
    windows: Windows,
    seeds: Sequence[int],
    say: Callable[[str], None],
    only: Sequence[str] = (),
) -> Iterator[Added]:
    """Yield the model after each effect that was added, the first as declared but thresholds.

    The keys of all that was added before are refined each time, and those left out are tried again
    when nothing more is found.  `only`: names of the effects of the camera to try; empty: all.
    """
    config = bench.matched(declared, windows)
    yield Added.plain("thresholds", config, *bench.score(config, windows, seeds))
    here = _trial(bench, EXACT, (), config, windows, seeds)
    yield here
    measured_hz = bench.still_hz(windows)
    camera = [CLIPPED_BLACK, *library(declared, Hints(windows.duration_s, (), 1))]
    camera = [one for one in camera if one.name not in UNSEEN and (not only or one.name in only)]
    found: dict[Candidate, tuple[float, ...]] = {}
    for group in (OWN, (*OWN, *camera)):
        left = _not_in(found, group)
        at = len(found)  # when all of the group were tried last
        while len(found) < MOST:
            tried = [t for one in left for t in _probed(bench, one, here.config, windows, seeds)]
            noisier = [
                trial
                for trial in tried
                if trial.candidate.name in NOISES and trial.noisier(here, measured_hz)
            ]
            tried = [trial for trial in tried if trial not in noisier]
            if noisier:
                names = ", ".join(f"{trial.text()} {trial.score:.3f}" for trial in noisier)
                say(f"  make noise of their own in still pixels: {names}")
            tried.sort(key=lambda trial: trial.score)
            nearest = ", ".join(f"{t.text()} {t.score:.3f}" for t in tried[:6])
            say(f"  {here.score:.3f}; next: {nearest}")
            best = _refined(bench, tried[0], here.config, windows, seeds) if tried else here
            if here.score - best.score < LEAST_GAIN:
                if at == len(found):
                    break
                left, at = _not_in(found, group), len(found)
                continue
            found[best.candidate] = best.values
            here = _together(bench, found, best, windows, seeds)
            yield replace(here, candidate=best.candidate, values=found[best.candidate])
            left = _not_in(found, _promising(tried))
    if sum(len(candidate.knobs) for candidate in found) > 1:
        yield _settled(bench, found, here, windows, seeds)


def _not_in(found: Iterable[Candidate], group: Iterable[Candidate]) -> list[Candidate]:
    names = {one.name for one in found}
    return [one for one in group if one.name not in names]


def _together(
    bench: Bench,
    found: dict[Candidate, tuple[float, ...]],
    last: Added,
    windows: Windows,
    seeds: Sequence[int],
) -> Added:
    """Return the last model with the keys of all that was found refined, and keep them there."""
    here = last
    if len(found) < 2:
        return here
    for _ in range(PASSES):
        before = here.score
        for candidate in [one for one in found if one.knobs]:
            current = replace(here, candidate=candidate, values=found[candidate])
            better = _refined(bench, current, here.config, windows, seeds)
            if better.score < here.score:
                here, found[candidate] = better, better.values
        if before - here.score < LEAST_GAIN:
            break
    return here


def _settled(
    bench: Bench,
    found: dict[Candidate, tuple[float, ...]],
    last: Added,
    windows: Windows,
    seeds: Sequence[int],
) -> Added:
    """Return the last model with all keys sought together: a pattern search [1]_.

    References
    ----------
    .. [1] R. Hooke, T. A. Jeeves, "Direct Search Solution of Numerical and Statistical Problems",
       JACM 8(2), 1961, doi:10.1145/321062.321069.
    """
    knobs = tuple(knob for candidate in found for knob in candidate.knobs)
    values = tuple(value for values in found.values() for value in values)
    whole = Candidate("all of it", knobs, ())
    here = np.array(whole.inner(values))
    unit = np.array(
        [1.0 if knob.log else max(abs(p), 1.0) for knob, p in zip(knobs, here, strict=True)]
    )

    def at(place: NDArray[np.float64]) -> Added:
        outer = tuple(knob.outer(inner) for knob, inner in zip(knobs, place, strict=True))
        return _trial(bench, whole, outer, last.config, windows, seeds)

    def around(
        place: NDArray[np.float64], best: Added, step: float
    ) -> tuple[NDArray[np.float64], Added]:
        for k in range(len(knobs)):
            for sign in (1.0, -1.0):
                other = place.copy()
                other[k] += sign * step * unit[k]
                trial = at(other)
                if trial.score < best.score:
                    place, best = other, trial
                    break
        return place, best

    best = replace(last, candidate=whole, values=values)
    for step in STEPS:
        for _ in range(MOVES):
            found_at, better = around(here, best, step)
            if better.score >= best.score:
                break
            ahead = 2.0 * found_at - here
            here, best = found_at, better
            trial = at(ahead)
            if trial.score < best.score:
                here, best = ahead, trial
    return best


def _promising(tried: Sequence[Added]) -> list[Candidate]:
    """Return the better half of what was tried, each once."""
    return list(dict.fromkeys(trial.candidate for trial in tried[: -(-len(tried) // 2)]))


def _probed(
    bench: Bench, candidate: Candidate, base: Config, windows: Windows, seeds: Sequence[int]
) -> Iterator[Added]:
    for probe in candidate.probes:
        yield _trial(bench, candidate, tuple(probe), base, windows, seeds)


def _trial(
    bench: Bench,
    candidate: Candidate,
    values: tuple[float, ...],
    base: Config,
    windows: Windows,
    seeds: Sequence[int],
) -> Added:
    changed = candidate.applied(base, candidate.inner(values))
    config = bench.matched(changed, windows)
    return Added(candidate, values, config, *bench.score(config, windows, seeds))


def _refined(
    bench: Bench, best: Added, base: Config, windows: Windows, seeds: Sequence[int]
) -> Added:
    """Return the effect with its keys at a better place, by steps that halve."""
    candidate = best.candidate
    for k in range(len(candidate.knobs)):
        step = 0.5 if candidate.knobs[k].log else 0.5 * max(abs(candidate.inner(best.values)[k]), 1)
        for share in (1.0, 0.5):
            here = np.array(candidate.inner(best.values))
            for sign in (-1.0, 1.0):
                place = here.copy()
                place[k] += sign * share * step
                knobs = zip(candidate.knobs, place, strict=True)
                values = tuple(knob.outer(inner) for knob, inner in knobs)
                trial = _trial(bench, candidate, values, base, windows, seeds)
                best = min(best, trial, key=lambda one: one.score)
    return best
