"""Search for effects of a camera before films: each is fitted to some recordings, judged on others.

The view is never exact, so that what is left always stands out.  An effect is therefore not asked
to leave nothing: it is added if it brings the simulation nearer to recordings that it was not
fitted to, each of which is a witness of its own, and if the gain is no trifle.  All numbers of the
view but the path, and all keys that were fitted before, are fitted again with each effect; and with
what was added, the path is.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from adv2e.config import Config
from adv2e.diagnosis.film.fitting import FilmFitter, Place, first_point
from adv2e.diagnosis.film.view import View
from adv2e.diagnosis.fitting.candidates import Candidate
from adv2e.diagnosis.fitting.fitted import Fitted, parted
from adv2e.effects import label_of
from adv2e.reports.result import Rejected

Array = NDArray[np.float64]

_SURE = 3.0
"""Standard errors over recordings by which an effect must gain, as of many recordings."""
_NO_TRIFLE = 0.005
"""Least gain, as a share of what the model so far leaves above the floor."""
_SHORT = 5
"""Effects that are fitted in each round: those whose best start does best."""
_ROUNDS, _LAST_ROUNDS, _MOST_EFFECTS = 3, 25, 4
_BLACKS = (0.05, 0.2)
"""Black levels where the fit of a view starts."""
_FLOOR_SEEDS = ((1, 2, 3), (4, 5, 6), (7, 8, 9))
_JUDGED = (11, 12)


@dataclass(frozen=True)
class Step:
    """A model on the way, and its misfit to recordings that it was not fitted to.

    Attributes
    ----------
    place : Place
        View, and the configuration with all keys that were fitted.
    effects : tuple of Candidate
        Those that were added, in their order.
    each : (recordings,)
        Misfit of each recording that judges.
    floor : (recordings,)
        What it would be if the recordings were simulations of this model.
    """

    place: Place
    effects: tuple[Candidate, ...]
    each: Array
    floor: Array

    @property
    def error(self) -> float:
        """Misfit above its floor, relative to the floor."""
        return float(self.each.sum() / self.floor.sum()) - 1.0

    @property
    def probability(self) -> float:
        """Probability that chance makes recordings differ so much, by their spread."""
        above = (self.each - self.floor) / (self.each + self.floor)
        return 0.5 * math.erfc(_sureness(above) / math.sqrt(2.0))


class FilmSearch:
    """Adds effects to a camera, one by one.

    `fitter` is of the recordings that models are fitted to, `judge` of the others; `nuisances` are
    keys that are not known.
    """

    def __init__(
        self,
        fitter: FilmFitter,
        judge: FilmFitter,
        nuisances: Candidate,
        threads: int,
        log: Callable[[str], None],
        begin: Callable[[str], None],
    ) -> None:
        self._fitter, self._judge, self._nuisances = fitter, judge, nuisances
        self._threads, self._log, self._begin = threads, log, begin
        self.rejected: dict[str, Rejected] = {}

    def start(self, view: View, declared: Config) -> Step:
        """Return the declared model with its view fitted, and the keys that are not known."""
        self._begin("fitting the view of the film")
        self._first_view = view
        begun = self._begun(Place(view, declared, self._nuisances, first_point(self._nuisances)))
        ends = [self._fitter.fitted(place, _LAST_ROUNDS) for place, _ in begun]
        for _, misfit in ends:
            self._log(f"  a fit of the view ended at {misfit:,.0f}")
        best, _ = min(ends, key=lambda end: end[1])
        self._fitter.align(best)
        best, _ = self._fitter.fitted(best, _LAST_ROUNDS)
        return self._aligned(best, ())

    @property
    def has_nuisances(self) -> bool:
        return bool(self._nuisances.parameters)

    def steps(self, first: Step, candidates: Sequence[Candidate]) -> Iterator[list[Step]]:
        """Yield all models so far, from the first on, after each effect that is added."""
        steps = [first]
        while len(steps) <= _MOST_EFFECTS:
            grown = self._grown(steps[-1], candidates)
            if grown is None:
                break
            steps.append(grown)
            self._log(f"added {grown.effects[-1].name}: misfit {grown.error + 1.0:.3g} of chance")
            yield list(steps)

    def _grown(self, step: Step, candidates: Sequence[Candidate]) -> Step | None:
        had = {one.name for one in step.effects}
        open_ = [one for one in candidates if one.name not in had]
        self._begin(f"trying {len({one.name for one in open_})} effects")
        tried = [(one, start) for one in open_ for start in one.starts]
        places = [self._with(step, one, start) for one, start in tried]
        with ThreadPoolExecutor(self._threads) as pool:
            rough = pool.map(lambda at: self._fitter.residual(at.view, at.config), places)
            misfits = [first.times(second) for first, second in rough]
        best: dict[str, tuple[float, Candidate, Place]] = {}
        for (one, _), place, misfit in zip(tried, places, misfits, strict=True):
            if one.name not in best or misfit < best[one.name][0]:
                best[one.name] = misfit, one, place
        ranked = sorted(best.values(), key=lambda found: found[0])
        for _, one, place in ranked[_SHORT:]:
            self._reject(one, place, "far behind others where its fit begins")
        grown: tuple[float, Step] | None = None
        for _, one, place in ranked[:_SHORT]:
            self._begin(f"fitting {label_of(one.name)}")
            fitted, _ = self._fitter.fitted(place, _ROUNDS, path=False)
            made = self._judged(fitted, (*step.effects, one))
            share = float((step.each - made.each).sum() / max((step.each - made.floor).sum(), 1e-9))
            sure = _sureness((step.each - made.each) / (step.each + made.floor))
            self._log(
                f"  {one.name} {one.settings(_own(fitted, one))}: takes away {share:.1%} of what is"
                f" left on other recordings ({sure:.1f} standard errors)"
            )
            if sure < _SURE:
                self._reject(one, fitted, "gains no more on other recordings than chance could")
            elif share < _NO_TRIFLE:
                self._reject(one, fitted, f"takes away {share:.1%} of what is left: a trifle")
            elif grown is None or share > grown[0]:
                if grown is not None:
                    self._reject(grown[1].effects[-1], grown[1].place, "explains less than another")
                grown = share, made
            else:
                self._reject(one, fitted, "explains less than another")
        if grown is None:
            return None
        added = grown[1].effects[-1]
        self.rejected.pop(added.name, None)
        self._begin(f"fitting the view again, with {label_of(added.name)}")
        ends = [
            self._from_anew(grown[1].place),
            self._fitter.fitted(grown[1].place, _LAST_ROUNDS),
        ]
        place, _ = min(ends, key=lambda end: end[1])
        return self._aligned(place, grown[1].effects)

    def _from_anew(self, place: Place) -> tuple[Place, float]:
        """Return the best fit of a place whose view starts anew, and its misfit.

        A view that was fitted without an effect has taken a part of it, and keeps that.
        """
        best, _ = min(self._begun(place), key=lambda end: end[1])
        return self._fitter.fitted(best, _LAST_ROUNDS)

    def _begun(self, place: Place) -> list[tuple[Place, float]]:
        """Return fits of a place along the first path, one for each black level of the start."""
        views = [replace(self._first_view, black=black) for black in _BLACKS]
        return [self._fitter.fitted(replace(place, view=one), _ROUNDS, path=False) for one in views]

    def _aligned(self, place: Place, effects: tuple[Candidate, ...]) -> Step:
        """Return a model as a step, after all recordings have moved in time to where it is best."""
        self._fitter.align(place)
        self._judge.align(place)
        return self._judged(place, effects)

    def _reject(self, one: Candidate, place: Place, why: str) -> None:
        self.rejected[one.name] = Rejected(one.name, why, one.settings(_own(place, one)))

    def _with(self, step: Step, one: Candidate, start: Sequence[float]) -> Place:
        """Return the place of a step with an effect more, where its fit begins."""
        place = step.place
        keys = Candidate.joined([place.keys, one])
        return replace(place, keys=keys, point=np.concatenate([place.point, one.scaled(start)]))

    def _judged(self, place: Place, effects: tuple[Candidate, ...]) -> Step:
        each = self._judge.each(place.view, place.config, _JUDGED)
        floors = []
        for a, b, c in _FLOOR_SEEDS:
            one, other, like = (
                self._judge.counting.numbers(stream)
                for stream in self._judge.streams(place.view, place.config, (a, b, c))
            )
            floors.append((one - like).each(other - like))
        return Step(place, effects, each, np.mean(floors, axis=0))

    def fits(self, step: Step) -> tuple[Fitted, ...]:
        """Return the effects of a step as fits, each with its covariance."""
        place, every = step.place, (self._nuisances, *step.effects)
        covariance = self._fitter.covariance(place, step.error + 1.0)
        joint = Fitted(place.keys, place.base, place.point, covariance=covariance)
        fits = parted(joint, tuple(Fitted(one, place.base, place.point) for one in every))
        return fits[1:]


def _sureness(gain: Array) -> float:
    """Return the mean of gains in standard errors, as many recordings would have them.

    The fewer recordings, the less a standard error tells (Student's t, as a normal deviate by
    Wallace's approximation, Ann. Math. Statist. 30, 1959, doi:10.1214/aoms/1177706271).
    """
    free = len(gain) - 1
    t = float(gain.mean() / (gain.std(ddof=1) / np.sqrt(len(gain)) + 1e-12))
    normal = (8 * free + 1) / (8 * free + 3) * math.sqrt(free * math.log1p(t * t / free))
    return math.copysign(normal, t)


def _own(place: Place, one: Candidate) -> Array:
    """Return the numbers of an effect, the last of those that were fitted."""
    return place.point[len(place.point) - len(one.parameters) :]
