"""Groups of summary statistics, and counts of events by part of the data."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.diagnosis.data import splits
from adv2e.diagnosis.data.scene import Placed
from adv2e.reports.result import Kind

Array = NDArray[np.float64]

POLARITIES = ("OFF", "ON")
COVARIANCE, SURPLUS = "sd²", "sd"
"""Units of what is counted in standard deviations of chance."""


@dataclass(frozen=True)
class Entry:
    """One summary statistic.

    Attributes
    ----------
    meaning : str
        What it measures, in a sentence.
    unit : str
        Of what its meaning says; of a share or a ratio: of what to what.
    plain : callable
        Takes the statistic as it is compared, returns it as its meaning says.
    """

    name: str
    meaning: str
    unit: str
    plain: Callable[[float], float] = float


def stabilised(number: Array) -> Array:
    """Return numbers of events on a scale on which a Poisson number deviates by 1 everywhere."""
    return np.asarray(2.0 * np.sqrt(np.maximum(number, 0.0) + 0.375))


def counted(value: float) -> float:
    """Return the inverse of :func:`stabilised`: the number of events."""
    return max(0.25 * value * value - 0.375, 0.0)


def exponential(value: float) -> float:
    return math.exp(min(value, 700.0))


_RARE = stabilised(np.array(2.0))
"""Numbers of events below which hardly vary, on that scale: most simulations have none."""


def least_deviations(entries: Sequence[Entry], least: Array, mean: Array) -> Array:
    """Return the deviation below which each statistic does not count as known, (statistics,).

    That is `least`, but of numbers that are small on the `mean` of simulations it is that of a
    Poisson number.  Where none ever came, one or two events stand for themselves, as a pixel may
    have a dead time a little shorter than the others'; only several are more than chance.
    """
    is_rare = np.array([entry.plain is counted for entry in entries]) & (mean < _RARE)
    return np.asarray(np.where(is_rare, np.maximum(least, 1.0), least))


@dataclass(frozen=True)
class Group:
    """Statistics that are counted together.

    Attributes
    ----------
    least : float, or a sequence of one for each statistic
        Deviation below which none counts as known.
    count : callable
        Takes a stream, returns sums that add up over the parts of the data, (parts, numbers).
    values : callable
        Takes the sums of a part, or of several added, and returns the statistics, (entries,).
    kind : str
        What reports sort it by.
    """

    title: str
    least: float | Sequence[float]
    entries: list[Entry]
    count: Callable[[Placed], Array]
    values: Callable[[Array], Array] = stabilised
    kind: Kind = "other"


def numbers(named: Iterable[tuple[str, str]], unit: str = "events") -> list[Entry]:
    return [Entry(name, f"number of {meaning}", unit, counted) for name, meaning in named]


def counts(
    part: NDArray[np.int64], cell: NDArray[Any], cells: int, weight: NDArray[Any] | None = None
) -> Array:
    """Return the number of events, or sum of `weight`, by part and cell, (parts, cells)."""
    number = np.bincount(part * cells + cell, weight, minlength=splits.COUNT * cells)
    return number.astype(np.float64).reshape(splits.COUNT, cells)


def excess(number: Array, mean: Array) -> Array:
    """Return the excess of numbers of events over their mean, in deviations of chance.

    It is zero where nothing is expected and nothing came.
    """
    return np.asarray((number - mean) / np.sqrt(mean + 1.0))


def share(part: Array, whole: Array | float) -> Array:
    """Return part of whole, zero where there is nothing."""
    return np.asarray(part / np.maximum(whole, 1.0))
