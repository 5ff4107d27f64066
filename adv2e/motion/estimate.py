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


def estimate_motion(
    a: NDArray[Any], b: NDArray[Any], given: NDArray[np.float32] | None = None
) -> tuple[Motion, Motion] | None:
    """Return the motion from `a` to `b` and from `b` to `a`; None where none is to be found.

    With flow that is `given` from `a` to `b`, (rows, columns, 2), none is looked for; NaN: not
    known.  None is for frames smaller than SMALLEST, for frames equal to within 1 %, and across a
    cut.
    """
    if min(a.shape) < SMALLEST:
        return None
    ga, gb = _log_light(a, b)
    change = np.abs(ga - gb)
    if not _is_seen(change):
        return None
    equal = cv2.erode((a == b).astype(np.uint8), np.ones(_AROUND, np.uint8)).astype(np.bool_)
    there, back = _flow(ga, gb) if given is None else _both_ways(given)
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


_FAR = np.float32(1e6)
"""Motion out of any frame, of what is not known."""


def _both_ways(flow: NDArray[np.float32]) -> list[tuple[Image, Image]]:
    """Return flow and its reverse: each pixel comes from where the fastest one arrives from."""
    u, v = (np.where(np.isnan(part), _FAR, part) for part in np.moveaxis(flow, 2, 0))
    rows, columns = np.indices(u.shape)
    x, y = np.rint(columns + u).astype(np.int64), np.rint(rows + v).astype(np.int64)
    inside = (x >= 0) & (x < u.shape[1]) & (y >= 0) & (y < u.shape[0])
    order = np.argsort(np.hypot(u, v)[inside], kind="stable")
    place = y[inside][order], x[inside][order]
    back = np.full((2, *u.shape), np.nan, np.float32)
    for part, moved in zip(back, (u, v), strict=True):
        part[place] = -moved[inside][order]
    # pixels that part leave gaps between them, which are no ground that comes into view
    known = np.isfinite(back[0])
    count = cv2.boxFilter(known.astype(np.float32), -1, (3, 3), normalize=False)
    for part in back:
        total = cv2.boxFilter(np.where(known, part, np.float32(0)), -1, (3, 3), normalize=False)
        part[~known] = np.where(count >= 3, total / np.maximum(count, 1), _FAR)[~known]
    return [(u, v), (back[0], back[1])]


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


# ---- Acceleration along motion paths: the velocity of a pixel changes by the next frame.
#
# **Evenly.** With f the motion of a pixel to the next frame and p that to the frame before, r
# times as far in time, the velocity changes by e = f + p / r from there to here, and the path
# through all three is, at the share s of the interval to the next,
#
# .. math:: x(s) = f s - c\, s (1 - s), \qquad c = \frac{e}{1 + r}
#
# so that c is half the acceleration, in pixels per interval squared [1]_. It is taken where the
# pixel is seen in both frames, and as a mean over the pixels around. The two frames of an interval
# give one c each. Where they point to opposite sides there is none, else the path bends by the
# lesser of the two (a limiter, as of slopes in shock-capturing schemes [2]_).
#
# **At once.** What is hit within the interval keeps its velocity before until then, and has its
# velocity behind from then on. The changes at both frames, e and e', then tell when and by how
# much,
#
# .. math:: t = \frac{|e'|}{|e| + |e'|}, \qquad
#     x(s) = f s - (e + e') \cdot \begin{cases} (1 - t)\, s & s < t \\ t\, (1 - s) & s \ge t
#     \end{cases}
#
# Even acceleration has e = e'; so does a hit in the middle, which four frames cannot tell from it.
# From t = 0.4 or 0.6 on towards the ends, and jumps of 1.5 pixels an interval on, a path is more
# and more of this kind.
#
# At both ends of a sequence, beside a cut and where intervals differ by more than a factor of 3,
# paths are straight.
#
# References
# ----------
# .. [1] X. Xu, L. Siyao, W. Sun, Q. Yin, M.-H. Yang, "Quadratic Video Interpolation", NeurIPS 2019,
#    arXiv:1911.00627 (the path through three frames).
# .. [2] P. L. Roe, "Characteristic-Based Schemes for the Euler Equations", Annual Review of Fluid
#    Mechanics 18, 1986, doi:10.1146/annurev.fl.18.010186.002005 (minmod).


_LIKE_SPANS = 3.0
_AROUND_PX = 2.0
_KNOWN_LEAST = 0.2
_UNEVEN = (0.2, 0.5)
"""Values of |1 - 2 t| up to which a path bends evenly, and from which on at once."""
_JUMP_PX = (1.5, 3.0)
"""Jumps of velocity up to which a path bends evenly, and from which on at once [px per interval].

The time of smaller jumps cannot be told from the frames.
"""

Plane = tuple[Image, Image]
"""Columns and rows [px] at the pixels of a frame."""


@dataclass(frozen=True)
class Bend:
    """Deviation of the paths of a frame's pixels from the straight line.

    Attributes
    ----------
    even : Plane
        c [px] of pixels that accelerate evenly.
    jump : Plane
        Change of the velocity of pixels that are hit [px per interval].
    when : (rows, columns) float32
        Share of the way to the other frame at which a pixel is hit.
    """

    even: Plane
    jump: Plane
    when: Image

    def at(self, share: float) -> Plane:
        """Return c of the even bend that is as far from the straight line at a share of the way."""
        early = share < self.when
        scale = np.where(
            early, (1 - self.when) / np.float32(1 - share), self.when / np.float32(share)
        )
        p, q = (c + j * scale for c, j in zip(self.even, self.jump, strict=True))
        return p, q


@dataclass(frozen=True)
class Side:
    """Motion to the frame on the other side of one that ends an interval.

    Attributes
    ----------
    motion : Motion
        From the frame that ends the interval to the one beyond.
    span : float
        Time to that frame, in units of the interval.
    """

    motion: Motion
    span: float


def bends(
    there: Motion, back: Motion, before: Side | None, after: Side | None
) -> tuple[Bend, Bend] | None:
    """Return the bend of the paths of both frames of an interval; None: they are straight.

    `before` and `after` are the sides of the first frame and of the second.
    """
    if before is None or after is None or not (_is_like(before.span) and _is_like(after.span)):
        return None
    first, second = _change(there, before), _change(back, after)
    spans = before.span, after.span
    return _bend(first, second, there, spans), _bend(second, first, back, spans[::-1])


def fastest(motion: Motion, bend: Bend | None) -> float:
    """Return the greatest speed on the paths of a frame's pixels [px per interval].

    Velocity is linear in time but for its jump, so it is greatest at an end of the span before the
    jump, or of that behind it.  No path is faster; one that bends in both ways may be slower.
    """
    if bend is None:
        return float(np.hypot(motion.u, motion.v).max())
    most = 0.0
    for jumped in (bend.when - 1.0, bend.when):
        for sign in (-1.0, 1.0):
            ends = (
                along + sign * even + jumped * jump
                for along, even, jump in zip(
                    (motion.u, motion.v), bend.even, bend.jump, strict=True
                )
            )
            most = max(most, float(np.hypot(*ends).max()))
    return most


def _is_like(span: float) -> bool:
    return 1.0 / _LIKE_SPANS <= span <= _LIKE_SPANS


def _change(to: Motion, side: Side) -> Plane:
    """Return the change of velocity at a frame [px per interval]; 0 where it is not known."""
    away, span = side.motion, side.span
    known = ((to.score < ONE_SIDED) & (away.score < ONE_SIDED)).astype(np.float32)
    weight = _mean(known)
    told = weight >= _KNOWN_LEAST
    # what ends the interval at rest, or lies beside it, is not bent, to the last bit
    still = (to.u == 0.0) & (to.v == 0.0)
    found = []
    for there, back in ((to.u, away.u), (to.v, away.v)):
        change = there + back / np.float32(span)
        mean = np.where(told, _mean(change * known) / np.maximum(weight, _KNOWN_LEAST), 0.0)
        found.append(np.where(still, 0.0, mean).astype(np.float32))
    return found[0], found[1]


def _mean(image: NDArray[Any]) -> Image:
    return cv2.GaussianBlur(image, (0, 0), _AROUND_PX)  # type: ignore[return-value]


def _bend(own: Plane, others: Plane, motion: Motion, spans: tuple[float, float]) -> Bend:
    """Return the bend of the paths of a frame from the changes of velocity at both frames."""
    rows, columns = motion.u.shape
    y, x = np.mgrid[:rows, :columns].astype(np.float32)
    x, y = x + motion.u, y + motion.v
    other = [
        cv2.remap(part, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE) for part in others
    ]
    along = own[0] * other[0] + own[1] * other[1] > 0.0
    length, limit = np.hypot(*own), np.hypot(*other)
    both = np.maximum(length + limit, 1e-12)
    when = limit / both
    jump = [np.where(along, a + b, 0.0) for a, b in zip(own, other, strict=True)]
    hit = _between(np.abs(1.0 - 2.0 * when), *_UNEVEN) * _between(np.hypot(*jump), *_JUMP_PX)
    # c of both frames, of which the lesser counts
    c, most = length / (1.0 + spans[0]), limit / (1.0 + spans[1])
    share = np.where(along, np.minimum(c, most) / np.maximum(length, 1e-12), 0.0) * (1.0 - hit)
    return Bend(
        _plane(own[0] * share, own[1] * share),
        _plane(jump[0] * hit, jump[1] * hit),
        when.astype(np.float32),
    )


def _between(value: NDArray[Any], low: float, high: float) -> NDArray[Any]:
    return np.clip((value - low) / (high - low), 0.0, 1.0)


def _plane(u: NDArray[Any], v: NDArray[Any]) -> Plane:
    return u.astype(np.float32), v.astype(np.float32)
