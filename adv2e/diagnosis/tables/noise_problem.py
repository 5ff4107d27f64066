"""The model of a table of noise event rates, and the effects it may lack."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from adv2e.diagnosis.fitting.candidates import NOTHING, Candidate, FitParameter
from adv2e.diagnosis.tables.noise import NoisySources, Rates, at_least, noise_rates
from adv2e.diagnosis.tables.problem import (
    CUTOFF,
    DARK_CURRENT,
    DARK_CUTOFF,
    FOLLOWER,
    Array,
    Declared,
    Problem,
    Settings,
    of_one,
    row_errors,
)
from adv2e.diagnosis.tables.table import Noise

LEAK = "pixel.leak.rate_hz"
PHOTO_LEAK = "pixel.leak.photo_rate_hz"
SHOT = "pixel.shot_noise.rate_hz"
RMS = "pixel.photoreceptor_noise.rms"
HOT_FRACTION = "pixel.hot_pixels.fraction"
HOT_RATE = "pixel.hot_pixels.rate_hz"
HOT_SPREAD = "pixel.hot_pixels.spread"
HOT_OFF = "pixel.hot_pixels.off_fraction"
OFF = "pixel.thresholds.off"
MISMATCH = "pixel.thresholds.mismatch"

LEAST_ERROR = 0.05
"""Relative error of a rate, at the least: that of the light and the camera's temperature."""
ASSUMED_ERROR = 0.1
USUAL_FRACTION = 0.01
"""Share of hot pixels where none is declared and only its product with their rate shows."""

_WORDS = {"rate_hz": "mean", "median_hz": "median"}

_SHAPE = ((CUTOFF, 3.0, 1e6), (DARK_CUTOFF, 0.03, 3e3), (FOLLOWER, 3.0, 1e5))
"""Corner frequencies of photoreceptor noise, with least and largest fitted value [Hz]."""
_SHAPE_STARTS = ((3e3, 10.0, 100.0), (1e5, 10.0, 50.0), (1e4, 3.0, 30.0))


class NoiseProblem(Problem):
    """Noise rates against light.

    What is compared is ln(rate + floor), the floor being the least rate that would have shown:
    as the table says, or that of one event (a tenth of the smallest rate where the table does not
    say how many pixels were watched for how long), so that a rate of 0 counts as what it is.  A
    median over pixels is that of whole numbers of events, however many pixels there are: of Poisson
    numbers with mean m it is within half an event of m - 1/3 [1]_, which is its error, and the
    third its floor.  A share of the pixels counts as the rate of Poisson events at which as many
    would have so many; its error is binomial.

    Photoreceptor noise is tried with its rms alone, or, where shares tell how rates are spread
    over the pixels, with all that shapes it and is not declared: the corners of both poles, the OFF
    threshold beside ON, and the mismatch.  Then hot pixels have a fraction and a spread of rates.

    Dark current is light to the pixel: it lifts the first corner, too.  It is tried where the noise
    is declared; else the corner in the dark, which is fitted, takes its place.

    Parameters
    ----------
    test : (rows,) of bool

    References
    ----------
    .. [1] K. P. Choi, "On the medians of gamma distributions and an equation of Ramanujan", Proc.
       AMS 121(1), 1994, doi:10.1090/S0002-9939-1994-1195477-8.
    """

    what = "rate of noise events"
    unit = "Hz"
    out_of_reach: ClassVar = {
        "refractory": "dead times are too short to show in such rates",
        "low_pass": "shows in noise only by way of photoreceptor_noise; see its corner",
    }

    def __init__(
        self, data: Noise, declared: Declared, test: NDArray[np.bool_], settings: Settings
    ) -> None:
        cells = [
            (kind, k)
            for kind, rates in data.rates.items()
            for k in np.flatnonzero(~np.isnan(rates))
        ]
        self._kinds = [kind for kind, _ in cells]
        rows = np.array([k for _, k in cells])
        white = settings.white or float(data.light.max())
        super().__init__(declared, data.light[rows], data.unit, test[rows], white)
        self.hot_fraction = declared.held(HOT_FRACTION) or USUAL_FRACTION
        self._duration, self._pixels = data.duration_s[rows], data.pixels[rows]
        rate = np.array([_rate(data, kind, int(k)) for kind, k in cells])
        watched = data.pixels[rows] * self._duration
        smallest = rate[rate > 0].min() if (rate > 0).any() else 1.0
        floor = np.where(np.isnan(watched), 0.1 * smallest, 1.0 / watched)
        floor = np.where(np.isnan(data.least_hz[rows]), floor, data.least_hz[rows])
        medians = np.array([kind.endswith("_median_hz") for kind in self._kinds], np.bool_)
        whole = np.where(medians, 1.0 / self._duration, np.nan)  # rate of one event, if known
        self._numbers = [_number_of(kind) for kind in self._kinds]
        shares = np.array([number > 0 for number in self._numbers])
        self.spread_shows = max(self._numbers) > 1
        self.floor = np.where(shares, 0.0, np.fmax(floor, whole / 3.0))
        self.measured = np.log(rate + self.floor)
        events = np.sqrt((rate + self.floor) / watched)
        given = np.where(np.isnan(whole), events, np.hypot(events, 0.5 * whole))
        given /= rate + self.floor
        for k in np.flatnonzero(shares):
            given[k] = _share_error(data, cells[k][0], int(cells[k][1]))
        repeats = [(kind, data.light[k]) for kind, k in cells]
        self.error, self.error_source = row_errors(
            given, self.measured, repeats, ASSUMED_ERROR, LEAST_ERROR, settings.error
        )
        self._rows = {
            kind: np.array([k for k, at in enumerate(self._kinds) if at == kind])
            for kind in dict.fromkeys(self._kinds)
        }
        self.groups = {_title(kind): rows for kind, rows in self._rows.items()}
        self.nuisances = NOTHING
        fired = np.array([data.rates[kind][k] > 0.0 for kind, k in cells])
        self.candidates = list(self._candidates(rate, fired))
        known = (LEAK, PHOTO_LEAK, SHOT, MISMATCH)
        self.neutral = {key: 0.0 for key in known if declared.written.get(key) is None}
        self.notes = [
            f"255 DN stand for {white:g} {data.unit}.",
            "Errors are of ln(rate + floor), the floor being"
            f" {self.floor.min():.2g} to {self.floor.max():.2g} Hz.",
        ]
        if HOT_FRACTION not in declared.written and not self.spread_shows:
            self.notes.append(
                f"hot_pixels: only fraction times rate shows; the fraction is {USUAL_FRACTION:g}."
            )

    def rates(self, values: Mapping[str, float], light: Array) -> Rates:
        pixel = self.declared.config.pixel
        noise, corner = pixel.photoreceptor_noise, pixel.low_pass
        sources = NoisySources(
            leak_hz=self.declared.value(values, LEAK),
            photo_leak_hz=self.declared.value(values, PHOTO_LEAK),
            shot_hz=self.declared.value(values, SHOT),
            rms=self.declared.value(values, RMS),
            noise_step=0.1 if noise is None else noise.step,
            cutoff_hz=values.get(CUTOFF, 0.0 if corner is None else corner.cutoff_hz),
            dark_cutoff_hz=values.get(
                DARK_CUTOFF, 0.0 if corner is None else corner.dark_cutoff_hz
            ),
            follower_hz=self.declared.value(values, FOLLOWER),
            on=pixel.thresholds.on,
            off=values.get(OFF, pixel.thresholds.off),
            mismatch=self.declared.value(values, MISMATCH),
            dead_time_s=0.0 if pixel.refractory is None else 1e-6 * pixel.refractory.period_us,
            hot_fraction=values.get(HOT_FRACTION, self.hot_fraction),
            hot_hz=self.declared.value(values, HOT_RATE),
            hot_spread=self.declared.value(values, HOT_SPREAD),
            hot_off=self.declared.value(values, HOT_OFF),
        )
        dark = self.declared.value(values, DARK_CURRENT) / 255.0
        return noise_rates(sources, light / self.white + dark)

    def predict(self, values: Mapping[str, float]) -> Array:
        """Return ln(rate + floor) [Hz], (rows,)."""
        first = np.unique(self.level, return_index=True)[1]
        rates = self.rates(values, self.light[first])
        seconds = np.where(np.isnan(self._duration), 1.0, self._duration)
        rate = np.empty(self.level.size)
        for k, rows in self._rows.items():
            number, at, on = self._numbers[rows[0]], self.level[rows], k.startswith("on")
            if number == 0:
                rate[rows] = (rates.median(on) if "_median_" in k else rates.mean(on))[at]
            else:
                share = rates.at(at).share_having(number, seconds[rows], on)
                share, _ = _drawn_share(share, self._pixels[rows])
                rate[rows] = _as_poisson(number, share) / seconds[rows]
        logs: Array = np.log(rate + self.floor)
        return logs

    def _candidates(self, rate: Array, fired: NDArray[np.bool_]) -> Iterator[Candidate]:
        least = float(np.where(self.floor > 0.0, self.floor, rate).min())
        most = float(max(rate.max(), 10 * self.floor.max()))
        typical = float(np.exp(np.median(np.log(rate + self.floor))))
        if self.spread_shows:  # of the most quiet light: rates of many events are of few pixels
            few = np.array(self._numbers) == min(number for number in self._numbers if number)
            typical, most = float(rate[few].min()), float(rate[few].max())
            typical = max(typical, 1e-2 * most)

        def of_rate(name: str, key: str, factor: float = 1.0) -> Candidate:
            ends = 1e-3 * least * factor, 1e3 * most * factor
            return _several(name, [(key, *ends, (factor * typical, 0.5 * factor * most))])

        yield of_rate("leak", LEAK)
        yield of_rate("photo_leak", PHOTO_LEAK)
        yield of_rate("shot_noise", SHOT)
        if not self.spread_shows:
            alone = of_rate("hot_pixels", HOT_RATE, 1.0 / self.hot_fraction)
            hot = replace(alone, extra=((HOT_FRACTION, self.hot_fraction),))
        else:
            spread = HOT_SPREAD, 0.05, 2.0, (0.7, 1.0, 1.0)
            rates = HOT_RATE, 1e-3, 1e3, (1.0, 0.1, 0.02)
            share = HOT_FRACTION, 1e-3, 0.5, (0.02, 0.1, 0.3)
            hot = _several("hot_pixels", [share, rates, spread])
        yield hot
        off_kinds = np.array([kind.startswith("off") for kind in self._kinds])
        bright = fired & off_kinds & (self.level == self.level.max())
        if HOT_OFF not in self.declared.written and bright.any():
            keys = *hot.parameters, FitParameter(HOT_OFF, 1e-3, 1.0)
            yield replace(hot, parameters=keys, starts=tuple((*at, 0.3) for at in hot.starts))
        thresholds = self.declared.config.pixel.thresholds
        if self.declared.config.pixel.low_pass is None:
            return
        level = min(thresholds.on, thresholds.off)
        rms = RMS, level / 9, level
        if not self.spread_shows:
            if DARK_CURRENT not in self.declared.written and self.declared.held(RMS):
                at = 255.0 / self.white * float(self.light.min())
                yield of_one("dark_current", DARK_CURRENT, at, 10.0 * at, 100.0 * at)
            yield _several("photoreceptor_noise", [(*rms, (level / 3, level / 5))])
        else:
            starts = zip(*_SHAPE_STARTS, strict=True)
            shape = [(*one, first) for one, first in zip(_SHAPE, starts, strict=True)]
            on = thresholds.on
            off = OFF, 0.3 * on, 3.0 * on, (1.1 * on,) * 3
            spread = MISMATCH, 0.01 * on, 0.5 * on, (0.3 * on,) * 3
            written = self.declared.written
            free = [one for one in (*shape, off, spread) if one[0] not in written]
            free = [(*rms, (level / 3, level / 2, level / 2)), *free]
            yield _several("photoreceptor_noise", free)


def _several(
    name: str, parameters: Sequence[tuple[str, float, float, tuple[float, ...]]]
) -> Candidate:
    """Return an effect of keys with their least and largest values, and starts."""
    keys = tuple(FitParameter(key, low, high) for key, low, high, _ in parameters)
    return Candidate(name, keys, tuple(zip(*(starts for *_, starts in parameters), strict=True)))


def _number_of(kind: str) -> int:
    """Return the least number of events of a share of the pixels; 0: `kind` is no share."""
    what, _, number = kind.partition("_share")
    return 0 if what == kind else int(number[1:] or 1)


def _rate(data: Noise, kind: str, row: int) -> float:
    """Return a cell as a rate [Hz]; a share as that of Poisson events which gives it."""
    value, number = float(data.rates[kind][row]), _number_of(kind)
    if number == 0:
        return value
    share, _ = _drawn_share(value, float(data.pixels[row]))
    return float(_as_poisson(number, share) / data.duration_s[row])


def _drawn_share(share: Array | float, pixels: Array | float) -> tuple[Array, Array]:
    """Return the mean and standard error of a share that so many pixels tell; of few, kept off 0.

    Measured and predicted alike, so that a share which no pixel has is met by any that is too
    small to show.
    """
    mean = (share * pixels + 0.5) / (pixels + 1.0)
    mean = np.where(np.isnan(pixels), np.clip(share, 0.001, 0.999), mean)
    return mean, np.sqrt(mean * (1.0 - mean) / (pixels + 1.0))


def _share_error(data: Noise, kind: str, row: int) -> float:
    share, error = _drawn_share(float(data.rates[kind][row]), float(data.pixels[row]))
    ends = np.clip([share - 0.5 * error, share + 0.5 * error], 1e-9, 1.0 - 1e-9)
    return float(np.diff(np.log(_as_poisson(_number_of(kind), ends)))[0])


@lru_cache(maxsize=256)
def _shares_of_poisson(number: int) -> tuple[Array, Array]:
    """Return logits of the shares that have so many events, growing, and ln of the means."""
    logs = np.linspace(-16.0, np.log(number) + 4.0, 800)
    share = np.clip(at_least(number, np.exp(logs)), 1e-12, 1.0 - 1e-12)
    return np.maximum.accumulate(np.log(share / (1.0 - share))), logs


def _as_poisson(number: int, share: Array) -> Array:
    """Return the mean of Poisson numbers of which a share is so large, or larger."""
    logits, logs = _shares_of_poisson(number)
    share = np.clip(share, 1e-12, 1.0 - 1e-12)
    return np.exp(np.interp(np.log(share / (1.0 - share)), logits, logs))


def _title(kind: str) -> str:
    polarity, what = kind.split("_", 1)
    number = _number_of(kind)
    text = _WORDS.get(what) or f"from the share of pixels with {number} or more"
    return f"{polarity.upper()}, {text}"
