r"""From the drive x to the signal that the comparator sees, one step at a time.

The poles are solved with the implicit midpoint rule: with a = w h at the middle of the step and x
there,

.. math:: y_1 = y_0 + \frac{a}{1 + a/2}\,(x - y_0),

which is of second order in h, stable for any a, and never overshoots for a < 2.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from camera.settings import Settings, find, section

Array = NDArray[np.float64]


def gain_of(rate: Array, step_s: float) -> Array:
    """Return the share of the way to x that a pole of `rate` [rad/s] goes in a step."""
    a = rate * step_s
    return a / (1.0 + 0.5 * a)


def corner_of(settings: Settings) -> Callable[[Array, Array], Array] | None:
    r"""Return the corner of the first pole [rad/s] at (times, light), None without low-pass.

    .. math:: w = 2\pi\,(f_d + (f_c - f_d)\,DN/255)

    With ``outside.corner_ramp`` all of it changes by e^(r t), as with temperature.

    Source: Lichtsteiner, Posch, Delbruck 2008; Hu, Liu, Delbruck 2021 (corner at zero light).
    """
    low_pass = section(settings, "pixel.low_pass")
    if low_pass is None:
        return None
    white, dark = low_pass["cutoff_hz"], low_pass["dark_cutoff_hz"]
    ramp = find(settings, "outside.corner_ramp.per_s", 0.0)

    def corner(times: Array, light: Array) -> Array:
        rate = (2 * np.pi * (white - dark) / 255.0) * light
        rate += 2 * np.pi * dark
        if ramp:
            rate *= np.exp(ramp * times)[:, None]
        return rate

    return corner


class Photoreceptor:
    r"""The poles of all pixels, with slew limit and noise.

    First pole: dy/dt = w (x - y), the light deciding w; with a slew limit, |dy/dt| <= s.  Noise:
    white noise on the drive, of the strength at which the pole lets a deviation of ``rms`` pass,

    .. math:: n_1 = (1 - g)\,n_0 + \sigma\sqrt{1 - (1 - g)^2}\;\xi,

    g being the pole's gain in a step.  Second pole: dz/dt = w_s (y + n - z).  High-pass: of either,
    what follows it as another such pole is subtracted.

    Sources: Lichtsteiner, Posch, Delbruck 2008 (poles); Graca, Delbruck, "Unraveling the paradox of
    intensity-dependent DVS pixel noise", 2021 (noise limited by the pole).

    Parameters
    ----------
    settings : mapping
    x : (pixels,)
        Drive on which all poles rest.
    step_s : float
    rng : Generator
    """

    def __init__(
        self, settings: Settings, x: Array, step_s: float, rng: np.random.Generator
    ) -> None:
        self._filtered = section(settings, "pixel.low_pass") is not None
        follower = find(settings, "pixel.source_follower.cutoff_hz", None)
        slew = find(settings, "pixel.slew_limit.per_s", None)
        self._follow = None if follower is None else gain_of(2 * np.pi * follower, step_s)
        self._slew = None if slew is None else slew * step_s
        self._rms = find(settings, "pixel.photoreceptor_noise.rms", 0.0)
        assert self._filtered or not (self._rms or slew), "noise and slew limit need a low_pass"
        self._rng = rng
        self._noise = self._rms * rng.standard_normal(len(x)) if self._rms else None
        self._y = x.copy()
        self._move = np.empty_like(x)
        self._input = x if self._noise is None else x + self._noise
        self._z = self._input.copy()
        high = find(settings, "pixel.high_pass.cutoff_hz", None)
        self._forget = None if high is None else gain_of(2 * np.pi * high, step_s)
        self._slow = np.zeros_like(x)  # above the drive at the start, where the pixel rests
        self._rest = x.copy()

    @property
    def signal(self) -> Array:
        """Present output, (pixels,)."""
        passed = self._z if self._follow is not None else self._input
        return passed if self._forget is None else passed - self._slow

    def advance(self, x: Array, gain: Array | None) -> Array:
        """Go on by a step with the drive `x` and the first pole's `gain`; return the signal.

        The array returned is a new one if it is not the one returned last.
        """
        before, passed = self._input, self._z if self._follow is not None else self._input
        self._advance_pole(x, gain)
        if self._noise is None:
            self._input = self._y.copy()
        else:
            self._advance_noise(gain)
            self._input = self._y + self._noise
        if self._follow is not None:
            middle = before + self._input
            middle *= 0.5
            middle -= self._z
            middle *= self._follow
            middle += self._z
            self._z = middle
        if self._forget is not None:
            after = self._z if self._follow is not None else self._input
            self._slow += self._forget * (0.5 * (passed + after) - self._rest - self._slow)
        return self.signal

    def _advance_pole(self, x: Array, gain: Array | None) -> None:
        if gain is None:
            self._y[:] = x
            return
        move = np.subtract(x, self._y, out=self._move)
        move *= gain
        if self._slew is not None:
            np.clip(move, -self._slew, self._slew, out=move)
        self._y += move

    def _advance_noise(self, gain: Array | None) -> None:
        assert self._noise is not None
        assert gain is not None
        kept = 1.0 - gain
        self._noise *= kept
        spread = np.sqrt(1.0 - kept * kept)
        spread *= self._rng.standard_normal(len(spread))
        spread *= self._rms
        self._noise += spread


def frame_coupling(amplitude: float, tau_s: float, readouts: Array, times: Array) -> Array:
    r"""Return the disturbance of the signal [ln] at `times` by frames read out at `readouts` [s].

    .. math:: d(t) = A \sum_{t_f < t} e^{-(t - t_f)/\tau}

    The first of `times` after a readout has its full height: the leap lies in the step that ends
    there, and the comparator sees it, however little is left of it at the end.

    Source: Brandli et al., "A 240 x 180 130 dB 3 us latency global shutter spatiotemporal vision
    sensor", 2014 (coupling of the frame readout into the event pixels).
    """
    disturbance = np.zeros(len(times))
    for readout in readouts:
        start = int(np.searchsorted(times, readout, "right"))
        end = int(np.searchsorted(times, readout + 30.0 * tau_s))
        waited = times[start:end] - readout
        if start > 0:
            waited[:1] = 0.0
        disturbance[start:end] += amplitude * np.exp(-waited / tau_s)
    return disturbance
