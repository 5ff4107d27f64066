"""Hot pixels: a few pixels fire by themselves, whatever the light.

Each pixel is hot with the probability given by fraction, drawn once.  A hot pixel fires Poisson
events of one polarity at its own rate, drawn once:

    R = rate_hz 10^(spread z),    z normal with mean 0 and variance 1

so that rate_hz is the median over the hot pixels, and their mean is 10^(1.15 spread^2) times that.
In a camera such rates lie decades apart [1].

A hot pixel is OFF with the probability off_fraction, else ON.  In the bright, OFF events may be
those of such pixels alone: at 161 lux, where noise of the others is gone, one pixel of 2500 has ten
of the fifteen OFF intervals of [1]; 850 of them have ON intervals.

Compiled in adv2e/kernel/noise.py.

References
----------
[1] D. Joubert et al., "Event camera simulator improvements via characterized parameters", Frontiers
    in Neuroscience 15, 2021, doi:10.3389/fnins.2021.702765 (measured noise: one pixel in a hundred
    carries a third to a half of the ON noise in bright light).
"""

from __future__ import annotations

from dataclasses import dataclass

from adv2e.parameters import Fit, Section, parameter

SEPARATED_BY = {"hot_pixels": "a scene at rest, or a closed lens: few pixels hold most events"}


@dataclass(frozen=True, kw_only=True)
class HotPixels(Section):
    """Pixels that fire by themselves."""

    fraction: float = parameter(
        unit="-",
        meaning="share of the pixels that is hot",
        at_least=0,
        at_most=1,
        fit=Fit(2e-4, 0.2, 0.01, log=True),
    )
    rate_hz: float = parameter(
        unit="Hz",
        meaning="events a hot pixel a second; the median of them, where rates are spread",
        at_least=0,
        fit=Fit(1.0, 2e4, 150.0, log=True),
    )
    spread: float = parameter(
        0.0,
        unit="decades",
        meaning="standard deviation of log10 of that rate over the hot pixels",
        at_least=0,
        at_most=2,
        fit=Fit(0.05, 2.0, 0.6, log=True),
    )
    off_fraction: float = parameter(
        0.0, unit="-", meaning="share of the hot pixels whose events are OFF", at_least=0, at_most=1
    )
