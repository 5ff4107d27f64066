"""What the reference solvers are told: the circuit, and the random numbers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

UPDATES = ("exact", "first_order_hold", "zero_order_hold", "euler", "paper")

ALWAYS = -np.inf
"""Uniform of a noise event that the light does not thin out (a hot pixel's)."""


@dataclass(frozen=True, kw_only=True)
class Circuit:
    """Parameters of the pixel; the names follow the configuration keys.

    Attributes
    ----------
    update : str
        One of ``UPDATES``; the dense ODE knows ``exact`` only.
    K : int
        Continuity samples an interval; ``exact`` feels it only through the printed last interval.
    L, printed_last_interval : int, bool
        With the paper's last interval as printed, every L-th interval is a last one.
    linear_below, floor : float
        Log map [DN].
    cutoff_hz, dark_cutoff_hz : float
        Corner at white and at zero light [Hz]; ``cutoff_hz`` None: no low-pass.
    follower_hz : float, optional
        Corner of the second pole [Hz].
    on, off : float or (pixels,) array
        Threshold levels [ln units].
    dead_time_us : float, optional
        Refractory period [us]; None: the reference moves by the threshold.
    leak_hz, photo_leak_hz : float
        Leak events a second: constant part, and the part at white.
    """

    update: str = "exact"
    K: int = 10
    L: int = 10
    printed_last_interval: bool = False
    linear_below: float = 20.0
    floor: float = 0.1
    cutoff_hz: float | None = 300.0
    dark_cutoff_hz: float = 21.8
    follower_hz: float | None = None
    on: float | Array = 0.2
    off: float | Array = 0.2
    dead_time_us: float | None = None
    leak_hz: float = 0.0
    photo_leak_hz: float = 0.0

    def levels(self, pixels: int) -> tuple[Array, Array]:
        """Return the ON and OFF thresholds of each pixel."""
        on, off = np.broadcast_to(self.on, pixels), np.broadcast_to(self.off, pixels)
        return np.array(on, np.float64), np.array(off, np.float64)


PURE = Circuit(linear_below=0.0, dark_cutoff_hz=0.0)
"""Corner proportional to light, logarithm everywhere."""


@dataclass(frozen=True, kw_only=True)
class Draws:
    """Random numbers, handed in so that the solvers need not draw alike; None: the part is off.

    Attributes
    ----------
    injected : per pixel, (candidates, 3)
        Time [s], uniform for the thinning by light (``ALWAYS`` for hot pixels), polarity (1, -1);
        sorted by time.  A candidate becomes an event where uniform < 1 - 0.75 DN/255.
    leak_factors : per pixel, (events + 1,)
        Speed of the leak relative to nominal after 0, 1, 2 ... events of the pixel, of any kind.
        Must be long enough.
    reference_offset : (pixels,)
        Reference minus signal at the start [ln units].
    first_release : (pixels,)
        End of the dead time that is under way at the start [s]; -inf: none is (twin only).
    signal_noise : per pixel, (times [s], values [ln units])
        Noise on the output of the low-pass, linear between its knots (twin only).
    """

    injected: Sequence[Array] | None = None
    leak_factors: Sequence[Array] | None = None
    reference_offset: Array | None = None
    first_release: Array | None = None
    signal_noise: Sequence[tuple[Array, Array]] | None = None


def merge_injected(shot: Sequence[Array], hot_times: Sequence[Array]) -> list[Array]:
    """Join shot candidates, (candidates, 3) a pixel, with hot-pixel times [s] (ON, never thinned).

    Parameters
    ----------
    shot : per pixel, (candidates, 3)
        Time [s], uniform, polarity, as in :class:`Draws`.
    hot_times : per pixel, (events,)
        Times [s]; empty for a pixel that is not hot.
    """
    merged = []
    for candidates, times in zip(shot, hot_times, strict=True):
        hot = np.column_stack([times, np.full(len(times), ALWAYS), np.ones(len(times))])
        both = np.vstack([np.reshape(candidates, (-1, 3)), hot])
        merged.append(both[np.argsort(both[:, 0], kind="stable")])
    return merged
