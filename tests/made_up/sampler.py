"""A sampler without simulations: statistics are smooth functions of the keys, and noise."""

from __future__ import annotations

import dataclasses
from functools import lru_cache
from types import SimpleNamespace

import numpy as np

from adv2e.config import Config, load_config, to_dict
from adv2e.config.tree import get_key
from adv2e.diagnosis.data import splits
from adv2e.diagnosis.fitting.candidates import Candidate
from adv2e.diagnosis.fitting.fitted import Fitted, parted
from adv2e.diagnosis.fitting.fitter import Fitter
from adv2e.diagnosis.fitting.library import library
from adv2e.diagnosis.hints.collect import Hints
from adv2e.diagnosis.hints.lamps import Lamp
from adv2e.diagnosis.selection.reference import Reference
from adv2e.diagnosis.selection.search import Search
from adv2e.diagnosis.statistics.groups import Entry
from adv2e.diagnosis.statistics.metric import Scale
from adv2e.diagnosis.statistics.summary import BOTH, VIEWS
from adv2e.reports.result import ErrorRow, Estimate

STATISTICS = 40
RECORDING = 70_000
"""Seed of recordings."""
HINTS = Hints(1.0, (Lamp(100.0),), 1)

RESPONSES = {
    "pixel.refractory.period_us": lambda value: np.log(value / 500.0),
    "pixel.leak.rate_hz": lambda value: np.sqrt(value or 0.1) - np.sqrt(0.1),
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
    """Return those candidates of the library that the sampler knows."""
    return [one for one in library(Config(), HINTS) if one.name in (names or EFFECTS)]


@lru_cache(maxsize=4096)
def noise(seed: int):
    """Return the noise of one simulation, (views, statistics)."""
    z = np.random.default_rng([seed, 77]).normal(size=(VIEWS, STATISTICS))
    z[BOTH] = (z[splits.TRAIN] + z[splits.VALIDATION]) / np.sqrt(2.0)
    return z


class MadeUpSampler:
    """Stands in for :class:`adv2e.diagnosis.statistics.summary.Sampler`.

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
        self._means = {}
        self.statistics = SimpleNamespace(
            least=np.full(STATISTICS, 0.01),
            entries=[Entry(f"statistic {k}", "", "sd") for k in range(STATISTICS)],
        )

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
        mean = self.mean(config) + beyond
        views = np.repeat(mean[None], VIEWS, axis=0)
        views[BOTH] *= np.sqrt(2.0)
        together = np.random.default_rng([seed, 78]).normal(size=(VIEWS, 1)) * self.common
        return views + noise(seed) + together

    def sample(self, config, seeds):
        return np.array([self.measure(config, seed) for seed in seeds])

    def samples(self, configs, seeds):
        return np.array([self.sample(config, seeds) for config in configs])

    @property
    def rough(self):
        return self


def searched(
    truth=(),
    sampler=None,
    library=None,
    beyond=0.0,
    seed=RECORDING,
    declared=None,
    last_truth=None,
    log=lambda text: None,
):
    """Return the search on a made-up recording, and its outcome."""
    sampler = sampler or MadeUpSampler()
    observed = sampler.measure(load_config([], truth), seed, beyond)
    if last_truth is not None:
        other = sampler.measure(load_config([], last_truth), seed, beyond)
        observed[splits.TEST] = other[splits.TEST]
    search = search_of(sampler, observed, declared, library, log=log)
    return search, search.run()


def search_of(sampler, observed, declared=None, library=None, **options):
    """Return a search for what is missing in a declared model."""
    reference = Reference(sampler, observed, declared or Config(), **options)
    return Search(reference, candidates() if library is None else library)


def outside(size):
    """Return a change of statistics that no effect makes, nor all of them together."""
    patterns = np.array(list(MadeUpSampler().patterns.values()))
    draw = np.random.default_rng(11).normal(size=STATISTICS)
    draw -= np.linalg.pinv(patterns) @ (patterns @ draw)
    return size * draw / np.linalg.norm(draw)


def fits_of(*effects):
    """Return unfinished fits of effects with one key each: (name, value)."""
    found = [(candidates(name)[0], value) for name, value in effects]
    return tuple(Fitted(one, Config(), np.array(one.scaled((value,)))) for one, value in found)


def refitted(search, fits):
    """Return the model with all `fits`, fitted together."""
    joint = search.reference.fitted(fits, search.declared.ensembles[BOTH].sd, BOTH)
    return search.reference.state(joint.config, parted(joint, fits))


def fitter_of(sampler, observed, view=splits.TRAIN, sd=None):
    sample = sampler.sample(Config(), range(2001, 2121))[:, view]
    return Fitter(sampler, Scale.of(sample, sampler.statistics.least), observed, view, sd)


def only(name, forms=None):
    found = [one for one in candidates(name) if forms is None or len(one.parameters) == forms]
    return found[0]


class QuickThresholds(Candidate):
    """The thresholds, set without checks of the whole configuration."""

    def applied(self, config, point):
        on, off = (one.value_at(at) for one, at in zip(self.parameters, point, strict=True))
        thresholds = dataclasses.replace(config.pixel.thresholds, on=on, off=off)
        return dataclasses.replace(
            config, pixel=dataclasses.replace(config.pixel, thresholds=thresholds)
        )
