r"""Rates of noise events of pixels at rest, against light.

With l = DN/255

.. math:: R_{leak} = R_0 + R_1 l, \qquad R_{shot} = R_s\,(1 - 0.75\,l)

shot noise being half ON, half OFF; leak events are ON.  Photoreceptor noise of standard deviation
sigma behind the first pole f_1, whose corner follows the light, is

.. math:: \sigma \sqrt{\frac{f_2}{f_1 + f_2}}

behind the second pole f_2, whose corner does not.  How often it crosses the thresholds is told in
:mod:`adv2e.diagnosis.tables.threshold_noise`; here its rates are interpolated between thresholds,
corners and dead times at which they are kept (`Law`).

Every event takes the reference anew, so that leak, which needs a time 1/R_leak without another
event, becomes rarer beside shot noise of rate lambda:

.. math:: \frac{\lambda}{e^{\lambda/R_{leak}} - 1}

Leak and photoreceptor noise are one process.  Shot noise beside both is added to it.

Pixels differ: by their thresholds (normal), and some are hot, with rates of their own (log-normal),
ON or OFF.  Means and medians are over all of them.  In the bright, the few pixels with the
lowest thresholds have most of the events, and those whose thresholds are equal have more than
others: pixels are taken down to 4.5 standard deviations, and closely where both are equal.

References
----------
.. [1] Y. Nozaki, T. Delbruck, "Temperature and parasitic photocurrent effects in dynamic vision
   sensors", IEEE TED 64(8), 2017, doi:10.1109/TED.2017.2717848.
.. [2] R. Graca, T. Delbruck, "Unraveling the paradox of intensity-dependent DVS pixel noise",
   International Image Sensor Workshop 2021, arXiv:2109.08640.
.. [3] E. B. Wilson, M. M. Hilferty, "The distribution of chi-square", PNAS 17(12), 1931,
   doi:10.1073/pnas.17.12.684.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from adv2e.diagnosis.tables.threshold_noise import HIGHEST, cubic, event_rates
from adv2e.effects.hooks import LONGEST_US
from adv2e.effects.pixel.shot_noise import FALL_AT_WHITE
from adv2e.effects.pixel.thresholds import FLOOR
from adv2e.kernel.photoreceptor.exits import SAMPLING_SHIFT

Array = NDArray[np.float64]

_HOT = np.linspace(-3.5, 3.5, 15)
"""Deviations at which the rates of hot pixels are taken."""
_LEVELS = np.linspace(-4.5, 2.7, 9)
"""The same of the mean of both thresholds: few pixels with low ones may have most of the events."""
_APART_STEP, _APART_REACH = 0.8, 4.0
"""Of the difference between them: largest step, and how far pixels are taken."""
_ALIKE = 0.01
"""Share of the threshold by which both may differ before their equality has no more effect."""
_FEWEST = 1e-8
"""Share of the pixels below which a kind of them is left out."""


@dataclass(frozen=True)
class NoisySources:
    """Sources of noise events (background activity) in a pixel; rates in Hz, 0: none."""

    leak_hz: float = 0.0
    photo_leak_hz: float = 0.0
    shot_hz: float = 0.0
    rms: float = 0.0
    """Photoreceptor noise [ln]."""
    noise_step: float = 0.0
    """Sampling step of that noise behind one pole, in correlation times at white; 0: none."""
    cutoff_hz: float = 0.0
    dark_cutoff_hz: float = 0.0
    follower_hz: float = 0.0
    """Corner of the second pole; 0: none."""
    on: float = 0.2
    off: float = 0.2
    mismatch: float = 0.0
    """Standard deviation of the thresholds over the pixels [ln]."""
    dead_time_s: float = 0.0
    hot_fraction: float = 0.0
    hot_hz: float = 0.0
    """Median rate of the hot pixels."""
    hot_spread: float = 0.0
    """Standard deviation of log10 of it."""
    hot_off: float = 0.0
    """Share of them whose events are OFF."""


@dataclass(frozen=True)
class Rates:
    """Rates against light, (n,) or, of each kind of pixel, (n, kinds) [Hz]."""

    weights: Array
    """Share of the pixels that is of each kind, hot ones left out, (kinds,)."""
    leak_of: Array
    on_of: Array
    """ON events by noise."""
    off_of: Array
    hot_fraction: float
    hot_hz: Array
    """Events that hot pixels have beside the others', at deviations of `_HOT`."""
    hot_off: float
    """Share of the hot pixels whose events are OFF, else ON."""

    def median(self, on: bool) -> Array:
        """Return the rate of ON or OFF events, median over the pixels that are not hot."""
        leak, noise = self._causes(on)
        return _typical(leak + noise, self.weights)

    def mean(self, on: bool) -> Array:
        """Return the rate of ON or OFF events, mean over all pixels."""
        leak, noise = self._causes(on)
        base: Array = (leak + noise) @ self.weights
        return base + self._hot(on) * float(self.hot_hz @ _density(_HOT))

    def _causes(self, on: bool) -> tuple[Array, Array]:
        """Return rates by leak and by noise."""
        return (self.leak_of, self.on_of) if on else (0.0 * self.leak_of, self.off_of)

    def _hot(self, on: bool) -> float:
        """Return the share of all pixels that is hot and has such events."""
        return self.hot_fraction * (1.0 - self.hot_off if on else self.hot_off)

    def at(self, lights: NDArray[np.int64]) -> Rates:
        parts = (self.leak_of[lights], self.on_of[lights], self.off_of[lights])
        return Rates(self.weights, *parts, self.hot_fraction, self.hot_hz, self.hot_off)

    def share_having(self, number: int, seconds: Array, on: bool) -> Array:
        """Return the share of all pixels that have so many events or more in (n,) seconds."""
        time = seconds[:, None]
        leak, noise = self._causes(on)
        usual = ((leak + noise) @ self.weights)[:, None]
        noise, leak = noise * time, leak * time
        whole = np.floor(leak)  # leak is regular: one number of events, or one more
        more = leak - whole
        share = (1.0 - more) * at_least(number - whole, noise)
        share = (share + more * at_least(number - whole - 1.0, noise)) @ self.weights
        if self._hot(on) > 0.0:
            hot = at_least(number, (usual + self.hot_hz) * time) @ _density(_HOT)
            share = (1.0 - self._hot(on)) * share + self._hot(on) * hot
        return np.asarray(share, dtype=np.float64)


def noise_rates(sources: NoisySources, light: Array) -> Rates:
    """Return the rates at `light`, (n,) in shares of white."""
    shot = sources.shot_hz * np.maximum(1.0 - FALL_AT_WHITE * light, 0.0)
    leak = sources.leak_hz + sources.photo_leak_hz * light
    weights, on, off = _kinds(sources)
    noise = np.repeat(shot[:, None], weights.size, axis=1)
    if sources.rms > 0.0:
        laws = _laws(sources, light, leak)
        by_on, by_off = np.stack([law.rates(on, off) for law in laws], axis=1)
        both = by_on + by_off
        by_leak = np.minimum(_rare(leak[:, None], both - leak[:, None]), by_on)
        by_on = by_on - by_leak
        busy = 1.0 / (1.0 + noise * sources.dead_time_s)
    else:
        by_on, by_off = np.zeros_like(noise), np.zeros_like(noise)
        by_leak = _rare(leak[:, None], noise)
        busy = 1.0 / (1.0 + (noise + by_leak) * sources.dead_time_s)
    by_on, by_off = by_on + 0.5 * noise, by_off + 0.5 * noise
    by_leak, by_on, by_off = by_leak * busy, by_on * busy, by_off * busy
    hot = sources.hot_hz * 10.0 ** (sources.hot_spread * _HOT)
    return Rates(weights, by_leak, by_on, by_off, sources.hot_fraction, hot, sources.hot_off)


def _kinds(sources: NoisySources) -> tuple[Array, Array, Array]:
    """Return the shares of the pixels of each kind, and their thresholds, (kinds,) each."""
    if sources.mismatch <= 0.0 or sources.rms <= 0.0:
        return np.ones(1), np.array([sources.on]), np.array([sources.off])
    spread = sources.mismatch * math.sqrt(2.0)  # of the difference; half of it: of the mean
    reach, fine = _APART_REACH * spread, _ALIKE * min(sources.on, sources.off)
    middle = sources.off - sources.on
    ruler = Ruler(_APART_STEP * spread, fine, abs(middle) + reach + fine)
    apart, share = ruler.marks(middle)
    share *= np.exp(-0.5 * ((apart - middle) / spread) ** 2)
    weights = np.outer(_density(_LEVELS), share / share.sum())
    level = 0.5 * (sources.on + sources.off + spread * _LEVELS[:, None])
    kept = weights >= _FEWEST
    on = np.maximum(level - 0.5 * apart, FLOOR)[kept]
    off = np.maximum(level + 0.5 * apart, FLOOR)[kept]
    return weights[kept] / weights[kept].sum(), on, off


class Ruler:
    """Marks along the difference of the thresholds, close to each other where both are equal.

    There rates have a peak: every event leads to where the last one began (threshold_noise).

    Parameters
    ----------
    step : float
        Largest distance of marks.
    fine : float
        Distance of those about 0.
    reach : float
        Difference of the thresholds up to which there are marks.
    """

    def __init__(self, step: float, fine: float, reach: float) -> None:
        self._step, self._fine = step, fine
        self._along = reach * np.sinh(np.linspace(-8.0, 8.0, 2001)) / np.sinh(8.0)

    def place(self, apart: Array) -> Array:
        """Return the mark of a threshold difference; 0 where both are equal."""
        return np.asarray(apart / self._step + np.arcsinh(apart / self._fine))

    def marks(self, middle: float = 0.0) -> tuple[Array, Array]:
        """Return differences at marks, one of them `middle`, and distances there, (marks,) each."""
        first, last = self.place(self._along[[0, -1]])
        at = float(self.place(np.array(middle)))
        numbers = np.arange(math.ceil(first - at), math.floor(last - at) + 1)
        found = np.interp(at + numbers, self.place(self._along), self._along)
        found[numbers == 0] = middle
        return found, 1.0 / (1.0 / self._step + 1.0 / np.hypot(found, self._fine))


def _density(places: Array) -> Array:
    weights = np.exp(-0.5 * places**2)
    return np.asarray(weights / weights.sum(), dtype=np.float64)


def _typical(values: Array, weights: Array) -> Array:
    """Return the median over kinds, (n,), of values (n, kinds)."""
    if weights.size == 1:
        return np.asarray(values[:, 0], dtype=np.float64)
    order = np.argsort(values, axis=1)
    ranked = np.take_along_axis(values, order, axis=1)
    below = np.cumsum(weights[order], axis=1) - 0.5 * weights[order]
    return np.array([np.interp(0.5, b, v) for b, v in zip(below, ranked, strict=True)])


def _rare(leak: Array, noise: Array) -> Array:
    """Return the rate of leak events beside noise events, each of which resets the leak [Hz]."""
    leak, noise = np.broadcast_arrays(leak, np.maximum(noise, 0.0))
    left = np.array(leak, dtype=np.float64)
    both = (leak > 0.0) & (noise > 1e-12 * leak)
    left[both] = noise[both] / np.expm1(np.minimum(noise[both] / leak[both], 500.0))
    return left


def at_least(number: Array | float, mean: Array) -> Array:
    """Return the probability of so many Poisson events or more; of many by normal numbers [3]."""
    number = np.broadcast_to(np.asarray(number, np.float64), np.shape(mean))
    mean = np.maximum(mean, 1e-12)
    few = np.clip(number, 1.0, _FEW)
    spread = 1.0 / (9.0 * np.maximum(number, 1.0))
    far = (np.cbrt(mean / np.maximum(number, 1.0)) - (1.0 - spread)) / np.sqrt(spread)
    terms = few[..., None] + np.arange(24.0)
    logs = terms * np.log(mean)[..., None] - mean[..., None] - _LOG_FACTORIALS[terms.astype(int)]
    below = np.arange(_FEW)
    logs_below = below * np.log(mean)[..., None] - mean[..., None] - _LOG_FACTORIALS[below]
    fewer = (np.exp(logs_below) * (below < few[..., None])).sum(axis=-1)
    tail = np.where(mean < few, np.exp(logs).sum(axis=-1), 1.0 - fewer)
    found = np.where(number > _FEW, np.interp(far, _PLACES, _BELOW), np.clip(tail, 0.0, 1.0))
    return np.asarray(np.where(number <= 0.0, 1.0, found), dtype=np.float64)


_FEW = 8
_LOG_FACTORIALS = np.cumsum(np.log(np.maximum(np.arange(64), 1)))
_STEP = 0.01
_PLACES = np.arange(-9.0, 9.0 + _STEP, _STEP)
_BELOW = np.cumsum(np.exp(-0.5 * (_PLACES - 0.5 * _STEP) ** 2)) * _STEP / math.sqrt(2.0 * math.pi)


class Law:
    """Rates of ON and OFF events by noise and leak at one light, against both thresholds.

    Parameters
    ----------
    sigma : float
        Standard deviation of the noise behind the poles [ln].
    slow : float
        Corner of the slower pole [rad/s].
    ratio : float
        Over that of the faster one; 0: there is but one.
    shift : float
        How much farther levels are, in standard deviations, as the noise is sampled.
    """

    def __init__(
        self,
        sigma: float,
        slow: float,
        ratio: float,
        dead_time_s: float,
        leak_hz: float,
        shift: float,
    ) -> None:
        self._sigma, self._slow, self._shift = sigma, slow, shift
        kept = (
            _kept(ratio, _RATIOS),
            _kept(max(slow * dead_time_s, 1e-12), _DEAD_TIMES),
            _kept(leak_hz / slow, _LEAKS),
        )
        self._logs = np.zeros((2, _COUNT, _APART.size))
        for first, second, third in itertools.product(*kept):
            share = first[1] * second[1] * third[1]
            self._logs += share * _tabulated(first[0], second[0], third[0])

    def rates(self, on: Array, off: Array) -> Array:
        """Return the rates [Hz], (2, ...), of pixels with these thresholds [ln]."""
        on, off = on / self._sigma + self._shift, off / self._sigma + self._shift
        lower = np.clip((np.minimum(on, off) - _LEAST) / _GRID, 0.0, _COUNT - 1.0)
        apart = np.clip(_RULER.place(off - on) + _APART.size // 2, 0.0, _APART.size - 1.0)
        first, weights = cubic(lower, _COUNT)
        second, apart_weights = cubic(apart, _APART.size)
        logs = np.zeros((2, *np.shape(on)))
        for i, p in enumerate(weights):
            for j, q in enumerate(apart_weights):
                logs += p * q * self._logs[:, first + i, second + j]
        return np.asarray(self._slow * np.exp(logs), dtype=np.float64)


_LEAST, _GRID = 0.2, 0.78
"""Least lower threshold that is kept, and step."""
_COUNT = 1 + round((HIGHEST - _LEAST) / _GRID)
_RULER = Ruler(1.5, 0.05, HIGHEST)
_APART = _RULER.marks()[0]
"""Differences between OFF and ON threshold at which rates are kept."""
_RATIOS, _DEAD_TIMES, _LEAKS = (2.0, -12, 0), (2.0, -8, 6), (8.0, -6, -1)
"""Base, and least and largest exponent, of what is kept: ratios of corners; dead times and leaks in
units of the slower pole."""


@lru_cache(maxsize=2048)
def _tabulated(ratio: float, dead_time: float, leak: float) -> Array:
    """Return ln of ON and OFF rates against the lower threshold and what OFF is larger by.

    (2, _COUNT, marks).
    """
    found = [
        [
            event_rates(
                min(low + max(-apart, 0.0), HIGHEST),
                min(low + max(apart, 0.0), HIGHEST),
                dead_time,
                ratio,
                leak,
            )
            for apart in _APART.tolist()
        ]
        for low in (_LEAST + _GRID * np.arange(_COUNT)).tolist()
    ]
    rates = np.array(found)
    # where the reference stays on a lattice the law may fail: as right beside it
    equal = _APART.size // 2
    rates[:, equal] = np.maximum(rates[:, equal], rates[:, equal - 1 : equal + 2 : 2].min(axis=1))
    logs: Array = np.log(np.maximum(rates, 1e-15)).transpose(2, 0, 1)
    return logs


def _kept(value: float, kept: tuple[float, int, int]) -> list[tuple[float, float]]:
    """Return the values that are kept beside one, with what they weigh there; 0 is kept."""
    if value <= 0.0:
        return [(0.0, 1.0)]
    base, least, largest = kept
    place = min(max(math.log(value, base), least), largest)
    below = math.floor(place)
    share = place - below
    parts = [(base**below, 1.0 - share), (base ** (below + 1), share)]
    return parts if share > 0.0 else parts[:1]


def _laws(sources: NoisySources, light: Array, leak: Array) -> list[Law]:
    corner = sources.dark_cutoff_hz + (sources.cutoff_hz - sources.dark_cutoff_hz) * light
    white = 2.0 * np.pi * max(sources.cutoff_hz, sources.dark_cutoff_hz)
    sampled_s = min(sources.noise_step / white, LONGEST_US * 1e-6)
    second = 2.0 * np.pi * sources.follower_hz
    laws = []
    for first, leak_hz in zip((2.0 * np.pi * corner).tolist(), leak.tolist(), strict=True):
        slow, ratio, sigma = first, 0.0, sources.rms
        if second > 0.0:
            slow, ratio = min(first, second), min(first, second) / max(first, second)
            sigma *= math.sqrt(second / (first + second))
        # behind two poles the noise is not sampled
        shift = SAMPLING_SHIFT * math.sqrt(2.0 * slow * sampled_s) if second == 0.0 else 0.0
        laws.append(Law(sigma, slow, ratio, sources.dead_time_s, leak_hz, shift))
    return laws
