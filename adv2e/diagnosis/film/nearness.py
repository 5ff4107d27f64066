"""Nearness of simulated to measured recordings of films, in numbers that have names."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from adv2e.comparison.features import features, trains
from adv2e.comparison.two_samples import PARTS, Samples, accuracy
from adv2e.events import Events, Window
from adv2e.geometry import Size

Array = NDArray[np.float64]

_BINS = 32
_GAPS_US = 10.0 ** np.arange(0.0, 6.01, 0.25)

TOTALS = "all events: ln(simulated / measured), without its sign"
CORRELATION = "one less the correlation of the recordings' numbers of events"
SPREAD = "spread over recordings of ln(events simulated / measured)"
COURSE = "mean course in time, in 32 parts: sum of the differences of shares"
GAPS = "times between events of a pixel, by quarters of decades: sum of the differences of shares"
MAPS = "one less the mean correlation of count maps"
TOLD = "accuracy of a linear classifier that tells simulated from measured (0.5: it cannot)"
DISTANCES = (TOTALS, SPREAD, CORRELATION, COURSE, GAPS, MAPS, TOLD)
"""Names of the distances that :func:`distances` returns: the less, the nearer."""


def gaps(events: Events, size: Size) -> Array:
    """Return the numbers of times between events of a pixel, by quarters of decades of us."""
    return np.histogram(np.maximum(trains(events, size.width)[1], 1), _GAPS_US)[0].astype(float)


def distances(
    measured: Sequence[Events], simulated: Sequence[Events], size: Size, span: Window
) -> dict[str, float]:
    """Return how far simulated recordings are from measured ones, two by two of the same film."""

    def shares(of: Callable[[Events], Array]) -> list[Array]:
        sums = [np.sum([of(one) for one in side], axis=0) for side in (measured, simulated)]
        return [one / max(one.sum(), 1.0) for one in sums]

    def course(events: Events) -> Array:
        return np.histogram(events["t"], np.linspace(*span, _BINS + 1))[0].astype(np.float64)

    def between(events: Events) -> Array:
        return gaps(events, size)

    def maps(events: Events) -> Array:
        place = events["y"].astype(np.intp) * size.width + events["x"]
        return np.bincount(place, minlength=size.width * size.height).astype(np.float64)

    pairs = list(zip(measured, simulated, strict=True))
    ratios = [np.log((len(b) + 0.5) / (len(a) + 0.5)) for a, b in pairs]
    alike = [float(np.corrcoef(maps(a), maps(b))[0, 1]) for a, b in pairs]
    counts = np.array([(len(a), len(b)) for a, b in pairs], np.float64).T
    found = [np.abs(np.log((counts[1].sum() + 0.5) / (counts[0].sum() + 0.5))), np.std(ratios)]
    apart = counts - counts.mean(axis=1, keepdims=True)
    scale = np.sqrt((apart**2).sum(axis=1).prod())
    # numbers that are all alike do not go together, nor against one another
    found += [1.0 - float(apart[0] @ apart[1] / scale) if scale else 1.0]
    found += [np.abs(np.subtract(*shares(of))).sum() for of in (course, between)]
    found += [1.0 - np.mean(alike), accuracy(samples(measured, simulated, size, span))]
    return dict(zip(DISTANCES, map(float, found), strict=True))


def samples(
    measured: Sequence[Events], simulated: Sequence[Events], size: Size, span: Window
) -> Samples:
    """Return the recordings as samples of two sets; the two of one film are a group."""
    rows = [features(one, size, span, PARTS) for one in (*measured, *simulated)]
    second = np.arange(len(rows)) >= len(measured)
    return Samples(np.array(rows), second, np.arange(len(rows)) % len(measured))
