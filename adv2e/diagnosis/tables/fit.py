r"""Least squares with positive parameters, by Levenberg and Marquardt in their logarithms.

References
----------
.. [1] D. W. Marquardt, "An algorithm for least-squares estimation of nonlinear parameters",
   SIAM Journal on Applied Mathematics 11(2), 1963, doi:10.1137/0111030.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Function = Callable[[Array], Array]

_MOST_STEPS = 40
_ROUGH = 1e-3
"""Tolerance of fits of which only the best goes on."""


def fit(
    residuals: Function, starts: Sequence[Array], borders: Array, step: float, tolerance: float
) -> tuple[Array, float]:
    """Return the best of the fits from several starts, and its sum of squares.

    Parameters
    ----------
    residuals : callable
        From the logarithms of the parameters, (p,), to the residuals, (n,); finite.
    starts : sequence of (p,)
    borders : (2, p)
        Least and largest logarithms.
    step : float
        By which logarithms are moved for a derivative.
    tolerance : float
        A step that lowers the sum of squares by less than this share of it is the last.  From each
        start the fit goes on only as far as tells which is the best.
    """
    rough = max(_ROUGH, tolerance) if len(starts) > 1 else tolerance
    begun = [_descend(residuals, start, borders, step, rough) for start in starts]
    best = min(begun, key=lambda found: found[1])
    return best if rough == tolerance else _descend(residuals, best[0], borders, step, tolerance)


def _descend(
    residuals: Function, start: Array, borders: Array, step: float, tolerance: float
) -> tuple[Array, float]:
    at = np.clip(start, *borders)
    r = residuals(at)
    best, damping, gain = float(r @ r), 1e-2, np.inf
    for _ in range(_MOST_STEPS):
        slopes = slopes_of(residuals, at, r, borders, step)
        square, pull = slopes.T @ slopes, slopes.T @ r
        # what would leave its range stays at the border: else the others creep along it
        free = np.where(pull > 0.0, at > borders[0], at < borders[1]) & (pull != 0.0)
        square, pull = square[np.ix_(free, free)], pull[free]
        better = False
        while free.any() and damping < 1e8 and not better:
            move = np.zeros(at.size)
            move[free] = np.linalg.solve(square + np.diag(damping * np.diag(square)), -pull)
            trial = np.clip(at + move, *borders)
            r_trial = residuals(trial)
            gain = best - float(r_trial @ r_trial)
            better = gain > 0.0
            damping = max(damping * 0.2, 1e-9) if better else damping * 8.0
        if not better:
            break
        at, r, best = trial, r_trial, best - gain
        if gain <= tolerance * (best + 1e-12):
            break
    return at, best


def slopes_of(residuals: Function, at: Array, r: Array, borders: Array, step: float) -> Array:
    """Return the derivatives of residuals r, (n,), at a point, (n, p)."""
    slopes = np.empty((r.size, at.size))
    for k in range(at.size):
        moved = at.copy()
        moved[k] += step if at[k] + step <= borders[1, k] else -step
        slopes[:, k] = (residuals(moved) - r) / (moved[k] - at[k])
    return slopes
