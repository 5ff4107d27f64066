"""The noise floor of the distances: what they come to where nothing but chance differs.

Each measured event goes to one of two halves by the toss of a coin.  If events were a Poisson
process, the difference of the halves would be as large as that of one full draw from its own
rate, so the distance between the halves, over the norm of the whole, is how near the true rate
itself would come (a second draw lies sqrt 2 times as far).  It needs no model.  Pixels fire more
regularly than Poisson's, so that a model may come nearer.
"""

from __future__ import annotations

import numpy as np

from adv2e.comparison.distances import MEASURES, distances, pooled
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
    """
    coin = np.random.default_rng(0)
    found = []
    for _ in range(splits):
        heads = coin.random(len(measured)) < 0.5
        halves = measured[heads], measured[~heads]
        found.append(distances(*halves, windows, width, height, whole=measured).values)
    return {name: pooled([one[name] for one in found], "mean") for name in MEASURES}
