r"""Whether two sets of events can be told apart, by a classifier that tries (C2ST).

A linear classifier learns from a part of the samples which set each is of, and is asked about the
rest.  Its accuracy is that of a coin, .5, where both sets have one law.  It is ridge regression of
+1 and -1 on standardised features,

.. math:: w = (Z^T D Z + \lambda I)^{-1} Z^T D y, \qquad \lambda = 1,

where the weights D give both sets one half.  Samples of a group (two of one scene, or windows of
one block of time) are never on both sides, nor are windows that follow one another.

References
----------
.. [1] D. Lopez-Paz and M. Oquab, "Revisiting classifier two-sample tests", ICLR 2017,
   arXiv:1610.06545.
.. [2] E. B. Wilson, "Probable inference, the law of succession, and statistical inference", Journal
   of the American Statistical Association 22, 1927, doi:10.1080/01621459.1927.10502953.
.. [3] L. Kish, "Survey Sampling", Wiley 1965: the effective size of a sample of groups.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.comparison.features import Feature, Features, described, features
from adv2e.comparison.windows import Windows
from adv2e.events import Events, cut

FOLDS = 5
"""Parts of the samples, each of which is asked about once."""
SPLITS = 4
"""Splits in halves whose accuracies are averaged for the floor."""
PARTS = 32
"""Parts of a recording in time, for its course."""
_WINDOW_PARTS = 4
_BLOCKS = 20
_LEAST_A_BLOCK, _MOST_A_BLOCK = 3, 10  # windows
_EVENTS_A_WINDOW = 100
_MOST_TOLD = 5
_RIDGE = 1.0
_SURE = 5.0
"""Standard errors of a difference that is told: there are some 200 features to pick from."""
_Z95 = 1.959963984540054

_RULE = (
    "share of samples that a linear classifier puts right, asked about samples that it did not"
    " learn from (mean of both sets; 0.5: the sets cannot be told apart; 1: always): {}. Interval:"
    " Wilson's of 95 %, for as many samples as the spread over groups is worth, at most half of all"
)
RECORDINGS = _RULE.format(
    f"samples are recordings, in {FOLDS} parts; two of one name are a group and always in one part"
)
WINDOWS = _RULE.format(
    f"samples are windows of time of both, in {_BLOCKS} blocks; the windows of a block are a group,"
    " and those beside one that is asked about are not learnt from"
)
HALVES = (
    "accuracy between two halves of the measured recordings, drawn by chance; mean of"
    f" {SPLITS} draws"
)
FEATURES = (
    "simulated against measured: the largest differences of means, over the standard deviation"
    f" within a set, of those above {_SURE:g} standard errors; one of a kind (events, ON, length,"
    " course, columns, rows, gaps, busiest pixels)"
)

Right = NDArray[np.bool_]
Floor = dict[str, float | None]
"""A value for each measure, or kind of floor; None where it is not defined."""


@dataclass(frozen=True)
class Samples:
    """Samples of two sets.

    Attributes
    ----------
    values : array of float64, (samples, features)
    is_simulated : array of bool, (samples,)
        Set of each.
    group : array of int64, (samples,)
        Samples of one number are learnt from, or asked about, together.
    place : array of int64, (samples,), optional
        Place in time: neighbours of what is asked about are not learnt from.
    """

    values: Features
    is_simulated: NDArray[np.bool_]
    group: NDArray[np.int64]
    place: NDArray[np.int64] | None = None


def right(samples: Samples) -> Right:
    """Return of each sample whether it is put right by what was learnt without its part."""
    fold = samples.group % FOLDS
    found = np.zeros(len(fold), np.bool_)
    for number in range(FOLDS):
        asked = fold == number
        learnt = ~asked
        if samples.place is not None:
            at = samples.place[asked]
            learnt &= ~np.isin(samples.place, np.concatenate([at - 1, at + 1]))
        score = _learn(samples.values[learnt], samples.is_simulated[learnt])
        found[asked] = (score(samples.values[asked]) > 0) == ~samples.is_simulated[asked]
    return found


def _learn(values: Features, is_simulated: NDArray[np.bool_]) -> Callable[[Features], Features]:
    """Return what is above 0 for samples like the measured ones of `values`."""
    share = _halves(is_simulated)
    mean = share @ values
    deviation = np.sqrt(share @ (values - mean) ** 2)
    # what is the same everywhere but for rounding tells nothing
    scale = np.zeros(len(mean))
    np.divide(1.0, deviation, out=scale, where=deviation > 1e-9 * (1.0 + np.abs(mean)))
    z = (values - mean) * scale
    normal = (z * share[:, None]).T @ z + _RIDGE * np.eye(len(mean))
    weights = np.linalg.solve(normal, (z * share[:, None]).T @ np.where(is_simulated, -1.0, 1.0))
    return lambda others: (others - mean) * scale @ weights


def _halves(is_simulated: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Return weights of the samples with which each set has one half."""
    simulated = np.count_nonzero(is_simulated)
    return np.where(is_simulated, 0.5 / simulated, 0.5 / (len(is_simulated) - simulated))


def accuracy(samples: Samples) -> float:
    """Return the mean of the two sets' shares that are put right."""
    return float(_halves(samples.is_simulated) @ right(samples))


def interval(samples: Samples, is_right: Right) -> tuple[float, float]:
    """Return the interval of 95 % of the accuracy; see the definitions above."""
    share = _halves(samples.is_simulated)
    mean = float(share @ is_right)
    _, number = np.unique(samples.group, return_inverse=True)
    apart = np.bincount(number, share * (is_right - mean))
    groups = len(apart)
    variance = groups / (groups - 1) * float(apart @ apart)
    # without any spread, a group counts as one sample
    worth = mean * (1 - mean) / variance if variance > 1e-12 else groups
    # decisions by what was learnt from nearly the same samples are not independent: two are one
    count = min(max(worth, 1.0), len(is_right) / 2)
    centre, over = mean + _Z95**2 / (2 * count), 1 + _Z95**2 / count
    half = _Z95 * np.sqrt(mean * (1 - mean) / count + (_Z95 / (2 * count)) ** 2)
    return max(0.0, float((centre - half) / over)), min(1.0, float((centre + half) / over))


def telling(samples: Samples, about: Sequence[Feature]) -> list[dict[str, Any]]:
    """Return the features whose means differ most, one of a family, ready for JSON."""
    sets = [samples.values[samples.is_simulated == which] for which in (False, True)]
    means = [values.mean(0) for values in sets]
    deviation = np.sqrt(sum(values.var(0) for values in sets) / 2)
    apart = means[1] - means[0]
    # what does not vary within a set, but between them, comes first
    d = np.divide(apart, deviation, out=np.full_like(apart, np.inf), where=deviation > 0)
    sure = np.abs(apart) > np.maximum(_SURE * _standard_error(samples), 1e-9)
    best: dict[str, int] = {}
    for number in np.argsort(-np.abs(d), kind="stable"):
        if sure[number]:
            best.setdefault(about[number].family, int(number))
    return [
        {
            "feature": about[k].words,
            "measured": about[k].natural(means[0][k]),
            "simulated": about[k].natural(means[1][k]),
            "standard_deviations": float(d[k]) if np.isfinite(d[k]) else None,
            "text": f"{about[k].words}: {about[k].written(about[k].natural(means[1][k]))} against"
            f" {about[k].written(about[k].natural(means[0][k]))}",
        }
        for k in [*best.values()][:_MOST_TOLD]
    ]


def _standard_error(samples: Samples) -> Features:
    """Return that of the difference of the two means, (features,): within groups if it can be."""
    sets = [samples.is_simulated == which for which in (False, True)]
    inside = [samples.group[one] for one in sets]
    groups = np.unique(samples.group)
    if all(np.isin(groups, one).all() for one in inside):
        means = [
            np.array([samples.values[one & (samples.group == group)].mean(0) for group in groups])
            for one in sets
        ]
        variance = (means[1] - means[0]).var(0, ddof=1) / len(groups)
    else:
        squares = [samples.values[one].var(0, ddof=1) / np.count_nonzero(one) for one in sets]
        variance = squares[0] + squares[1]
    error: Features = np.sqrt(variance)
    return error


def report(
    samples: Samples, about: Sequence[Feature], definition: str, floor: Floor
) -> dict[str, Any]:
    """Return accuracy, interval, floor and what tells most, ready for JSON."""
    is_right = right(samples)
    return {
        "definition": definition,
        "value": float(_halves(samples.is_simulated) @ is_right),
        "interval_95": list(interval(samples, is_right)),
        "floor": floor,
        "why_none": None,
        "samples": [int(np.count_nonzero(samples.is_simulated == one)) for one in (False, True)],
        "groups": len(np.unique(samples.group)),
        "differences": {"definition": FEATURES, "largest": telling(samples, about)},
    }


# ---- Sets of recordings.


def between_halves(values: Features) -> float:
    """Return the accuracy between two halves of one set of samples, drawn by chance.

    The draws are of a fixed seed: the same samples give the same floor.
    """
    draw, half = np.random.default_rng(0), len(values) // 2
    found = []
    for _ in range(SPLITS):
        chosen = draw.permutation(len(values))[: 2 * half]
        is_second = np.arange(2 * half) >= half
        group = np.arange(2 * half) % half
        found.append(accuracy(Samples(values[chosen], is_second, group)))
    return float(np.mean(found))


# ---- Two recordings, cut into windows of time.


def of_windows(streams: Sequence[Events], windows: Windows, size: tuple[int, int]) -> Samples | str:
    """Return samples of windows of two streams, or why there are none.

    The windows share the time of `windows` evenly, and hold some 100 events at least on average.
    """
    start, stop = windows.start, windows.stop
    parts = [cut(events, start, stop) for events in streams]
    least = min(map(len, parts))
    a_block = min(least // (_EVENTS_A_WINDOW * _BLOCKS), _MOST_A_BLOCK, (stop - start) // _BLOCKS)
    if a_block < _LEAST_A_BLOCK:
        count = _LEAST_A_BLOCK * _BLOCKS
        return (
            f"{least:,} events in {(stop - start) / 1e6:g} s are too few: {count} windows of"
            f" {_EVENTS_A_WINDOW} events need {count * _EVENTS_A_WINDOW:,} of each recording;"
            " compare sets of recordings instead"
        )
    number = _BLOCKS * a_block
    edges = [start + (stop - start) * k // number for k in range(number + 1)]
    values = [
        features(cut(events, *edges[k : k + 2]), size, (edges[k], edges[k + 1]), _WINDOW_PARTS)
        for events in parts
        for k in range(number)
    ]
    place = np.tile(np.arange(number), 2)
    return Samples(np.array(values), np.arange(2 * number) >= number, place // a_block, place)


def in_windows(
    streams: Sequence[Events],
    windows: Windows,
    size: tuple[int, int],
    seeds: Sequence[Events] | None,
) -> dict[str, Any]:
    """Return what :func:`report` does for two streams; value None and the reason if there is none.

    `seeds` are two simulations, for their floor.
    """
    samples = of_windows(streams, windows, size)
    floor: Floor = {"half_split": None, "two_seeds": None}
    if isinstance(samples, str):
        none = dict.fromkeys(("value", "interval_95", "samples", "groups", "differences"))
        return {"definition": WINDOWS, **none, "floor": floor, "why_none": samples}
    coin, halves = np.random.default_rng(0), []
    for _ in range(SPLITS):
        heads = coin.random(len(streams[0])) < 0.5
        split = of_windows((streams[0][heads], streams[0][~heads]), windows, size)
        halves += [] if isinstance(split, str) else [accuracy(split)]
    floor["half_split"] = float(np.mean(halves)) if halves else None
    between = "" if seeds is None else of_windows(seeds, windows, size)
    floor["two_seeds"] = None if isinstance(between, str) else accuracy(between)
    return report(samples, described(size, _WINDOW_PARTS), WINDOWS, floor)
