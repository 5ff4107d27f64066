"""Photoreceptor low-pass: first order, corner following the light.

    dy/dt = 2 pi f(t) (x - y),    f = f_d + (f_c - f_d) DN/255

x           log intensity, linear in time between neighbouring (interpolated) frames
y           output
f_c         cutoff_hz
f_d         dark_cutoff_hz
DN          the light that x stands for

The key update chooses how the equation is solved.  The steps below take y over one of K steps of a
frame interval, in which x goes from x0 to x1.  a is 2 pi f times the length of the step.

exact               The equation itself: event times are roots of its solution.  K plays no part.
first_order_hold    y <- E y + (q - E) x0 + (1 - q) x1 with E = exp(-a), q = (1 - E)/a, and a of
                    the mean f of the step.  It is exact for a constant corner and a linear input.
zero_order_hold     y <- exp(-a) y + (1 - exp(-a)) x1, a from the light at the end of the step.
euler               y <- (1 - eps) y + eps x1 with eps = min(1, a): the update of v2e.
paper               y <- exp(-a) y + a x1, as ADV2E prints it.  Its gain at rest is
                    a/(1 - exp(-a)), not 1, so it makes events of its own where the brightness
                    changes.

Compiled in adv2e/kernel/quadrature.py (exact) and adv2e/kernel/stepped/signal.py.

References
----------
[1] X. Jiang, F. Zhou, J. Lin, "ADV2E: Bridging the Gap Between Analogue Circuit and Discrete Frames
    in the Video-to-Events Simulator", 2024 (filter and continuity sampling).
[2] Y. Hu, S.-C. Liu, T. Delbruck, "v2e: From Video Frames to Realistic DVS Events", CVPR Workshops
    2021, doi:10.1109/CVPRW53098.2021.00144 (300 Hz; (I + 20)/275 of it).
[3] L. B. Jackson, "A correction to impulse invariance", IEEE Signal Processing Letters 7(10), 2000,
    doi:10.1109/97.870677 (why the printed update has the wrong gain).
"""

from __future__ import annotations

from dataclasses import dataclass

from adv2e.parameters import Fit, Section, parameter

LABELS = {"low_pass": "low-pass of the photoreceptor"}
SEPARATED_BY = {
    "low_pass": "the same motion in bright and dim light: its lag falls with the light, and so"
    " does the tail after the motion stops"
}

UPDATES = ("exact", "first_order_hold", "zero_order_hold", "euler", "paper")


@dataclass(frozen=True, kw_only=True)
class LowPass(Section):
    """First-order low-pass of the photoreceptor."""

    cutoff_hz: float = parameter(
        300.0,
        unit="Hz",
        meaning="corner (-3 dB) at white",
        above=0,
        source="v2e default",
        fit=Fit(1.0, 1e5, 300.0, log=True, factors=(0.25, 0.6, 2.0)),
        label="corner at white",
    )
    dark_cutoff_hz: float = parameter(
        21.8,
        unit="Hz",
        meaning="corner at zero light; linear in light between the two",
        at_least=0,
        source="v2e: 300 Hz (0 + 20)/275",
        fit=Fit(0.05, 1e4, 20.0, log=True, factors=(0.3, 3.0)),
        label="corner in the dark",
    )
    update: str = parameter(
        "exact", unit="-", meaning="how the filter's equation is solved", choices=UPDATES
    )
