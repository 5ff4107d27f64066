r"""Paths along which a sensor moves before a picture.

Events come from change, so a picture that stands still makes none.  N-MNIST and N-Caltech101 were
recorded by moving a camera before pictures [1]_.  A path says where the sensor looks, in its own
pixels from the middle of the picture, over the share u = 0 ... 1 of its time; its extent E is the
length of its longer side:

======= =======================================================================================
saccade three moves that take equally long, along the triangle (-E/2, -E/2), (0, E/2), (E/2, -E/2)
        and back, each from rest to rest: after the share v of its time it has gone
        (1 - cos(pi v)) / 2 of its way
shake   x = E/2 (0.6 sin(2 pi 3 u) + 0.4 sin(2 pi 7 u)), y = E/2 (0.6 sin(2 pi 4 u) + 0.4 sin(2 pi
        9 u)): some hertz over the usual second, as of a hand
pan     x from -E/2 to E/2 at one speed
======= =======================================================================================

References
----------
.. [1] G. Orchard, A. Jayawant, G. K. Cohen, N. Thakor, "Converting Static Image Datasets to Spiking
   Neuromorphic Datasets Using Saccades", Frontiers in Neuroscience 9, 2015,
   doi:10.3389/fnins.2015.00437.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

from adv2e.options import SourceOptions

Offset = tuple[float, float]
"""Position of the sensor: columns to the right of the middle and rows below it [its pixels]."""

PARTS = 64
"""Parts of a pixel to which positions are rounded."""

STEP_PX = 0.5
"""Largest motion of the sensor from frame to frame where no rate is given [px]."""

_SAMPLES = 20_000


def _saccade(u: float) -> Offset:
    corners = ((-0.5, -0.5), (0.0, 0.5), (0.5, -0.5), (-0.5, -0.5))
    leg = min(int(3 * u), 2)
    share = (1 - math.cos(math.pi * (3 * u - leg))) / 2
    (x, y), (to_x, to_y) = corners[leg], corners[leg + 1]
    return x + share * (to_x - x), y + share * (to_y - y)


def _shake(u: float) -> Offset:
    x, y = (
        0.3 * math.sin(2 * math.pi * slow * u) + 0.2 * math.sin(2 * math.pi * fast * u)
        for slow, fast in ((3, 7), (4, 9))
    )
    return x, y


def _pan(u: float) -> Offset:
    return u - 0.5, 0.0


PATHS: dict[str, tuple[Callable[[float], Offset], float, float]] = {
    "saccade": (_saccade, 6.0, 0.3),
    "shake": (_shake, 8.0, 1.0),
    "pan": (_pan, 32.0, 1.0),
}
"""Paths by name: function for an extent of 1; usual extent [px], for saccades about that of
N-MNIST; usual duration [s]."""


@dataclass(frozen=True)
class SensorPath:
    """A path with its extent and duration.

    Parameters
    ----------
    kind : str
        One of `PATHS`.
    extent_px : float, optional
        Length of its longer side [pixels of the sensor]; default: as usual.
    duration_s : float, optional
        Default: as usual.
    """

    kind: str
    extent_px: float | None = None
    duration_s: float | None = None

    @classmethod
    def of(cls, options: SourceOptions) -> SensorPath | None:
        kind = options["motion"]
        if kind is None:
            return None
        return cls(kind, options["extent_px"], options["duration_s"])

    @property
    def extent(self) -> float:
        """Length of its longer side [pixels of the sensor]."""
        return PATHS[self.kind][1] if self.extent_px is None else self.extent_px

    @property
    def duration(self) -> float:
        return PATHS[self.kind][2] if self.duration_s is None else self.duration_s

    @property
    def margin(self) -> int:
        """Margin on each side for the motion [px]."""
        return math.ceil(self.extent / 2)

    def at(self, u: float) -> Offset:
        """Return the position of the sensor at the share `u` of the time [px]."""
        path = PATHS[self.kind][0]
        x, y = (round(self.extent * part * PARTS) / PARTS for part in path(u))
        return x, y

    @property
    def intervals(self) -> int:
        """Number of intervals between frames that keeps each step below `STEP_PX`."""
        path = PATHS[self.kind][0]
        places = [path(k / _SAMPLES) for k in range(_SAMPLES + 1)]
        fastest = max(math.dist(here, there) for here, there in pairwise(places)) * _SAMPLES
        # sums of floats may be a little over a whole number
        return max(1, math.ceil(fastest * self.extent / STEP_PX - 1e-6))

    def __str__(self) -> str:
        return f"{self.kind} of {self.extent:g} pixels in {self.duration:g} s"
