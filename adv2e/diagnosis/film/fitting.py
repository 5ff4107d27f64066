r"""Fit of a view of a film and of keys of the camera, by simulation.

Damped Gauss-Newton steps on the numbers of events (:mod:`adv2e.diagnosis.film.residual`).  Products
are formed between simulations of two seeds, so that chance does not add up in them, as in
:mod:`adv2e.diagnosis.fitting.fitter`.  A control point of the path moves the light for a short time
only; so derivatives by every n-th of them are taken from one simulation.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from adv2e.config import Config
from adv2e.diagnosis.data.splits import Stream
from adv2e.diagnosis.film.residual import Counting, Numbers, places_of
from adv2e.diagnosis.film.view import KNOT_NS, UNKNOWNS, Films, Unknown, View
from adv2e.diagnosis.fitting.candidates import Candidate
from adv2e.diagnosis.simulation.affordable import FINE
from adv2e.diagnosis.simulation.simulator import events_of

Array = NDArray[np.float64]

SEEDS = (1, 2)
_APART = 5
"""Knots from one that is moved to the next that is moved with it."""
_REACH = 2.5
"""Knots on either side of one, in whose time it moves the light."""
_STEP_PX, _LARGEST_PX = 0.3, 0.4
_STEP, _LARGEST = 0.12, 0.2
"""Of a camera's key: change by which its derivative is taken, and most by which a step moves it."""
_BEND_PX = 0.25
"""Standard deviation of the prior of a path's second differences from knot to knot [px]."""
_SETTLED, _IN_A_ROW = 0.006, 2
"""Gain of a step, as a share of the misfit, below which a fit ends after so many such steps."""
_EDGE = 6
"""Events by which the rate at the ends of a recording is told."""
_OFFSETS_US = np.arange(-6_000.0, 6_001.0, 500.0)
"""Changes of a recording's delay that are tried."""
_VARIANCE, _TOLD = 3 * 0.25, 1e-4
"""Variance of a square root of a count, each of which is told three times: by cells, course and
gaps; and least eigenvalue of what data tell."""
_DAMPING, _HARDER, _TRIES, _EIGEN = 0.02, 8.0, 4, 0.003


_ALL = slice(None)


@dataclass(frozen=True)
class Place:
    """A model: view, base configuration, and a point of the keys that are fitted with it."""

    view: View
    base: Config
    keys: Candidate
    point: Array

    @property
    def config(self) -> Config:
        return self.keys.applied(self.base, self.point)


def first_point(keys: Candidate) -> Array:
    """Return the point of the first start of some keys, on their scales."""
    return np.array(keys.scaled(keys.starts[0]))


class FilmFitter:
    """Simulates recordings of films, and fits views and cameras to them.

    `measured`: the events of all recordings side by side; `rests_us`: times at which the camera
    rests between two motions; `count` is told of simulations.

    Attributes
    ----------
    delays_us : (recordings, motions)
        By how much each motion of each recording is late.
    """

    def __init__(
        self,
        films: Films,
        measured: Stream,
        threads: int,
        count: Callable[[], None] = lambda: None,
        rests_us: Sequence[float] = (),
    ) -> None:
        self.films, self._count, self._threads = films, count, threads
        first, last = (films.times_ns[[0, -1]] * 1e-3).tolist()
        width, height = films.size
        self.counting = Counting(width, height, len(films.pictures), (first, last))
        self._span_us = first, last
        self._as_read = measured
        number, _, _ = places_of(measured, len(films.pictures))
        self._recorded_us = _recorded(measured.t, number, len(films.pictures))
        self.rests_us = np.asarray(rests_us, np.float64)
        self.shift_us(np.zeros((len(films.pictures), len(rests_us) + 1)))

    def shift_us(self, delays_us: Array) -> None:
        """Take each motion of each recording to be late by so much, (recordings, motions) [us]."""
        stream, self.delays_us = self._as_read, delays_us
        number, _, _ = places_of(stream, len(self.films.pictures))
        motion = np.searchsorted(self.rests_us, stream.t - delays_us.mean(axis=1)[number])
        t = stream.t - np.rint(delays_us).astype(np.int64)[number, motion]
        order = np.argsort(t, kind="stable")
        moved = Stream(t[order], stream.pixel[order], stream.on[order], stream.width, stream.height)
        self.measured = moved.between(*self._span_us)
        self._wanted = self.counting.numbers(self.measured)

    def align(self, place: Place) -> None:
        """Find anew by how much each motion of each recording is late, as a model says.

        Pictures are seen along one path, but no two recordings begin at the same moment of it, nor
        does a camera begin each of its motions at the same time after the one before.
        """
        made = list(self._whole(place.view, place.config, SEEDS))
        borders_us = [self._span_us[0], *self.rests_us.tolist(), self._span_us[1]]
        bins = [self.counting.bins_between(*pair) for pair in pairwise(borders_us)]
        before, misfits = self.delays_us, []
        for offset in _OFFSETS_US:
            self.shift_us(before + offset)
            first, second = (self._off_by(one) for one in made)
            misfits.append(np.stack([first.each(second, of) for of in bins], axis=1))
        grid = np.array(misfits)
        best = np.clip(grid.argmin(axis=0), 1, len(grid) - 2)[None]
        below, at, above = (np.take_along_axis(grid, best + k, axis=0)[0] for k in (-1, 0, 1))
        bend = np.maximum(below - 2 * at + above, 1e-9)
        finer = np.clip(0.5 * (below - above) / bend, -0.5, 0.5)
        self.shift_us(before + _OFFSETS_US[best[0]] + finer * (_OFFSETS_US[1] - _OFFSETS_US[0]))

    def streams(self, view: View, config: Config, seeds: Sequence[int]) -> list[Stream]:
        """Return the events of simulations of all recordings, one for each seed.

        Each recording has those of the time in which its camera recorded.
        """
        return [self.recorded(one) for one in self._whole(view, config, seeds)]

    def _whole(self, view: View, config: Config, seeds: Sequence[int]) -> Iterator[Stream]:
        light = self.films.light(view)
        instants = self.films.times_ns.tolist(), light
        for seed in seeds:
            events = events_of(
                instants, replace(config, seed=config.seed + seed), threads=1, coarseness=FINE
            )
            yield Stream.of(events, light.shape[2], light.shape[1]).between(*self._span_us)
            self._count()

    def _off_by(self, stream: Stream) -> Numbers:
        return self.counting.numbers(self.recorded(stream)) - self._wanted

    def recorded(self, stream: Stream) -> Stream:
        """Return those events of all recordings side by side that are of the time of each."""
        begin, end = (self._recorded_us - self.delays_us[:, [0, -1]]).T
        number, _, _ = places_of(stream, len(self.films.pictures))
        return stream.chosen((stream.t >= begin[number]) & (stream.t <= end[number]))

    def residual(self, view: View, config: Config, seeds: Sequence[int] = SEEDS) -> list[Numbers]:
        """Return simulated less measured numbers, one for each seed."""
        return [self._off_by(one) for one in self._whole(view, config, seeds)]

    def each(self, view: View, config: Config, seeds: Sequence[int] = SEEDS) -> Array:
        """Return the misfit of each recording, (recordings,), without the chance of simulations."""
        first, second = self.residual(view, config, seeds)
        return first.each(second)

    def fitted(
        self, place: Place, rounds: int, unknowns: Sequence[str] | None = None, *, path: bool = True
    ) -> tuple[Place, float]:
        """Return the best place found from another on, and its misfit.

        `unknowns`: names of the numbers of the view that are fitted, all by default; `path`:
        whether the path is, too.
        """
        free = [one for one in UNKNOWNS if unknowns is None or one.name in unknowns]
        with ThreadPoolExecutor(self._threads) as pool:
            return _Descent(self, pool, free, path).run(place, rounds)

    def covariance(self, place: Place, excess: float) -> Array:
        """Return the covariance of the camera's keys, with a view and a path that are not known.

        `excess`: misfit over that of chance, by which variances are larger (quasi-likelihood).
        """
        with ThreadPoolExecutor(self._threads) as pool:
            return excess * _Descent(self, pool, UNKNOWNS, path=True).covariance(place)


def _recorded(t: NDArray[np.int64], number: NDArray[np.intp], recordings: int) -> Array:
    """Return when each recording began and ended, (recordings, 2) [us].

    A camera records a little longer than its first and last event tell: by one more of the times
    between the events there.
    """
    found = np.tile([-np.inf, np.inf], (recordings, 1))
    for k in range(recordings):
        own = t[number == k]
        if len(own) < _EDGE:
            continue  # nobody knows
        wait = [float(np.ptp(side)) / (len(side) - 1) for side in (own[:_EDGE], own[-_EDGE:])]
        found[k] = own[0] - wait[0], own[-1] + wait[1]
    return found


@dataclass(frozen=True)
class _Column:
    """Derivative by one number, of each seed, in some bins."""

    by_seed: tuple[Numbers, ...]
    bins: slice


class _Descent:
    def __init__(
        self, fitter: FilmFitter, pool: ThreadPoolExecutor, free: Sequence[Unknown], path: bool
    ) -> None:
        self._fitter, self._pool, self._free, self._path = fitter, pool, free, path

    def run(self, place: Place, rounds: int) -> tuple[Place, float]:
        here = self._fitter.residual(place.view, place.config)
        misfit, damping, small = self._misfit(place, here), _DAMPING, 0
        for _ in range(rounds):
            columns = self._columns(place, here)
            normal, downhill = self._slope(place, here, columns)
            for _ in range(_TRIES):
                tried = self._moved(place, _step(normal, downhill, damping))
                there = self._fitter.residual(tried.view, tried.config)
                found = self._misfit(tried, there)
                if found < misfit:
                    break
                damping *= _HARDER
            else:
                break
            gained, place, here, misfit = misfit - found, tried, there, found
            damping = max(damping / _HARDER, 1e-3)
            small = small + 1 if gained < _SETTLED * abs(misfit) else 0
            if small == _IN_A_ROW:
                break
        return place, misfit

    def covariance(self, place: Place) -> Array:
        """Compute the covariance if chance alone is left."""
        here = self._fitter.residual(place.view, place.config)
        normal, _ = self._slope(place, here, self._columns(place, here))
        scale = 1.0 / np.sqrt(np.abs(np.diag(normal)) + 1e-6)
        values, vectors = np.linalg.eigh(normal * np.outer(scale, scale))
        told = values > _TOLD
        inverse = (vectors[:, told] / values[told]) @ vectors[:, told].T
        first = len(self._free)
        own = slice(first, first + len(place.keys.parameters))
        found = _VARIANCE * (inverse * np.outer(scale, scale))[own, own]
        # what lies mostly in directions that the data do not tell may be anything
        untold = (vectors[own][:, ~told] ** 2).sum(axis=1) > 0.5
        found[untold, :] = found[:, untold] = 0.0
        found[untold, untold] = np.inf
        return np.asarray(found)

    def _misfit(self, place: Place, here: list[Numbers]) -> float:
        return here[0].times(here[1]) + float(np.sum((_bend(place.view) / _BEND_PX) ** 2))

    def _columns(self, place: Place, here: list[Numbers]) -> list[_Column]:
        """Return the derivatives by all free numbers: of the view, of the camera, of the path."""
        view, moves = place.view, list[tuple[Place, float]]()
        for one in self._free:
            value, step = getattr(view, one.name), one.step
            if one.moved(value, step) == value:
                step = -step
            moves.append((replace(place, view=view.moved(one, step)), step))
        parameters = place.keys.parameters
        for k, parameter in enumerate(parameters):
            step = _STEP
            if parameter.at_border(place.point[k] + step):
                step = -step
            point = place.point.copy()
            point[k] += step
            moves.append((replace(place, point=point), step))
        groups = [(axis, k) for axis in (0, 1) for k in range(min(_APART, len(view.path)))]
        for axis, k in groups if self._path else ():
            path = view.path.copy()
            path[k::_APART, axis] += _STEP_PX
            moves.append((replace(place, view=replace(view, path=path)), _STEP_PX))
        slopes = list(self._pool.map(lambda move: self._slope_by(here, *move), moves))
        columns = [_Column(one, _ALL) for one in slopes[: len(self._free) + len(parameters)]]
        if self._path:
            columns += self._of_the_path(dict(zip(groups, slopes[len(columns) :], strict=True)))
        return columns

    def _slope_by(self, here: list[Numbers], place: Place, step: float) -> tuple[Numbers, ...]:
        there = self._fitter.residual(place.view, place.config)
        return tuple((a - b).scaled(1.0 / step) for a, b in zip(there, here, strict=True))

    def _of_the_path(self, slopes: dict[tuple[int, int], tuple[Numbers, ...]]) -> list[_Column]:
        knots_us = self._fitter.films.knots_ns * 1e-3
        reach_us = _REACH * KNOT_NS * 1e-3
        columns = []
        for axis in (0, 1):
            for k, at_us in enumerate(knots_us.tolist()):
                bins = _ALL
                if len(knots_us) > 1:
                    bins = self._fitter.counting.bins_between(at_us - reach_us, at_us + reach_us)
                columns.append(_Column(slopes[axis, k % _APART], bins))
        return columns

    def _slope(
        self, place: Place, here: list[Numbers], columns: list[_Column]
    ) -> tuple[Array, Array]:
        """Return normal matrix and downhill vector, from products between the two seeds."""
        count = len(columns)
        normal, downhill = np.zeros((count, count)), np.zeros(count)
        for i, a in enumerate(columns):
            (a0, a1), (r0, r1) = a.by_seed, here
            downhill[i] = -0.5 * (a0.times(r1, a.bins) + a1.times(r0, a.bins))
            for j, b in enumerate(columns[: i + 1]):
                bins = _both(a.bins, b.bins)
                if bins is not None:
                    b0, b1 = b.by_seed
                    normal[i, j] = normal[j, i] = 0.5 * (a0.times(b1, bins) + a1.times(b0, bins))
        if self._path and len(place.view.path) > 2:
            knots = len(place.view.path)
            second = np.diff(np.eye(knots), 2, axis=0) / _BEND_PX
            for axis in (0, 1):
                begin = count - (2 - axis) * knots
                own = slice(begin, begin + knots)
                normal[own, own] += second.T @ second
                downhill[own] -= second.T @ (second @ place.view.path[:, axis])
        return normal, downhill

    def _moved(self, place: Place, step: Array) -> Place:
        view, at = place.view, 0
        for one in self._free:
            view = view.moved(one, float(np.clip(step[at], -_LARGEST, _LARGEST)))
            at += 1
        keys = len(place.keys.parameters)
        point = place.point + np.clip(step[at : at + keys], -_LARGEST, _LARGEST)
        if self._path:
            moves = np.clip(step[at + keys :], -_LARGEST_PX, _LARGEST_PX).reshape(2, -1).T
            reach = self._fitter.films.reach_px
            view = replace(view, path=np.clip(view.path + moves, -reach, reach))
        return replace(place, view=view, point=place.keys.inside(point))


def _bend(view: View) -> Array:
    return np.diff(view.path, 2, axis=0)


def _both(a: slice, b: slice) -> slice | None:
    """Return the bins of both of two columns; None: they have none in common."""
    if _ALL in (a, b):
        return b if a == _ALL else a
    low, high = max(a.start, b.start), min(a.stop, b.stop)
    return slice(low, high) if low < high else None


def _step(normal: Array, downhill: Array, damping: float) -> Array:
    """Return a damped step; directions that the data do not tell are hardly followed."""
    scale = 1.0 / np.sqrt(np.abs(np.diag(normal)) + 1e-6)
    values, vectors = np.linalg.eigh(normal * np.outer(scale, scale))
    along = vectors.T @ (scale * downhill)
    return np.asarray(scale * (vectors @ (along / (np.maximum(values, _EIGEN) + damping))))
