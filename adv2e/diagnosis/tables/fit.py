r"""Least squares with positive parameters, by Levenberg and Marquardt in their logarithms.

References
----------
.. [1] D. W. Marquardt, "An algorithm for least-squares estimation of nonlinear parameters",
   SIAM Journal on Applied Mathematics 11(2), 1963, doi:10.1137/0111030.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_STEP = 1e-5
_MOST_STEPS = 60


def fit(
    residuals: Callable[[Array], Array],
    starts: Iterable[Array],
    lower: Array,
    upper: Array,
    tolerance: float = 1e-8,
) -> tuple[Array, float]:
    """Return the best of the fits from several starts, and its sum of squares.

    Parameters
    ----------
    residuals : callable
        From the logarithms of the parameters, (p,), to the residuals, (n,); finite.
    starts : iterable of (p,)
    lower, upper : (p,)
        Borders of the logarithms.
    tolerance : float
        A step that lowers the sum of squares by less than this share of it is the last.
    """
    return min(
        (_descend(residuals, start, lower, upper, tolerance) for start in starts),
        key=lambda found: found[1],
    )


def _descend(
    residuals: Callable[[Array], Array], start: Array, lower: Array, upper: Array, tolerance: float
) -> tuple[Array, float]:
    at = np.clip(start, lower, upper)
    r = residuals(at)
    best = float(r @ r)
    damping = 1e-2
    slopes = None
    for _ in range(_MOST_STEPS if at.size else 0):
        if slopes is None:
            slopes = _slopes(residuals, at, r, upper)
        square = slopes.T @ slopes
        pull = slopes.T @ r
        scale = np.diag(damping * (np.diag(square) + 1e-9 * (1.0 + np.trace(square))))
        trial = np.clip(at - np.linalg.solve(square + scale, pull), lower, upper)
        r_trial = residuals(trial)
        sum_of_squares = float(r_trial @ r_trial)
        if sum_of_squares < best:
            gain = best - sum_of_squares
            at, r, best, slopes = trial, r_trial, sum_of_squares, None
            damping = max(damping * 0.2, 1e-9)
            if gain <= tolerance * (best + 1e-12):
                break
        else:
            damping *= 8.0
            if damping > 1e8:
                break
    return at, best


def _slopes(residuals: Callable[[Array], Array], at: Array, r: Array, upper: Array) -> Array:
    slopes = np.empty((r.size, at.size))
    for k in range(at.size):
        step = -_STEP if at[k] + _STEP > upper[k] else _STEP
        moved = at.copy()
        moved[k] += step
        slopes[:, k] = (residuals(moved) - r) / step
    return slopes
