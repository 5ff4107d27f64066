"""Noise floors: what the distances come to where nothing but chance differs.

``half_split``
    Each measured event goes to one of two halves by the toss of a coin.  If events were a Poisson
    process, the difference of the halves would be as large as that of one full draw from its own
    rate, so the distance between the halves, over the norm of the whole, is how near the true rate
    itself would come (a second draw lies sqrt 2 times as far).  It needs no model.  Pixels fire
    more regularly than Poisson's, so that a model may come nearer.
``two_seeds``
    The distance between two simulations that differ in their seed alone (noise and the chip's
    thresholds), over the norm of the measured stream: no comparison of this model with anything
    can tell differences below it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from adv2e.comparison.distances import distances, pooled
from adv2e.comparison.windows import Windows
from adv2e.events import Events

SPLITS = 4
"""Half splits whose distances are averaged."""

Floor = dict[str, float | None]
"""A value for each measure, None where it is not defined."""


def half_split(
    measured: Events, windows: Windows, width: int, height: int, *, splits: int = SPLITS
) -> Floor:
    """Return the distances between two halves of the measured events, mean over `splits`.

    The split draws from a generator of fixed seed: the same events give the same floor.

    Parameters
    ----------
    measured : Events
        Sorted.
    windows : Windows
        Where to compare.
    width, height : int
        Columns and rows of the sensor.
    splits : int
        How often to split.
    """
    coin = np.random.default_rng(0)
    found = []
    for _ in range(splits):
        heads = coin.random(len(measured)) < 0.5
        halves = measured[heads], measured[~heads]
        found.append(distances(*halves, windows, width, height, whole=measured).values)
    return _mean(found)


def two_seeds(
    simulate_events: Callable[[int], Events],
    seeds: tuple[int, int],
    measured: Events,
    windows: Windows,
    width: int,
    height: int,
) -> Floor:
    """Return the distances between two simulations, relative to the measured stream.

    Parameters
    ----------
    simulate_events : callable
        Takes a seed, returns sorted events on the measured stream's clock.
    seeds : (int, int)
        Two different seeds.
    measured : Events
        The stream whose norm is divided by, sorted.
    windows : Windows
        Where to compare.
    width, height : int
        Columns and rows of the sensor.
    """
    first, second = (simulate_events(seed) for seed in seeds)
    return distances(first, second, windows, width, height, whole=measured).values


def _mean(found: Sequence[Floor]) -> Floor:
    return {name: pooled([one[name] for one in found], "mean") for name in found[0]}
