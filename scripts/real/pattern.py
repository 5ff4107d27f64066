"""Pattern search: many numbers sought together, by steps along each and on in the way found."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

Place = NDArray[np.float64]


class Scored(Protocol):
    """What is sought."""

    @property
    def score(self) -> float:
        """To be made small."""


T = TypeVar("T", bound=Scored)


def pattern_search(
    at: Callable[[Place], T], start: Place, best: T, steps: Sequence[float], moves: int
) -> T:
    """Return the best that was found [1]_.

    Parameters
    ----------
    at : callable
        Tries a place.
    start : (n,)
        Scaled so that the same step suits all.
    best
        What is there.
    steps : sequence of float
        Tried along each number in turn, one after the other, from coarse to fine.
    moves : int
        How often each is repeated, at most.

    References
    ----------
    .. [1] R. Hooke, T. A. Jeeves, "Direct Search Solution of Numerical and Statistical Problems",
       JACM 8(2), 1961, doi:10.1145/321062.321069.
    """
    here = start
    for step in steps:
        for _ in range(moves):
            place, better = _around(at, here, best, step)
            if better.score >= best.score:
                break
            ahead = 2.0 * place - here
            here, best = place, better
            trial = at(ahead)
            if trial.score < best.score:
                here, best = ahead, trial
    return best


def _around(at: Callable[[Place], T], place: Place, best: T, step: float) -> tuple[Place, T]:
    for k in range(place.size):
        for way in (1.0, -1.0):
            other = place.copy()
            other[k] += way * step
            trial = at(other)
            if trial.score < best.score:
                place, best = other, trial
                break
    return place, best
