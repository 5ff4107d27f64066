"""Dark current: a constant light that the frames know nothing of.

    DN' = DN + d

d           dn [DN of 255]

The photodiode cannot tell dark current from photocurrent: logarithm, corner of the low-pass, leak
by light and shot noise all see the sum.  It bounds contrast and lag in the dark.

References
----------
[1] R. Graca, B. McReynolds, T. Delbruck, "Shining light on the DVS pixel: A tutorial and discussion
    about biasing and optimization", CVPR Workshops 2023, arXiv:2304.04706.
[2] Y. Nozaki, T. Delbruck, "Temperature and parasitic photocurrent effects in dynamic vision
    sensors", IEEE TED 64(8), 2017, doi:10.1109/TED.2017.2717848 (doubles every 6 to 8 degrees).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from numpy.typing import NDArray

from adv2e.effects.hooks import Hooks, LightFrame
from adv2e.parameters import Fit, Section, parameter

SEPARATED_BY = {
    "dark_current": "lag over more than one and a half decades of light: it levels off in the dark"
}


@dataclass(frozen=True, kw_only=True)
class DarkCurrent(Section):
    """A constant light."""

    dn: float = parameter(
        unit="DN",
        meaning="light that the dark current equals",
        at_least=0,
        fit=Fit(0.02, 200.0, 3.0, log=True, starts=(0.5, 3.0, 15.0)),
    )


class DarkCurrentHooks(Hooks):
    """Adds the constant to the light."""

    Parameters = DarkCurrent

    def light_now(self, t_ns: int, light: NDArray[Any]) -> LightFrame:
        return t_ns, light + light.dtype.type(self.parameters.dn)
