"""Contrast thresholds, with frozen mismatch between pixels.

A pixel fires ON where its signal has risen by C_on above the reference, OFF where it has fallen by
C_off below it.  Each pixel has its own two thresholds, drawn once:

    C_pixel = max(0.01, C + sigma z),    z normal with mean 0 and variance 1

C           on or off
sigma       mismatch

ON and OFF are drawn independently of each other.

Compiled in adv2e/kernel/per_pixel.py.

References
----------
[1] P. Lichtsteiner, C. Posch, T. Delbruck, "A 128x128 120 dB 15 us latency asynchronous temporal
    contrast vision sensor", IEEE JSSC 43(2), 2008, doi:10.1109/JSSC.2007.914337 (mismatch 2.1 %).
[2] Y. Hu, S.-C. Liu, T. Delbruck, "v2e: From Video Frames to Realistic DVS Events", CVPR Workshops
    2021, doi:10.1109/CVPRW53098.2021.00144 (sigma 0.03, floor 0.01).
"""

from __future__ import annotations

from dataclasses import dataclass

from adv2e.parameters import Fit, Section, parameter

LABELS = {"thresholds": "contrast threshold", "threshold_mismatch": "spread of the thresholds"}
SEPARATED_BY = {
    "thresholds": "a scene that returns to where it began, at two contrasts: signed steps then"
    " sum to zero only with the right thresholds, at every speed and brightness",
    "threshold_mismatch": "two different textures: what stays at the same pixels is the sensor,"
    " what moves with the texture is the scene",
}

FLOOR = 0.01
"""Least threshold of a pixel [ln units]."""


@dataclass(frozen=True, kw_only=True)
class Thresholds(Section):
    """ON and OFF contrast thresholds."""

    on: float = parameter(
        0.2,
        unit="ln",
        meaning="rise that fires an ON event",
        at_least=FLOOR,
        source="v2e default",
        fit=Fit(0.01, 5.0, 0.2, log=True, factors=(0.8, 1.25)),
        label="ON",
    )
    off: float = parameter(
        0.2,
        unit="ln",
        meaning="fall that fires an OFF event",
        at_least=FLOOR,
        source="v2e default",
        fit=Fit(0.01, 5.0, 0.2, log=True, factors=(0.8, 1.25)),
        label="OFF",
    )
    mismatch: float = parameter(
        0.03,
        unit="ln",
        meaning="standard deviation over pixels, ON and OFF independent",
        at_least=0,
        source="v2e default",
        fit=Fit(1e-3, 0.5, 0.02, log=True, factors=(0.5, 2.0, 4.0)),
    )
    drift_per_s: float = parameter(
        0.0,
        unit="1/s",
        meaning="growth of both thresholds a second, as a share of them at the first frame",
        fit=Fit(-0.9, 20.0, 0.2),
    )
