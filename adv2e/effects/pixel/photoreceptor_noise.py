"""Photoreceptor noise: white noise on the drive, band-limited by the low-pass itself.

    dn = -w n dt + sqrt(2 w) sigma dW,    w = 2 pi f(t)

n           noise, added to the filtered signal
sigma       rms: standard deviation of n, the same at every brightness
f           corner of the low-pass
W           Wiener process

The correlation time of the noise is that of the low-pass.  Noise events of one pixel therefore
mostly alternate in polarity, which Poisson events do not.

Behind the low-pass alone the noise is a line between exact samples.  They are at most step times
the shortest correlation time apart, which is the one at white, and at most 0.1 ms.  This is a part
of the model: the more samples, the more often white noise crosses a threshold, without end.

Behind a second pole of corner f_s (source_follower) it has a speed, and so a rate of crossings.
Then it is not sampled: it is drawn as finely as events need it.  Its variance is

    sigma^2 f_s/(f + f_s)

so that noise falls as the light rises.  That is what two cameras do
(docs/noise_at_rest.md); behind the low-pass alone, rates rise with the corner.

Compiled in adv2e/kernel/photoreceptor/ and adv2e/kernel/stepped/signal.py.

References
----------
[1] R. Graca, T. Delbruck, "Unraveling the paradox of intensity-dependent DVS pixel noise",
    International Image Sensor Workshop 2021, arXiv:2109.08640.
[2] D. T. Gillespie, "Exact numerical simulation of the Ornstein-Uhlenbeck process and its
    integral", Physical Review E 54, 1996, doi:10.1103/PhysRevE.54.2084.
"""

from __future__ import annotations

from dataclasses import dataclass

from adv2e.parameters import Fit, Section, parameter

SEPARATED_BY = {
    "photoreceptor_noise": "a scene at rest: ON and OFF events that alternate, at a rate that"
    " falls steeply with the threshold"
}


@dataclass(frozen=True, kw_only=True)
class PhotoreceptorNoise(Section):
    """Band-limited noise of the photoreceptor."""

    rms: float = parameter(
        unit="ln",
        meaning="standard deviation of the filtered noise",
        at_least=0,
        fit=Fit(1e-3, 0.5, 0.04, log=True),
    )
    step: float = parameter(
        0.1,
        unit="-",
        meaning="longest step of the sampled noise, as a share of its correlation time at white;"
        " without source_follower",
        above=0,
        at_most=1,
    )
