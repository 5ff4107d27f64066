"""Leak of the memorised reference: regular ON events of a pixel at rest.

    dr/dt = -(R0 + R1 DN/255) C_on xi

r           reference, which falls as the reset switch leaks
R0          rate_hz
R1          photo_rate_hz
DN          the unfiltered light
C_on        the pixel's own ON threshold
xi          1/(1 + jitter g), drawn anew after each event of the pixel; g is normal and cut
            symmetrically, so that the mean period stays

A pixel at rest fires at the rate R = R0 + R1 DN/255, with the mean period T = 1/R.  The jitter is
the relative standard deviation of the time between two leak events.

Every event of the pixel takes the reference anew.  Beside noise events of rate N, only the leak
events come that had a whole period without any noise event.  Their rate is

    N / (exp(N/R) - 1)

Of 0.1 Hz that leaves 0.04 Hz beside 0.16 Hz of noise, and next to nothing beside 1 Hz.

A camera has run before it records (initial_reference: running).  A pixel has seen the light of the
first frame for long and is anywhere in its cycle: the dead time d and then the period T, unless a
noise event ends it.  The age a of the cycle is drawn from a density proportional to

    p(T)                        for a < d
    p(T) exp(-N (a - d))        for d < a < d + T

Long cycles are met more often than they begin.  The reference lies (a - d)/T of a threshold below
the signal.  Beside photoreceptor noise both are one process: see initial_reference.

Compiled in adv2e/kernel/leak.py.

References
----------
[1] Y. Nozaki, T. Delbruck, "Temperature and parasitic photocurrent effects in dynamic vision
    sensors", IEEE TED 64(8), 2017, doi:10.1109/TED.2017.2717848.
[2] Y. Hu, S.-C. Liu, T. Delbruck, "v2e: From Video Frames to Realistic DVS Events", CVPR Workshops
    2021, doi:10.1109/CVPRW53098.2021.00144 (0.1 Hz, jitter 10 %).
[3] D. R. Cox, "Renewal theory", Methuen, 1962, chapter 5 (age of the cycle that is under way).
"""

from __future__ import annotations

from dataclasses import dataclass

from adv2e.parameters import Fit, Section, parameter

LABELS = {"photo_leak": "leak that grows with light"}
SEPARATED_BY = {
    "leak": "a scene at rest: regular ON events at every brightness, also in the dark",
    "photo_leak": "a scene at rest with bright and dark parts: regular ON events whose rate is"
    " proportional to the light",
}


@dataclass(frozen=True, kw_only=True)
class Leak(Section):
    """Leak events."""

    rate_hz: float = parameter(
        0.1,
        unit="Hz",
        meaning="ON events a pixel a second from junction leakage, where no noise comes between",
        at_least=0,
        source="v2e: 0.01-0.1 Hz",
        fit=Fit(1e-3, 500.0, 2.0, log=True, starts=(0.6, 2.0, 6.0)),
    )
    photo_rate_hz: float = parameter(
        0.0,
        unit="Hz",
        meaning="ON events a pixel a second from parasitic photocurrent, at white",
        at_least=0,
        fit=Fit(1e-2, 1000.0, 5.0, log=True, starts=(1.5, 5.0, 15.0)),
    )
    jitter: float = parameter(
        0.1,
        unit="-",
        meaning="relative standard deviation of the time between two leak events",
        at_least=0,
        at_most=0.3,
        source="v2e: 0.1",
    )
