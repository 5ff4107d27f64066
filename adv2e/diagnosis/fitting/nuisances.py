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
from adv2e.diagnosis.fitting.candidates import FitParameter
from adv2e.effects.pixel.thresholds import FLOOR

TOLERANCE = 0.01
"""Totals match to this, relative."""
ROUNDS = 15
"""Simulations at most."""
LARGEST = 5.0
"""Largest threshold tried [ln]; grey levels of 8 bits span 5.5."""

THRESHOLDS = tuple(
    FitParameter(f"pixel.thresholds.{name}", FLOOR, LARGEST) for name in ("on", "off")
)
"""Keys that :func:`fit_thresholds` fits, and a search then refines with what it finds."""


def with_thresholds(config: Config, on: float, off: float) -> Config:
    """Return `config` with other thresholds [ln]."""
    levels = replace(config.pixel.thresholds, on=on, off=off)
    return replace(config, pixel=replace(config.pixel, thresholds=levels))


def thresholds_of(config: Config) -> dict[str, float]:
    """Return the thresholds of a configuration, by key."""
    levels = config.pixel.thresholds
    return {one.key: value for one, value in zip(THRESHOLDS, (levels.on, levels.off), strict=True)}


def fit_thresholds(
    simulate: Callable[[Config], tuple[int, int]], declared: Config, measured: tuple[int, int]
) -> tuple[Config, float]:
    """Return the declared model with thresholds that match the totals, and what they miss by.

    As in :func:`match_totals`; `simulate` returns the counts of ON and OFF events of a simulation,
    over the same pixels and times as those measured.
    """

    def count(on: float, off: float) -> tuple[int, int]:
        return simulate(with_thresholds(declared, on, off))

    here = declared.pixel.thresholds
    on, off, miss = match_totals(count, (here.on, here.off), measured)
    return with_thresholds(declared, on, off), miss


def match_totals(
    count: Callable[[float, float], tuple[int, int]],
    start: tuple[float, float],
    goal: tuple[int, int],
    *,
    tolerance: float = TOLERANCE,
    rounds: int = ROUNDS,
) -> tuple[float, float, float]:
    """Find the thresholds that give `goal`, by the secant method on logarithms.

    Parameters
    ----------
    count : callable
        Takes ON and OFF thresholds [ln], returns counts of ON and OFF events.
    start : (float, float)
        Thresholds to begin with [ln].
    goal : (int, int)
        Counts wanted.
    tolerance : float
        The search ends where both totals are this near, relative.
    rounds : int
        Calls of `count` at most.

    Returns
    -------
    on, off, miss : float
        The best thresholds met, and by how much the worse of the two totals misses, relative;
        above `tolerance` where no thresholds match.
    """
    wanted = np.log(np.maximum(goal, 0.5))
    levels, slope = np.log(start), np.full(2, -1.0)
    best = np.inf, levels
    before: tuple[NDArray[Any], NDArray[Any]] | None = None
    for _ in range(rounds):
        miss = np.log(np.maximum(count(*np.exp(levels)), 0.5)) - wanted
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
        levels = np.clip(levels + step, np.log(FLOOR), np.log(LARGEST))
    on, off = np.exp(best[1])
    return float(on), float(off), float(np.expm1(best[0]))
