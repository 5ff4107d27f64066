"""Keys that nobody declared: fitted before the search, so that effects are not blamed for them.

The contrast thresholds come first.  Bias settings move them by factors, they are hardly ever known,
and as long as they are wrong every other statistic is, too.  They are set so that the simulation
has as many ON and as many OFF events as were measured.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.config import Config
from adv2e.diagnosis.fitting.candidates import Candidate, FitParameter
from adv2e.effects.pixel.thresholds import FLOOR

TOLERANCE = 0.01
"""Totals match to this, relative."""
ROUNDS = 15
"""Simulations at most."""
LARGEST = 5.0
"""Largest threshold tried [ln]; grey levels of 8 bits span 5.5."""
_SIGNS = ("on", "off")


def thresholds_of(config: Config) -> dict[str, float]:
    """Return the thresholds of a configuration, by key."""
    return {f"pixel.thresholds.{sign}": getattr(config.pixel.thresholds, sign) for sign in _SIGNS}


def threshold_nuisance(fitted: Config) -> Candidate:
    """Return the keys that :func:`fit_thresholds` fitted, for a search to refine."""
    levels = thresholds_of(fitted)
    parameters = (FitParameter(key, FLOOR, LARGEST) for key in levels)
    return Candidate("", tuple(parameters), (tuple(levels.values()),))


def fit_thresholds(
    simulate: Callable[[Config], tuple[int, int]],
    declared: Config,
    measured: tuple[int, int],
    *,
    tolerance: float = TOLERANCE,
    rounds: int = ROUNDS,
) -> tuple[Config, float]:
    """Return the declared model with thresholds that match the totals, and what they miss by.

    Parameters
    ----------
    simulate : callable
        Returns the counts of ON and OFF events of a simulation, over the same pixels and times as
        those measured.
    declared : Config
    measured : (int, int)
        Counts wanted.
    tolerance : float
        The search ends where both totals are this near, relative.
    rounds : int
        Simulations at most.

    Returns
    -------
    config : Config
        With the best thresholds met.
    miss : float
        By how much the worse of the two totals misses, relative; above `tolerance` where no
        thresholds match.
    """
    pixel = declared.pixel

    def with_levels(on: float, off: float) -> Config:
        levels = replace(pixel.thresholds, on=on, off=off)
        return replace(declared, pixel=replace(pixel, thresholds=levels))

    levels, miss = match_totals(
        lambda on, off: simulate(with_levels(on, off)),
        (pixel.thresholds.on, pixel.thresholds.off), measured,
        within=(FLOOR, LARGEST), tolerance=tolerance, rounds=rounds,
    )  # fmt: skip
    return with_levels(*levels), miss


def match_totals(
    simulate: Callable[[float, float], tuple[int, int]],
    start: tuple[float, float],
    measured: tuple[int, int],
    *,
    within: tuple[float, float],
    tolerance: float = TOLERANCE,
    rounds: int = ROUNDS,
) -> tuple[tuple[float, float], float]:
    """Return the pair of thresholds that matches the totals, and what it misses by.

    By the secant method on logarithms.

    Parameters
    ----------
    simulate : callable
        Returns the counts of ON and OFF events for thresholds of ON and OFF, in any unit.
    start : (float, float)
        Thresholds tried first.
    measured : (int, int)
        Counts wanted.
    within : (float, float)
        Smallest and largest threshold tried.
    tolerance, rounds
        See :func:`fit_thresholds`.
    """
    wanted = np.log(np.maximum(measured, 0.5))
    levels, slope = np.log(start), np.full(2, -1.0)
    best = np.inf, levels
    before: tuple[NDArray[Any], NDArray[Any]] | None = None
    for _ in range(rounds):
        miss = np.log(np.maximum(simulate(*np.exp(levels).tolist()), 0.5)) - wanted
        if np.abs(miss).max() < best[0]:
            best = float(np.abs(miss).max()), levels
        if best[0] <= np.log1p(tolerance):
            break
        if before is not None:
            moved, gained = levels - before[0], miss - before[1]
            # each total depends on both thresholds: a secant may come out with the wrong sign
            secant = np.divide(gained, moved, out=slope.copy(), where=np.abs(moved) > 1e-6)
            slope = np.clip(secant, -6.0, -0.7)
        before = levels, miss
        step = np.clip(-miss / slope, -1.0, 1.0)
        levels = np.clip(levels + step, *np.log(within))
    on, off = np.exp(best[1]).tolist()
    return (on, off), float(np.expm1(best[0]))
