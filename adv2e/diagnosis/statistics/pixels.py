"""Fixed-pattern statistics: spread over the pixels, silent and hot pixels, rows, columns."""

from __future__ import annotations

import math

import numpy as np

from adv2e.diagnosis.data import splits
from adv2e.diagnosis.data.scene import Placed, Scene
from adv2e.diagnosis.statistics.groups import (
    COVARIANCE,
    SURPLUS,
    Array,
    Entry,
    Group,
    counted,
    excess,
    exponential,
    stabilised,
)

_HALVES = 2
_QUIET = 1e-3
"""Variance that is added before a logarithm is taken."""


def _spread(logarithm: float) -> float:
    return math.sqrt(max(exponential(logarithm) - _QUIET, 0.0))


def _covariance(name: str, of: str) -> Entry:
    meaning = f"covariance over the pixels: {of}, in squares of the standard deviation of chance"
    return Entry(name, meaning, COVARIANCE)


def _loudest(name: str, which: str) -> Entry:
    meaning = f"surplus of events in {which}, in standard deviations (sd) of chance"
    return Entry(name, meaning, SURPLUS, lambda logarithm: exponential(logarithm) - 1.0)


def _gradient(name: str, to: str) -> Entry:
    meaning = f"rise of the surplus of events of a pixel from the middle of the sensor to {to}"
    return Entry(name, f"{meaning}, in standard deviations (sd) of chance", SURPLUS)


_SILENT = Entry(
    "silent pixels", "number of pixels that should have fired and did not", "pixels", counted
)
_ENTRIES = [
    *(
        Entry(
            f"spread of {polarity}",
            f"mean square of the surplus of {polarity} events of a pixel over what is expected (1"
            " by chance alone), in squares of the standard deviation of chance",
            COVARIANCE,
        )
        for polarity in ("ON", "OFF")
    ),
    _covariance("ON with OFF", "surplus of ON events with surplus of OFF events of the same pixel"),
    _covariance(
        "ON persists", "surplus of ON events in the first half of the time with the second"
    ),
    _covariance(
        "OFF persists", "surplus of OFF events in the first half of the time with the second"
    ),
    _covariance(
        "ON becomes OFF",
        "surplus of ON events in one half of the time with that of OFF events in the other half",
    ),
    _loudest("loudest pixels", "the busiest hundredth of the pixels"),
    _loudest("loudest pixel", "the busiest pixel"),
    _SILENT,
    *(
        Entry(
            f"{line}s",
            f"spread of the mean surplus of events of a {line} from {line} to {line}, in standard"
            " deviations (sd) of chance",
            SURPLUS,
            _spread,
        )
        for line in ("row", "column")
    ),
    _covariance("beside", "surplus of events of a pixel with that of the pixel beside it"),
    _covariance("below", "surplus of events of a pixel with that of the pixel below it"),
    _gradient("towards the corners", "its nearer borders, by the square of the distance"),
    _gradient("left to right", "its right border"),
    _gradient("top to bottom", "its bottom"),
]


def count_pixels(placed: Placed, scene: Scene) -> Array:
    """Return events by half of the time, polarity and pixel, then a column for each part.

    The latter is so that a sum over parts knows what to expect.  (parts, numbers)
    """
    stream = placed.stream
    half = np.minimum(placed.segment // (scene.split.segments // _HALVES), _HALVES - 1)
    cells = _HALVES * 2 * scene.pixels
    cell = ((placed.part * _HALVES + half) * 2 + stream.on) * scene.pixels + stream.pixel
    number = np.bincount(cell, minlength=splits.COUNT * cells)
    return np.concatenate([number.reshape(splits.COUNT, cells), np.eye(splits.COUNT)], axis=1)


def pixels(scene: Scene, expected: Array) -> Group:
    """Return statistics of the events of each pixel about the number that the model expects.

    `expected`: (parts, numbers), mean of :func:`count_pixels` over its simulations.
    """
    y, x = np.mgrid[-1.0 : 1.0 : scene.height * 1j, -1.0 : 1.0 : scene.width * 1j]
    ways = [_centred(way) for way in (x * x + y * y, x, y)]
    # mostly there is no silent pixel, so that simulations do not tell how rare one is
    least = [0.6 if entry is _SILENT else 0.01 for entry in _ENTRIES]

    def values(raw: Array) -> Array:
        number, which = raw[: -splits.COUNT], raw[-splits.COUNT :]
        shape = (_HALVES, 2, scene.height, scene.width)
        n = number.reshape(shape)
        mu = (which @ expected)[: -splits.COUNT].reshape(shape)
        (off_1, on_1), (off_2, on_2) = excess(n, mu)
        off, on = excess(n.sum(axis=0), mu.sum(axis=0))
        total_n, total_mu = n.sum(axis=0).sum(axis=0), mu.sum(axis=0).sum(axis=0)
        both = excess(total_n, total_mu)
        bounded, on_bounded, off_bounded = _bounded(both), _bounded(on), _bounded(off)
        on_1, on_2, off_1, off_2 = (_bounded(one) for one in (on_1, on_2, off_1, off_2))
        silent = (total_n == 0) & (total_mu > 4.0)
        ordered = np.sort(both, axis=None)
        top = max(1, both.size // 100)
        return np.array(
            [
                np.mean(np.minimum(on * on, 100.0)),
                np.mean(np.minimum(off * off, 100.0)),
                _product(on_bounded, off_bounded),
                _product(on_1, on_2),
                _product(off_1, off_2),
                _product(on_1, off_2) + _product(off_1, on_2),
                np.log1p(max(0.0, float(ordered[-top:].mean()))),
                np.log1p(max(0.0, float(ordered[-1]))),
                float(stabilised(silent.sum())),
                float(np.log(np.var(both.mean(axis=1)) + _QUIET)),
                float(np.log(np.var(both.mean(axis=0)) + _QUIET)),
                _product(bounded[:, 1:], bounded[:, :-1]),
                _product(bounded[1:], bounded[:-1]),
                *(_slope(bounded, *way) for way in ways),
            ]
        )

    return Group(
        "from pixel to pixel", least, _ENTRIES, lambda placed: count_pixels(placed, scene), values
    )


def _bounded(values: Array) -> Array:
    return np.asarray(np.minimum(np.maximum(values, -10.0), 10.0))  # in half the time of a clip


def _product(a: Array, b: Array) -> float:
    if not a.size:  # nothing is beside the pixels of a single column
        return 0.0
    return float(np.mean(a * b))


def _centred(over: Array) -> tuple[Array, float]:
    """Return values less their mean, and the sum of the squares of those."""
    centred = over - over.mean()
    return centred, float(np.sum(centred * centred))


def _slope(values: Array, centred: Array, spread: float) -> float:
    if spread < 1e-9:  # all pixels are as far to a side as any other
        return 0.0
    return float(np.sum(values * centred)) / spread
