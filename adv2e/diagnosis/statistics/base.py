"""What a group of marker statistics is, and counting by part of the data."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from adv2e.diagnosis.data import splits as parts
from adv2e.diagnosis.data.scene import Placed

Raw = NDArray[np.float64]
"""Sums that add up over the parts of the data: (numbers,), or (parts, numbers)."""


@dataclass(frozen=True)
class Entry:
    """One marker statistic.

    Attributes
    ----------
    name : str
    meaning : str
        What it measures, in a sentence.
    is_number : bool
        A number, of events or pixels, which is compared as :func:`stabilised` puts it.
    """

    name: str
    meaning: str
    is_number: bool = False

    def plain(self, value: float) -> float:
        """Return the statistic as its meaning says, not as it is compared."""
        return max(0.25 * value * value - 0.375, 0.0) if self.is_number else value


class Group(Protocol):
    """Statistics that are counted together."""

    title: str

    @property
    def least(self) -> float | Sequence[float]:
        """Deviation below which no statistic of the group, or each of them, counts as known."""

    @property
    def entries(self) -> Sequence[Entry]:
        """The statistics, in order."""

    def count(self, placed: Placed) -> Raw:
        """Return the sums of a stream, (parts, numbers)."""

    def values(self, raw: Raw) -> NDArray[np.float64]:
        """Return the statistics of sums that were added over parts, (entries,)."""


class Numbers:
    """A group of numbers of events, compared as :func:`stabilised` puts them."""

    def values(self, raw: Raw) -> NDArray[np.float64]:
        """Return the statistics of sums that were added over parts, (entries,)."""
        return stabilised(raw)


def counts(
    part: NDArray[np.int64], cell: NDArray[Any], cells: int, weight: NDArray[Any] | None = None
) -> Raw:
    """Return how many events, or how much `weight`, each cell has in each part, (parts, cells)."""
    return (
        np.bincount(part * cells + cell, weight, minlength=parts.COUNT * cells)
        .astype(np.float64)
        .reshape(parts.COUNT, cells)
    )


def stabilised(number: Raw) -> NDArray[np.float64]:
    """Return numbers of events on a scale on which a Poisson number deviates by 1 everywhere."""
    return np.asarray(2.0 * np.sqrt(np.maximum(number, 0.0) + 0.375))


def excess(number: Raw, mean: Raw) -> NDArray[np.float64]:
    """Return what numbers of events are above their mean, in deviations of chance.

    It is zero where nothing is expected and nothing came.
    """
    return np.asarray((number - mean) / np.sqrt(mean + 1.0))


def share(part: Raw, whole: Raw | float) -> NDArray[np.float64]:
    """Return part of whole, zero where there is nothing."""
    return np.asarray(part / np.maximum(whole, 1.0))


POLARITIES = ("OFF", "ON")
SPEED_NAMES = ("still", "slow", "moving", "fast")
LIGHT_NAMES = ("dark", "medium", "bright")
