"""A laboratory without simulations: statistics are smooth functions of the keys, and noise."""

from __future__ import annotations

import dataclasses
from functools import lru_cache
from types import SimpleNamespace

import numpy as np

from adv2e.config import Config, load_config, to_dict
from adv2e.config.paths import get_key
from adv2e.diagnosis.data import splits as parts
from adv2e.diagnosis.fitting.candidates import Candidate
from adv2e.diagnosis.fitting.fit import Fitted, Fitter
from adv2e.diagnosis.fitting.library import library
from adv2e.diagnosis.hints.collect import Hints
from adv2e.diagnosis.hints.lamps import Lamp
from adv2e.diagnosis.selection.reference import parted
from adv2e.diagnosis.selection.search import Search
from adv2e.diagnosis.statistics import BOTH, VIEWS, Entry
from adv2e.diagnosis.statistics.metric import Scale
from adv2e.reports.result import ErrorRow, Estimate

STATISTICS = 40
RECORDING = 70_000
"""Seed of recordings."""
HINTS = Hints(1.0, (Lamp(100.0),), 1)

RESPONSES = {
    "pixel.refractory.period_us": lambda value: np.log(value / 500.0),
    "pixel.leak.rate_hz": lambda value: np.sqrt(value) - np.sqrt(0.1),
    "pixel.shot_noise.rate_hz": lambda value: np.sqrt(value) - 0.1,
    "pixel.dark_current.dn": lambda value: np.log1p(value or 0.0),
    "readout.loss.fraction": lambda value: 5.0 * (value or 0.0),
    "pixel.thresholds.on": lambda value: 4.0 * np.log(value / 0.2),
    "pixel.thresholds.off": lambda value: 4.0 * np.log(value / 0.2),
}
"""What a key does to statistics: how much of its own pattern; nothing at its default."""

EFFECTS = ("refractory", "leak", "shot_noise", "dark_current", "event_loss", "thresholds")


def error(before, after, floor, spread=0.02):
    """Return a row of errors, each with an interval of that width."""
    ends = (Estimate(v, (v - spread / 2, v + spread / 2)) for v in (before, after, floor))
    return ErrorRow("error", *ends)


GONE = error(0.8, 0.4, 0.4)
"""Errors of a model that explains all that can be explained."""


def candidates(*names):
    """Return those candidates of the library that the laboratory knows."""
    return [one for one in library(Config(), HINTS) if one.name in (names or EFFECTS)]


@lru_cache(maxsize=4096)
def noise(seed: int):
    """Return the noise of one simulation, (views, statistics)."""
    z = np.random.default_rng([seed, 77]).normal(size=(VIEWS, STATISTICS))
    z[BOTH] = (z[parts.FIT] + z[parts.JUDGE]) / np.sqrt(2.0)
    return z


class MadeUpLaboratory:
    """Stands in for :class:`adv2e.diagnosis.fitting.simulations.Laboratory`.

    Parameters
    ----------
    strength : float
        Deviations by which one unit of response moves all statistics together.
    alike : mapping
        Keys with the pattern of another.
    curvature : float
        How far responses are from proportional.
    common : (statistics,), optional
        Direction in which chance moves all statistics together, and by how much.
    """

    def __init__(self, strength=20.0, alike=None, curvature=0.0, common=None):
        draw = np.random.default_rng(5)
        self.patterns = {}
        for key in RESPONSES:
            pattern = draw.normal(size=STATISTICS)
            self.patterns[key] = strength * pattern / np.linalg.norm(pattern)
        for key, other in (alike or {}).items():
            self.patterns[key] = self.patterns[other]
        self.curvature = curvature
        self.common = np.zeros(STATISTICS) if common is None else common
        self._means, self.expected = {}, []
        self.simulator = SimpleNamespace(done=0, expect=self._expect)
        self.markers = SimpleNamespace(
            least=np.full(STATISTICS, 0.01),
            entries=[Entry(f"statistic {k}", "") for k in range(STATISTICS)],
        )

    def _expect(self, more, after_the_search=0):
        self.expected.append(more)

    def mean(self, config):
        """Return what is expected of a configuration, (statistics,)."""
        if config not in self._means:
            self._means[config] = self._mean(config)
        return self._means[config]

    def _mean(self, config):
        values = to_dict(config)
        total = np.zeros(STATISTICS)
        for key, response in RESPONSES.items():
            size = response(get_key(values, key))
            total += (size + self.curvature * size * abs(size)) * self.patterns[key]
        return total

    def measure(self, config, seed, beyond=0.0):
        """Return statistics, (views, statistics); `beyond` is what no key makes."""
        self.simulator.done += 1
        mean = self.mean(config) + beyond
        views = np.repeat(mean[None], VIEWS, axis=0)
        views[BOTH] *= np.sqrt(2.0)
        together = np.random.default_rng([seed, 78]).normal(size=(VIEWS, 1)) * self.common
        return views + noise(seed) + together

    def ensemble(self, config, seeds):
        return np.array([self.measure(config, seed) for seed in seeds])

    def many(self, configs, seeds):
        return np.array([self.ensemble(config, seeds) for config in configs])

    @property
    def for_a_first_look(self):
        return self


def searched(
    truth=(),
    laboratory=None,
    library=None,
    beyond=0.0,
    seed=RECORDING,
    declared=None,
    last_truth=None,
    log=lambda text: None,
):
    """Return the search on a made-up recording, and its outcome."""
    laboratory = laboratory or MadeUpLaboratory()
    observed = laboratory.measure(load_config([], truth), seed, beyond)
    if last_truth is not None:
        other = laboratory.measure(load_config([], last_truth), seed, beyond)
        observed[parts.LAST] = other[parts.LAST]
    library = candidates() if library is None else library
    search = Search(laboratory, observed, declared or Config(), library, log=log)
    return search, search.run()


def outside(size):
    """Return a change of statistics that no effect makes, nor all of them together."""
    patterns = np.array(list(MadeUpLaboratory().patterns.values()))
    draw = np.random.default_rng(11).normal(size=STATISTICS)
    draw -= np.linalg.pinv(patterns) @ (patterns @ draw)
    return size * draw / np.linalg.norm(draw)


def fits_of(*effects):
    """Return unfinished fits of effects with one key each: (name, value)."""
    found = [(candidates(name)[0], value) for name, value in effects]
    return tuple(Fitted(one, Config(), np.array(one.inner((value,)))) for one, value in found)


def refitted(search, fits):
    """Return the model with all `fits`, fitted together."""
    joint = search.bench.fitted(fits, search.declared.models[BOTH].sd, BOTH)
    return search.bench.state(joint.config, parted(joint, fits))


def fitter_of(laboratory, observed, view=parts.FIT, sd=None):
    sample = laboratory.ensemble(Config(), range(2001, 2121))[:, view]
    return Fitter(laboratory, Scale.of(sample, laboratory.markers.least), observed, view, sd)


def only(name, forms=None):
    found = [one for one in candidates(name) if forms is None or len(one.knobs) == forms]
    return found[0]


class QuickThresholds(Candidate):
    """The thresholds, set without checks of the whole configuration."""

    def applied(self, config, inner):
        on, off = (knob.outer(place) for knob, place in zip(self.knobs, inner, strict=True))
        thresholds = dataclasses.replace(config.pixel.thresholds, on=on, off=off)
        return dataclasses.replace(
            config, pixel=dataclasses.replace(config.pixel, thresholds=thresholds)
        )
