"""Noise of a sensor at three light levels, as intervals between events of each pixel.

Files ``noise_{pos,neg}_{0.1lux,161lux,3klux}.npz`` of github.com/neuromorphicsystems/IEBCS
(D. Joubert et al., Frontiers in Neuroscience 15, 2021, doi:10.3389/fnins.2021.702765): of each
pixel, how many intervals between events of one polarity were below each frequency.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from adv2e.errors import DataError

Array = NDArray[np.float64]

LEVELS = {"0.1lux": 0.1, "161lux": 161.0, "3klux": 3000.0}
POLARITIES = {"on": "pos", "off": "neg"}
MANY = 20
"""Intervals of a pixel that fill the recording, so that their sum is its length."""


@dataclass(frozen=True)
class Level:
    """One light level: (pixels,) intervals of ON and OFF events, and the length of the recording.

    The length is not stated with the data; it is what the intervals of busy pixels add up to.
    """

    lux: float
    intervals: dict[str, Array]
    duration_s: float
    by_frequency: dict[str, Array]
    """Intervals of all pixels, ON and OFF, by frequency (`interval_bins`)."""

    @property
    def pixels(self) -> int:
        """How many pixels were watched."""
        return self.intervals["on"].size

    def typical_hz(self, polarity: str) -> float:
        """Return the rate of Poisson events at which as many pixels have an interval.

        A pixel without an interval had one event or none.
        """
        share = float((self.intervals[polarity] > 0).mean())
        if share == 0.0:
            return 0.0
        low, high = 0.0, 50.0
        for _ in range(60):
            middle = 0.5 * (low + high)
            low, high = (
                (middle, high)
                if -np.expm1(-middle) - middle * np.exp(-middle) < share
                else (low, middle)
            )
        return 0.5 * (low + high) / self.duration_s

    def median_hz(self, polarity: str) -> float:
        """Return the rate of the median pixel; from `typical_hz` where it has no interval."""
        middle = float(np.median(self.intervals[polarity]))
        return (middle + 1.0) / self.duration_s if middle > 0 else self.typical_hz(polarity)

    def mean_hz(self, polarity: str) -> float:
        """Return the mean rate; pixels without an interval count as typical ones."""
        counts = self.intervals[polarity]
        expected = self.typical_hz(polarity) * self.duration_s
        rest = expected / (1.0 + expected)  # events of a pixel that had one or none
        return float(np.where(counts > 0, counts + 1.0, rest).mean()) / self.duration_s

    def bounds_hz(self, polarity: str) -> tuple[float, float]:
        """Return the mean rate if pixels without an interval had no event, and if they had one."""
        counts = self.intervals[polarity]
        low = np.where(counts > 0, counts + 1.0, 0.0).mean()
        high = (counts + 1.0).mean()
        return float(low) / self.duration_s, float(high) / self.duration_s


def interval_bins() -> Array:
    """Return the borders of the frequencies of the files [Hz]."""
    borders: Array = np.outer(10.0 ** np.arange(-3, 5), np.arange(1, 10)).ravel()
    return borders


def read_levels(folder: Path) -> list[Level]:
    """Return the three light levels."""
    try:
        bins = np.loadtxt(folder / "frequency_bins_hz.txt")
        return [_level(folder, name, lux, bins) for name, lux in LEVELS.items()]
    except (OSError, KeyError, ValueError) as error:
        raise DataError(f"{folder}: is no folder of IEBCS noise files: {error}") from None


def _level(folder: Path, name: str, lux: float, bins: Array) -> Level:
    intervals, lengths, by_frequency = {}, [], {}
    period = 1.0 / np.sqrt(bins[:-1] * bins[1:])  # the last bin is unused
    for polarity, short in POLARITIES.items():
        with np.load(folder / f"noise_{short}_{name}.npz") as file:
            below = file["cdf"].astype(np.float64)
        counts = np.diff(below.reshape(-1, below.shape[-1])[:, :-1], axis=1, prepend=0.0)
        intervals[polarity] = counts.sum(axis=1)
        by_frequency[polarity] = counts.sum(axis=0)
        lengths.append((counts @ period)[intervals[polarity] >= MANY])
    return Level(lux, intervals, float(np.median(np.concatenate(lengths))), by_frequency)
