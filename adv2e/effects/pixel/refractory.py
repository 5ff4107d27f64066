"""Refractory period: after each event the pixel is dead for a while, then takes its reference anew.

In the dead time nothing fires and noise draws are lost; at its end the reference is the signal of
that moment, as the reset switch of the real pixel opens then.  With ``refractory: null`` the
reference moves by the threshold at a signal event and to the signal at a noise event.

References
----------
.. [1] P. Lichtsteiner, C. Posch, T. Delbruck, "A 128x128 120 dB 15 us latency asynchronous temporal
   contrast vision sensor", IEEE JSSC 43(2), 2008, doi:10.1109/JSSC.2007.914337.
.. [2] Y. Hu, S.-C. Liu, T. Delbruck, "v2e: From Video Frames to Realistic DVS Events",
   CVPR Workshops 2021, doi:10.1109/CVPRW53098.2021.00144 (0.5 ms).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from adv2e.parameters import Fit, Section, parameter


@dataclass(frozen=True, kw_only=True)
class Refractory(Section):
    """Dead time after each event."""

    period_us: float = parameter(
        500.0,
        unit="us",
        meaning="dead time after an event",
        above=0,
        source="v2e default 0.5 ms",
        fit=Fit(1.0, 2e6, 5000.0, log=True),
    )


def estimate(times_us: NDArray[np.int64], pixels: NDArray[np.int64], share: float = 1e-3) -> float:
    """Return the dead time that intervals between events of the same pixel suggest [us].

    Parameters
    ----------
    times_us, pixels : (n,) int64
        Time and pixel of each event, in any order.
    share : float
        Of the intervals that are taken for mistakes of the readout: those shorter than the result.

    Returns
    -------
    float
        0 where no pixel has two events.  Never below the true dead time but for that share, and
        far above it where pixels are seldom driven so fast.
    """
    order = np.lexsort((times_us, pixels))
    same = np.diff(pixels[order]) == 0
    apart = np.diff(times_us[order])[same]
    return float(np.quantile(apart, share, method="lower")) if apart.size else 0.0
