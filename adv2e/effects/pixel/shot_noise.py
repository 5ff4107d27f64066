"""Shot noise as a point process: background events that fall with brightness.

    R(t) = R_s (1 - 0.75 DN/255)

R           rate of the events, a Poisson process; half of them are ON, half OFF
R_s         rate_hz
DN          the unfiltered light

Candidates come at the constant rate R_s from a stream of each pixel's own and are thinned by the
light [1, 2].

The fall is that within one image.  From scene to scene, noise falls with the light itself: one
sensor [3] had 12 Hz at 0.1 lux (ON 6.9, OFF 5.2) and twice 0.004 Hz at 161 lux (OFF; most ON events
were leak).  The default is for good light.  A scene in dim light needs 1 to 10 Hz.

Compiled in adv2e/kernel/noise.py.

References
----------
[1] Y. Hu, S.-C. Liu, T. Delbruck, "v2e: From Video Frames to Realistic DVS Events", CVPR Workshops
    2021, doi:10.1109/CVPRW53098.2021.00144 (rate falls to a quarter at white).
[2] P. A. W. Lewis, G. S. Shedler, "Simulation of nonhomogeneous Poisson processes by thinning",
    Naval Research Logistics Quarterly 26(3), 1979, doi:10.1002/nav.3800260304.
[3] D. Joubert et al., "Event camera simulator improvements via characterized parameters", Frontiers
    in Neuroscience 15, 2021, doi:10.3389/fnins.2021.702765 (files of noise).
"""

from __future__ import annotations

from dataclasses import dataclass

from adv2e.parameters import Fit, Section, parameter

SEPARATED_BY = {
    "shot_noise": "a scene at rest: ON and OFF events without order, fewer in bright light"
}

FALL_AT_WHITE = 0.75
"""Share of the dark rate that is gone at white."""


@dataclass(frozen=True, kw_only=True)
class ShotNoise(Section):
    """Poisson background events."""

    rate_hz: float = parameter(
        0.01,
        unit="Hz",
        meaning="ON and OFF events a pixel a second in the dark; 1 to 10 in dim light",
        at_least=0,
        source="Joubert 2021: 0.01 at 161 lux, 12 at 0.1 lux",
        fit=Fit(1e-3, 500.0, 3.0, log=True, starts=(0.3, 3.0, 10.0)),
    )
