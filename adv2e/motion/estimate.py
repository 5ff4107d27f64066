r"""Motion between two frames, in both directions, and how far it can be believed.

The light is looked at as the pixel does, by its logarithm: g = ln(DN + 4), so that dark structure
counts; 4 DN keep the grey levels of a nearly black frame from looking like texture.  The median of
g_b - g_a is taken off, so that a change of the whole scene's brightness is not taken for motion.

Optical flow (dense inverse search [1]_) is found from `a` to `b` and from `b` to `a`, at full
resolution and without its variational smoothing, which rubs out thin structures.  Then, for both:

- **at rest**: where the light of the 3 x 3 pixels around is the same in both frames, the motion is
  exactly 0;
- **lost**: where the flow there and back does not return to within 1 px + 10 % of its length, or
  leaves the frame, or the light it leads to differs by a factor e^0.5, the pixel is not to be seen
  in the other frame (covered, or out of the frame).  It takes the motion of the seen pixel that is
  nearest along a path over like light, for what is covered belongs to what is beside it;
- **doubtful**: where of the pixels around (33 x 33, and of the whole frame) less than a quarter
  are seen and the flow explains less than half of the change, nothing is known: too fast, too
  different, or a cut.

References
----------
.. [1] T. Kroeger, R. Timofte, D. Dai, L. Van Gool, "Fast Optical Flow using Dense Inverse
   Search", ECCV 2016, arXiv:1603.03590.
.. [2] N. Sundaram, T. Brox, K. Keutzer, "Dense point trajectories by GPU-accelerated large
   displacement optical flow", ECCV 2010, doi:10.1007/978-3-642-15549-9_32 (there and back).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from adv2e.motion.warping import ONE_SIDED, UNKNOWN, fill_lost, find_lost, mismatch

SMALLEST = 32
"""Least rows and columns for which motion is sought: two levels of the search's 8 px patches."""

_DARK_DN = 4.0
_LEAST_SPAN = 1.0
_LEAST_CHANGE = 0.01
_MISMATCH_UNIT = 0.1
_MISMATCH_MOST = 0.5
_AROUND = (3, 3)
_REGION = (33, 33)
_SEEN_LEAST = 0.25
_EXPLAINED_LEAST = 0.5

Image = NDArray[np.float32]


@dataclass(frozen=True)
class Motion:
    """Optical flow: displacement of the pixels of one frame by the time of the other.

    Attributes
    ----------
    u, v : (rows, columns) float32
        Columns and rows moved [px].
    score : (rows, columns) float32
        Lower is more credible; from ONE_SIDED on not seen in the other frame, UNKNOWN: none.
    unexplained : float
        Change of the light along the motion as it was found, over its change in place.
    """

    u: Image
    v: Image
    score: Image
    unexplained: float = 0.0


def estimate_motion(a: NDArray[Any], b: NDArray[Any]) -> tuple[Motion, Motion] | None:
    """Return the motion from `a` to `b` and from `b` to `a`; None where none is to be found.

    That is for frames smaller than SMALLEST, for frames equal to within 1 %, and across a cut.
    """
    if min(a.shape) < SMALLEST:
        return None
    ga, gb = _log_light(a, b)
    change = np.abs(ga - gb)
    if not _is_seen(change):
        return None
    equal = cv2.erode((a == b).astype(np.uint8), np.ones(_AROUND, np.uint8)).astype(np.bool_)
    there, back = _flow(ga, gb)
    costs = [_settle(*there, ga, gb, equal), _settle(*back, gb, ga, equal)]
    found = []
    for (u, v), (ru, rv), g, cost in ((there, back, ga, costs[0]), (back, there, gb, costs[1])):
        motion = _judged(u.copy(), v.copy(), ru, rv, g, cost, change)
        if motion is None:
            return None
        found.append(motion)
    return found[0], found[1]


def is_unchanged(a: NDArray[Any], b: NDArray[Any]) -> bool:
    """Tell whether two frames are equal to within 1 %, but for a change of the whole scene."""
    ga, gb = _log_light(a, b)
    return not _is_seen(np.abs(ga - gb))


def _is_seen(change: Image) -> bool:
    return bool(np.any(change > _LEAST_CHANGE))


def _log_light(a: NDArray[Any], b: NDArray[Any]) -> tuple[Image, Image]:
    """Return ln(DN + 4) of both frames, the second freed of a change of the whole scene."""
    ga, gb = (np.log(np.maximum(f, 0).astype(np.float32) + np.float32(_DARK_DN)) for f in (a, b))
    return ga, gb - np.median(gb - ga)


def _flow(ga: Image, gb: Image) -> list[tuple[Image, Image]]:
    """Return (u, v) from a to b and from b to a."""
    low = min(float(ga.min()), float(gb.min()))
    span = max(float(ga.max()), float(gb.max())) - low
    # a picture of hardly any contrast is not stretched: that would be flow of its noise
    grey = [
        np.rint((g - low) * (255.0 / max(span, _LEAST_SPAN))).astype(np.uint8) for g in (ga, gb)
    ]
    # a search of its own for each direction: it keeps nothing from one call to the next
    flows = []
    for first, second in (grey, grey[::-1]):
        search = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM)
        search.setFinestScale(0)
        search.setPatchStride(2)
        search.setVariationalRefinementIterations(0)
        flow = search.calc(first, second, None)  # type: ignore[call-overload]
        flows.append((np.ascontiguousarray(flow[..., 0]), np.ascontiguousarray(flow[..., 1])))
    return flows


def _settle(u: Image, v: Image, here: Image, there: Image, equal: NDArray[np.bool_]) -> Image:
    """Set the motion of pixels at rest to 0, in place; return the change unexplained."""
    u[equal] = 0.0
    v[equal] = 0.0
    cost = np.empty_like(here)
    mismatch(u, v, here, there, cost)
    return cost


def _judged(
    u: Image, v: Image, ru: Image, rv: Image, g: Image, cost: Image, change: Image
) -> Motion | None:
    """Return the motion with its scores, filled in where pixels are lost; None: a cut."""
    around: NDArray[Any] = cv2.blur(cost, _AROUND)
    lost = around > _MISMATCH_MOST
    find_lost(u, v, ru, rv, lost)
    seen = np.logical_not(lost).astype(np.float32)
    if _doubtful(seen.mean(), cost.mean(), change.mean()):
        return None
    doubtful = _doubtful(*(cv2.blur(part, _REGION) for part in (seen, cost, change)))
    lost |= doubtful
    distance = np.empty_like(g)
    fill_lost(u, v, lost, g, distance)
    # of two that fit equally the faster is in front: figures move over their ground
    score: Image = np.add(around / _MISMATCH_UNIT, 0.5 / (1.0 + np.hypot(u, v)), dtype=np.float32)
    score[lost] = ONE_SIDED
    score[doubtful | (distance >= UNKNOWN)] = UNKNOWN
    return Motion(u, v, score, float(cost.mean() / change.mean()))


def _doubtful(seen: Any, cost: Any, change: Any) -> Any:
    return (seen < _SEEN_LEAST) & (cost > (1.0 - _EXPLAINED_LEAST) * change)
