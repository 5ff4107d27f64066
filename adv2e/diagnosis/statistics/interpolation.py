r"""What statistics owe to the interpolation between frames, and how well that is known.

Between frames a simulation knows nothing of the light.  What it makes up changes each statistic by
an error e, of which the change d tells that leaving out every second frame makes.  In deviations of
chance, compressed (:mod:`adv2e.diagnosis.statistics.metric`),

.. math:: e = \tfrac{1}{4} d \pm f \sqrt{\tfrac{1}{2} (d^2 + \overline{d^2})},

with the mean over those statistics of a group that feel the frames, and for these
(:mod:`adv2e.diagnosis.statistics.frame_error`).  The first part is taken off all simulations.

How much is uncertain, f, depends on whether the frames resolve the motion.  Where they do, frames
that are blended are wrong by what the light bends, to leading order by the square of the time
between them: e = d/3 (Richardson extrapolation [1]_), and leaving out three of four frames changes
five times as much as every second; where they do not, the two changes are about as large, as is e.
So the ratio r of the two tells what to expect, :math:`f = (1.2 / r)^{1.8}`, from 0.2 to 1.  Frames
that are moved along their optical flow are wrong where that is, whatever the time between them: e
hardly goes with d, nor f with r, and f = 0.7, as where frames are too few to tell r.

``scripts/studies/interpolation_error.py`` measures e, and what is left of it beside its doubt, on
scenes seen at 2000 frames a second of which a 4th to 64th is taken; numbers here were chosen on
others like them.

References
----------
.. [1] L. F. Richardson, "The approximate arithmetical solution by finite differences of physical
   problems", Philosophical Transactions of the Royal Society A 210, 1911,
   doi:10.1098/rsta.1911.0009.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from adv2e.diagnosis.data.evidence import Evidence
from adv2e.diagnosis.statistics.frame_error import Change, FrameError
from adv2e.diagnosis.statistics.pilot import Pilot

Array = NDArray[np.float64]

_TAKEN_OFF = 0.25
_MOVED = 0.7
_BLENDED = (0.2, 1.0)
_FEWEST = 5
"""Frames that must be left for a simulation to say anything."""


def between_frames(pilot: Pilot) -> FrameError | None:
    """Return what the interpolation is worth.

    Returns
    -------
    FrameError or None
        None: too few frames to leave any out.
    """
    half = _with_every(pilot, 2)
    if half is None:
        return None
    change = Change.of_pilot(pilot.undisturbed, half)
    uncertain = _MOVED
    if pilot.declared.sampling.interpolation == "linear":
        quarter = _with_every(pilot, 4)
        if quarter is not None:
            of_quarter = Change.of_pilot(pilot.undisturbed, quarter)
            uncertain = of_blended(of_quarter.own, change.own)
    return change.error(_TAKEN_OFF, uncertain)


def of_blended(of_quarter: Array, of_half: Array) -> float:
    """Return the share of the change that is uncertain where frames are blended.

    Parameters
    ----------
    of_quarter, of_half : (views, statistics)
        Changes that leaving out three of four frames makes, and every second.
    """
    square = float(np.mean(of_half**2))
    ratio = np.sqrt(np.mean(of_quarter**2) / square) if square > 0.0 else np.inf
    return float(np.clip((1.2 / ratio) ** 1.8, *_BLENDED))


def _with_every(pilot: Pilot, step: int) -> Array | None:
    fewer = every(pilot.evidence, step)
    return pilot.undisturbed.of_frames(fewer) if len(fewer.frames) >= _FEWEST else None


def every(evidence: Evidence, step: int) -> Evidence:
    """Return the recording with every `step`-th frame, and the last."""
    keep = sorted({*range(0, len(evidence.frames), step), len(evidence.frames) - 1})
    return replace(
        evidence, frames=[evidence.frames[k] for k in keep], times_s=evidence.times_s[keep]
    )
