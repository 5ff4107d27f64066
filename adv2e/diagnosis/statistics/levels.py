"""What statistics owe to the levels that the frames' numbers are rounded to.

A simulation takes the steps of 8-bit frames for light, and so do the statistics that ask how the
light changed before an event: where it is dark, a step is as large as a threshold.  How much that
is worth is told by simulations of frames that are rounded to every third level.  What those change
has hardly the direction of the error, but is two to five times as large (of four scenes of 60 to
250 frames a second in 8 bits and 16: .2 to .5 of it), so nothing is taken off, and 0.4 of it is
counted as uncertain.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.diagnosis.data.evidence import Evidence
from adv2e.diagnosis.data.light import quantum_dn
from adv2e.diagnosis.statistics.frame_error import Change, FrameError
from adv2e.diagnosis.statistics.pilot import Pilot

_DOUBT = 0.4
_FINE_DN = 0.05
"""Steps, of 255, that leave nothing to be seen: those of 12 bits are a little larger."""


def between_levels(pilot: Pilot) -> FrameError | None:
    """Return what the levels are worth; None where they are fine."""
    if quantum_dn(pilot.evidence, pilot.declared) < _FINE_DN:
        return None
    return Change.of_pilot(pilot, pilot.of_frames(coarser(pilot.evidence))).error(0.0, _DOUBT)


def coarser(evidence: Evidence) -> Evidence:
    """Return the recording with its frames, of whole numbers, rounded to every third level.

    An odd number of levels has one in the middle, so that the light stays what it is on average.
    """
    return evidence.with_frames(_rounded)


def _rounded(image: NDArray[Any]) -> NDArray[Any]:
    # the largest number of 2, 4, 8, ... bits is a multiple of three; others stay below it
    rounded = (image.astype(np.int64) + 1) // 3 * 3
    return np.minimum(rounded, np.iinfo(image.dtype).max).astype(image.dtype)
