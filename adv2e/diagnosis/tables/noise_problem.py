"""The model of a table of noise event rates, and the effects it may lack."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from adv2e.diagnosis.fitting.candidates import NOTHING, Candidate, FitParameter
from adv2e.diagnosis.tables.measurements import Noise
from adv2e.diagnosis.tables.noise import NoisySources, Rates, noise_rates
from adv2e.diagnosis.tables.problem import Array, Declared, Problem, Settings, row_errors

LEAK = "pixel.leak.rate_hz"
PHOTO_LEAK = "pixel.leak.photo_rate_hz"
SHOT = "pixel.shot_noise.rate_hz"
RMS = "pixel.photoreceptor_noise.rms"
HOT_FRACTION = "pixel.hot_pixels.fraction"
HOT_RATE = "pixel.hot_pixels.rate_hz"

LEAST_ERROR = 0.05
"""Relative error of a rate, at the least: that of the light and the camera's temperature."""
ASSUMED_ERROR = 0.1
USUAL_FRACTION = 0.01
"""Share of hot pixels where none is declared: only its product with their rate shows."""

Extra = tuple[tuple[str, Any], ...]

_WORDS = {"rate_hz": "mean", "median_hz": "median", "share": "from the share of pixels"}


class NoiseProblem(Problem):
    """Noise rates against light.

    What is compared is ln(rate + floor), the floor being the least rate that would have shown:
    as the table says, or that of one event (a tenth of the smallest rate where the table does not
    say how many pixels were watched for how long), so that a rate of 0 counts as what it is.  A
    median over pixels is that of whole numbers of events, however many pixels there are: of Poisson
    numbers with mean m it is within half an event of m - 1/3 [1]_, which is its error, and the
    third its floor.

    Parameters
    ----------
    data : Noise
    declared : Declared
    test : (rows,) of bool
    settings : Settings

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
        self.hot_fraction = declared.held(HOT_FRACTION, USUAL_FRACTION) or USUAL_FRACTION
        self._duration = data.duration_s[rows]
        rate = np.array([_rate(data, kind, int(k)) for kind, k in cells])
        watched = data.pixels[rows] * self._duration
        smallest = rate[rate > 0].min() if (rate > 0).any() else 1.0
        floor = np.where(np.isnan(watched), 0.1 * smallest, 1.0 / watched)
        floor = np.where(np.isnan(data.least_hz[rows]), floor, data.least_hz[rows])
        medians = np.array([kind.endswith("_median_hz") for kind in self._kinds], np.bool_)
        whole = np.where(medians, 1.0 / self._duration, np.nan)  # rate of one event, if known
        self.floor = np.fmax(floor, whole / 3.0)
        self.measured = np.log(rate + self.floor)
        events = np.sqrt((rate + self.floor) / watched)
        given = np.where(np.isnan(whole), events, np.hypot(events, 0.5 * whole))
        given /= rate + self.floor
        repeats = [(kind, data.light[k]) for kind, k in cells]
        self.error, self.error_source = row_errors(
            given, self.measured, repeats, ASSUMED_ERROR, LEAST_ERROR, settings.error
        )
        self.groups = {
            _title(kind): np.array([k for k, at in enumerate(self._kinds) if at == kind])
            for kind in dict.fromkeys(self._kinds)
        }
        self.nuisances = NOTHING
        self.candidates = list(self._candidates(rate))
        known = (LEAK, PHOTO_LEAK, SHOT)
        self.neutral = {key: 0.0 for key in known if declared.held(key, None) is None}
        self.notes = [
            f"255 DN stand for {white:g} {data.unit}.",
            "Errors are of ln(rate + floor), the floor being"
            f" {self.floor.min():.2g} to {self.floor.max():.2g} Hz.",
        ]
        if HOT_FRACTION not in declared.written:
            self.notes.append(
                f"hot_pixels: only fraction times rate shows; the fraction is {USUAL_FRACTION:g}."
            )

    def rates(self, values: Mapping[str, float], light: Array) -> Rates:
        """Return the rates at `light`, in the table's unit."""
        pixel = self.declared.config.pixel
        noise, corner = pixel.photoreceptor_noise, pixel.low_pass
        sources = NoisySources(
            leak_hz=self._number(values, LEAK),
            photo_leak_hz=self._number(values, PHOTO_LEAK),
            shot_hz=self._number(values, SHOT),
            rms=self._number(values, RMS),
            noise_step=0.1 if noise is None else noise.step,
            cutoff_hz=0.0 if corner is None else corner.cutoff_hz,
            dark_cutoff_hz=0.0 if corner is None else corner.dark_cutoff_hz,
            on=pixel.thresholds.on,
            off=pixel.thresholds.off,
            dead_time_s=0.0 if pixel.refractory is None else 1e-6 * pixel.refractory.period_us,
            hot_fraction=self.hot_fraction,
            hot_hz=self._number(values, HOT_RATE),
        )
        return noise_rates(sources, light / self.white)

    def predict(self, values: Mapping[str, float]) -> Array:
        """Return ln(rate + floor) [Hz], (rows,)."""
        rates = self.rates(values, self.light)
        share = np.minimum(
            rates.leak * np.where(np.isnan(self._duration), 0, self._duration), 0.999
        )
        with np.errstate(divide="ignore", invalid="ignore"):
            seldom = -np.log1p(-share) / self._duration
        by_kind = {
            "on_rate_hz": rates.on_mean,
            "off_rate_hz": rates.off,
            "on_median_hz": rates.on,
            "off_median_hz": rates.off,
            "on_share": rates.noise_on + seldom,
            "off_share": rates.off,
        }
        rate = np.array([by_kind[kind][k] for k, kind in enumerate(self._kinds)])
        logs: Array = np.log(rate + self.floor)
        return logs

    def _candidates(self, rate: Array) -> Iterator[Candidate]:
        least, most = float(self.floor.min()), float(max(rate.max(), 10 * self.floor.max()))
        typical = float(np.exp(np.median(np.log(rate + self.floor))))

        def of_rate(name: str, key: str, factor: float = 1.0, extra: Extra = ()) -> Candidate:
            parameter = FitParameter(key, 1e-3 * least * factor, 1e3 * most * factor)
            starts = tuple((factor * start,) for start in (typical, 0.5 * most))
            return Candidate(name, (parameter,), starts, extra)

        yield of_rate("leak", LEAK)
        yield of_rate("photo_leak", PHOTO_LEAK)
        yield of_rate("shot_noise", SHOT)
        fraction = ((HOT_FRACTION, self.hot_fraction),)
        yield of_rate("hot_pixels", HOT_RATE, 1.0 / self.hot_fraction, extra=fraction)
        thresholds = self.declared.config.pixel.thresholds
        if self.declared.config.pixel.low_pass is not None:
            level = min(thresholds.on, thresholds.off)
            starts = ((level / 3,), (level / 5,))
            yield Candidate("photoreceptor_noise", (FitParameter(RMS, level / 9, level),), starts)


def _rate(data: Noise, kind: str, row: int) -> float:
    """Return a cell as a rate [Hz]; a share as that of Poisson events which gives it."""
    value = float(data.rates[kind][row])
    if not kind.endswith("_share"):
        return value
    pixels = data.pixels[row]
    most = 1.0 - (0.001 if np.isnan(pixels) else 0.5 / pixels)
    return float(-np.log1p(-min(value, most)) / data.duration_s[row])


def _title(kind: str) -> str:
    polarity, what = kind.split("_", 1)
    return f"{polarity.upper()}, {_WORDS[what]}"
