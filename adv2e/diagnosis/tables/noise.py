r"""Rates of noise events of a pixel at rest, against light.

With l = DN/255, of the typical pixel

.. math:: R_{leak} = R_0 + R_1 l, \qquad R_{shot} = R_s\,(1 - 0.75\,l)

shot noise being half ON, half OFF; leak events are ON.  Photoreceptor noise of standard deviation
sigma crosses the thresholds at a rate that is the corner of the low-pass times a function of
C/sigma (:mod:`adv2e.diagnosis.tables.threshold_noise`).  Every event takes the reference anew, so
that leak, which needs a time 1/R_leak without another event, becomes rarer beside noise of rate
lambda:

.. math:: \frac{\lambda}{e^{\lambda/R_{leak}} - 1}

Hot pixels raise the mean over pixels by fraction times rate, ON, and leave the median.

References
----------
.. [1] Y. Nozaki, T. Delbruck, "Temperature and parasitic photocurrent effects in dynamic vision
   sensors", IEEE TED 64(8), 2017, doi:10.1109/TED.2017.2717848.
.. [2] R. Graca, T. Delbruck, "Unraveling the paradox of intensity-dependent DVS pixel noise",
   International Image Sensor Workshop 2021, arXiv:2109.08640.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from adv2e.diagnosis.tables.threshold_noise import SAMPLING_SHIFT, event_rates
from adv2e.effects.courses import LONGEST_US
from adv2e.effects.pixel.shot_noise import FALL_AT_WHITE

Array = NDArray[np.float64]


_RMS_STEP = 0.02
"""Step of ln(rms) at which rates of photoreceptor noise are computed; between, interpolated."""


@dataclass(frozen=True)
class NoisySources:
    """What makes noise events in a pixel; rates in Hz, 0 standing for none."""

    leak_hz: float = 0.0
    photo_leak_hz: float = 0.0
    shot_hz: float = 0.0
    rms: float = 0.0
    """Photoreceptor noise [ln]."""
    noise_step: float = 0.0
    """At which that noise is sampled, in correlation times at white; 0: not sampled."""
    cutoff_hz: float = 0.0
    dark_cutoff_hz: float = 0.0
    on: float = 0.2
    off: float = 0.2
    dead_time_s: float = 0.0
    hot_hz: float = 0.0
    """Fraction of hot pixels times their rate."""


@dataclass(frozen=True)
class Rates:
    """Rates against light, (n,) each [Hz]: of the typical pixel, and the mean of all."""

    leak: Array
    noise_on: Array
    noise_off: Array
    on_mean: Array

    @property
    def on(self) -> Array:
        """ON events of the typical pixel."""
        return self.leak + self.noise_on

    @property
    def off(self) -> Array:
        """OFF events, of the typical pixel and of all."""
        return self.noise_off


def noise_rates(sources: NoisySources, light: Array) -> Rates:
    """Return the rates at `light`, (n,) in shares of white."""
    shot = sources.shot_hz * np.maximum(1.0 - FALL_AT_WHITE * light, 0.0)
    crossing_on, crossing_off = _crossings(sources, light)
    noise_on, noise_off = 0.5 * shot + crossing_on, 0.5 * shot + crossing_off
    leak = np.asarray(sources.leak_hz + sources.photo_leak_hz * light, dtype=np.float64)
    others = noise_on + noise_off
    present = (leak > 0.0) & (others > 0.0)
    exponent = np.minimum(others[present] / leak[present], 500.0)
    leak[present] = others[present] / np.expm1(exponent)
    busy = 1.0 / (1.0 + (leak + others) * sources.dead_time_s)
    leak, noise_on, noise_off = leak * busy, noise_on * busy, noise_off * busy
    return Rates(leak, noise_on, noise_off, leak + noise_on + sources.hot_hz)


def _crossings(sources: NoisySources, light: Array) -> tuple[Array, Array]:
    """Return the ON and OFF rates of photoreceptor noise [Hz], dead time left out."""
    on, off = np.zeros_like(light), np.zeros_like(light)
    if sources.rms <= 0.0:
        return on, off
    corner = sources.dark_cutoff_hz + (sources.cutoff_hz - sources.dark_cutoff_hz) * light
    white = 2.0 * np.pi * max(sources.cutoff_hz, sources.dark_cutoff_hz)
    step_s = min(sources.noise_step / white, LONGEST_US * 1e-6)
    for k, w in enumerate(2.0 * np.pi * corner):
        dead = float(w * sources.dead_time_s)
        a, b = _tabulated(sources, dead, w * step_s)
        free = 1.0 - (a + b) * dead  # the caller takes the dead time out again
        on[k], off[k] = w * a / free, w * b / free
    return on, off


def _tabulated(sources: NoisySources, dead: float, step: float) -> tuple[float, float]:
    """Return ON and OFF events a correlation time, between rms values at which they are kept.

    Dead time and time between samples are in correlation times.
    """
    place = np.log(sources.rms) / _RMS_STEP
    below = int(np.floor(place))
    shift = SAMPLING_SHIFT * np.sqrt(2.0 * step)
    ends = []
    for number in (below, below + 1):
        rms = float(np.exp(number * _RMS_STEP))
        ends.append(event_rates(sources.on / rms + shift, sources.off / rms + shift, dead))
    first, second = np.log(np.maximum(ends, 1e-300))
    a, b = np.exp(first + (place - below) * (second - first))
    return float(a), float(b)
