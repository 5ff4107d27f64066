"""Substeps of the intervals for :mod:`adv2e.kernel.cascade`, the same for all pixels.

The lag from before a bend of the light decays, in each pixel at the rate of its own corner
frequency: the lag that is left after a time t changes little in a part of t.  So substeps grow.
They are as short as white needs at a frame, where the light bends, and then a share of the time
since, however fast white is.  From frame to frame light is a line, of which the logarithm bends
little at the ends of the intervals: the substeps there are longer.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from adv2e.kernel.photoreceptor.law import (
    CELLS_AT_WHITE,
    Laws,
    NoiseTerms,
    cells_of,
    laws_for,
    no_laws,
)
from adv2e.kernel.quadrature import rounded

MOST = 16
"""Most substeps of a piece, the lags of which are kept at a time."""

WEIGHTS = 8
"""Weights of the second pole: of its own lag, six of its input, and the lag behind a ramp."""

LONGEST = 0.8
"""Longest substep at a bend, in time constants at white: with 1.25, events that a leak of 9 Hz made
after a step to white were 1.8 us off; with 0.8, a tenth of that."""

LONGEST_INSIDE = 1.5
"""The same between two frames.  Where light changes by the share r over an interval, its slope
bends by r there, and events are r times 2.2e-5 1.5^6 time constants at white off."""

GROWTH = 0.3
"""Longest substep later on, as a share of the time since.  A lag with time constants x behind the
bend is e^-x of what it was, and a substep misses 2.2e-5 (0.3 x)^6 of that, at most 2e-6."""

FEWEST = 2
"""Substeps of an interval: the light may change by a third in it."""

_NODES, _NODE_WEIGHTS = np.polynomial.legendre.leggauss(40)

_Array = NDArray[np.float64]


class Plan(NamedTuple):
    """Pieces of each interval, and their substeps, at most MOST a piece."""

    cut: NDArray[np.int64]  # (intervals,): which of the ways that follow
    until: NDArray[np.int64]  # (intervals,): end of what is one piece of time where nothing moves,
    cut_still: NDArray[np.int64]  # and which way is that of it
    pieces: NDArray[np.int64]  # (ways,)
    substeps: NDArray[np.int64]  # (ways, pieces)
    ends: _Array  # (ways, pieces + 1): of pieces, as shares of the interval
    places: _Array  # (ways, pieces, MOST + 1): of the ends of substeps, as shares of their piece
    weights: _Array  # (ways, pieces, MOST, WEIGHTS)
    factors: _Array  # (intervals + 1,): on both thresholds, at the ends
    simple: bool  # whether nothing but a second pole needs the cascade
    laws: Laws  # of photoreceptor noise,
    law: NDArray[np.int64]  # (ways, pieces): which of them


def plan_for(
    starts: _Array,
    until: NDArray[np.int64],
    inside: NDArray[np.bool_],
    fastest: float,
    follower: float,
    factors: _Array,
    simple: bool,
    noise: NoiseTerms | None = None,
) -> Plan:
    """Return the plan of intervals.

    Parameters
    ----------
    starts : (intervals + 1,)
        Ends of the intervals [us].
    until : (intervals,)
        Number of the end up to which time is not cut where nothing moves from this interval on.
    inside : (intervals,)
        Whether an interval begins on the straight line between two frames.
    fastest : float
        Corner of the first pole at white [rad/us].
    follower : float
        Corner of the second pole [rad/us], 0: there is none.
    factors : (intervals + 1,)
        Factors on both thresholds.
    simple : bool
        See :class:`Plan`.
    noise : NoiseTerms, optional
        Photoreceptor noise.
    """
    # whole ns, as frames have them: few different ones, though the times are sums in us
    lengths = np.round(np.concatenate([np.diff(starts), starts[until] - starts[:-1]]), 3)
    from_bend = np.concatenate([~inside, np.ones_like(inside)])
    distinct, cut = np.unique(np.where(from_bend, lengths, -lengths), return_inverse=True)
    ways = _ways(tuple(distinct.tolist()), fastest, follower, noise)
    alone, still = cut.reshape(2, -1).astype(np.int64)
    return Plan(cut=alone, until=until, cut_still=still, factors=factors, simple=simple, **ways)


@lru_cache(maxsize=8)
def _ways(
    lengths: tuple[float, ...], fastest: float, follower: float, noise: NoiseTerms | None
) -> dict[str, Any]:
    """Return the fields of a plan that the intervals do not change, for those of `lengths` [us].

    A negative one is that of an interval that begins between two frames.
    """
    ways = [
        _pieces(abs(length), LONGEST_INSIDE if length < 0.0 else LONGEST, fastest, noise)
        for length in lengths
    ]
    count = max((len(way) for way in ways), default=1)
    shape = len(ways), count
    substeps, law = np.zeros(shape, np.int64), np.zeros(shape, np.int64)
    ends, places = np.ones((len(ways), count + 1)), np.ones((*shape, MOST + 1))
    for w, way in enumerate(ways):
        for p, piece in enumerate(way):
            ends[w, p], span = piece[0], piece[-1] - piece[0]
            substeps[w, p] = piece.size - 1
            places[w, p, : piece.size] = (piece - piece[0]) / span
            places[w, p, piece.size - 1] = 1.0
    lasting = np.diff(ends) * np.abs(lengths)[:, None]
    corners = follower * lasting[..., None] * np.diff(places)
    weights = weights_of(corners.reshape(-1)).reshape(*corners.shape, WEIGHTS)
    laws, pieces = no_laws(), np.array([len(way) for way in ways], np.int64)
    if noise is not None:
        is_piece = substeps > 0
        roughly = np.array([rounded(length) for length in lasting[is_piece].tolist()])
        tabled, law[is_piece] = np.unique(roughly, return_inverse=True)
        laws = laws_for(tuple(tabled.tolist()), noise)
    return {
        "pieces": pieces, "substeps": substeps, "ends": ends, "places": places,
        "weights": weights, "laws": laws, "law": law,
    }  # fmt: skip


@lru_cache(maxsize=256)
def _pieces(
    length: float, longest: float, fastest: float, noise: NoiseTerms | None
) -> list[_Array]:
    """Return the places of the ends of substeps, piece by piece, in an interval of `length` us.

    longest : of those at its start, in time constants at white
    """
    upto = 1.001 * length * fastest
    ends = [0.0]
    while ends[-1] < upto:
        ends.append(ends[-1] + max(longest, GROWTH * ends[-1]))
    if len(ends) <= FEWEST:
        ends = list(range(FEWEST + 1))
    places = np.array(ends) / ends[-1]
    cells = np.zeros(places.size - 1)
    if noise is not None:
        cells = np.array([cells_of(length * span, noise) for span in np.diff(places).tolist()])
        parts = np.maximum(np.ceil(cells / CELLS_AT_WHITE), 1).astype(int).tolist()
        split = [
            np.linspace(a, b, n, endpoint=False)
            for a, b, n in zip(places[:-1], places[1:], parts, strict=True)
        ]
        places = np.append(np.concatenate(split), 1.0)
        cells = np.repeat(cells / parts, parts)
    pieces, first, held = [], 0, 0.0
    for j, more in enumerate(cells.tolist()):
        if j - first == MOST or (j > first and held + more > CELLS_AT_WHITE):
            pieces.append(places[first : j + 1])
            first, held = j, 0.0
        held += more
    pieces.append(places[first:])
    return pieces


def weights_of(corners: _Array) -> _Array:
    """Return the weights of a pole for each of `corners` [rad a substep], (corners, WEIGHTS).

    They apply to its lag at the start; to value, slope and curvature of its input at the start, and
    at the end; and to the change of x.
    """
    b = np.maximum(corners, 1e-300)[:, None]
    upto = np.minimum(1.0, 40.0 / b)
    v = 0.5 * upto * (_NODES + 1.0)
    part = 0.5 * upto * _NODE_WEIGHTS * b * np.exp(-b * v)
    t = 1.0 - v
    basis = (
        1.0 - t**3 * (10.0 - t * (15.0 - 6.0 * t)),
        t * (1.0 - t * t * (6.0 - t * (8.0 - 3.0 * t))),
        0.5 * t * t * v**3,
        t**3 * (10.0 - t * (15.0 - 6.0 * t)),
        -(t**3) * (4.0 - t * (7.0 - 3.0 * t)),
        0.5 * t**3 * v * v,
    )
    taken = [(part * values).sum(1) for values in basis]
    weights = np.stack([np.exp(-b[:, 0]), *taken, -np.expm1(-b[:, 0]) / b[:, 0]], axis=1)
    weights[corners == 0.0] = (0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)
    return weights
