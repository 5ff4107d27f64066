"""Logarithmic response of the photoreceptor, with a linear foot in the dark.

    x = ln(DN)          for DN >= k
    x = DN ln(k)/k      for DN < k

DN          255 light / full scale
k           linear_below; with 0 the response is the pure logarithm of max(DN, floor)

The foot keeps one grey level of a nearly black frame from counting as a large contrast.  Its slope,
ln(k)/k, equals that of the logarithm at the knee only for k = e.  At k = 20 it is three times
steeper just below the knee than just above it.  DN are linear light: on video that was decoded from
sRGB, 20 DN is code 80 of 255, and a third of a usual picture would lie on the foot, with up to
three times the contrast.  The default is therefore e.

Compiled in adv2e/kernel/exact.py and adv2e/kernel/stepped/signal.py.

References
----------
[1] Y. Hu, S.-C. Liu, T. Delbruck, "v2e: From Video Frames to Realistic DVS Events", CVPR Workshops
    2021, doi:10.1109/CVPRW53098.2021.00144 (lin-log map at 20 DN).
"""

from __future__ import annotations

from dataclasses import dataclass

from adv2e.errors import ConfigError
from adv2e.parameters import Section, parameter


@dataclass(frozen=True, kw_only=True)
class LogResponse(Section):
    """Map from light to log intensity."""

    linear_below: float = parameter(
        2.72,
        unit="DN",
        meaning="linear below this value, logarithmic above; 0: logarithm everywhere",
        at_least=0,
        source="e: no kink at the knee; least distance, see adv2e/kernel/README.md",
    )
    floor: float = parameter(
        0.1, unit="DN", meaning="least value under a pure logarithm (linear_below: 0)", above=0
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if 0 < self.linear_below <= 1:
            raise ConfigError(
                f"linear_below: must be 0 (pure logarithm) or above 1 DN, got {self.linear_below:g}"
                " (the linear part would not rise)"
            )
