"""Unit of the timestamps of events: one rule for every file.

Events come at any rate, so that their times tell less than those of frames
(:mod:`adv2e.sources.times.units`), which decide where both are whole numbers, or neither is.  Else
events are, of the first kind that fits:

============================================ ===============================================
dates from 2000 to 2100                      in the unit that makes them so
finer than a thousandth                      s: ms are not written finer than cameras' ticks
whole numbers at a rate that us allow        us, told as a doubt
others                                       in the unit that comes nearest to one event a
                                             pixel a second, told as a doubt
fewer than 100                               us if whole numbers, told as a doubt; else s
============================================ ===============================================

Event rates that no camera has (`_FEWEST`, `_MOST`) are told, too.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.sources.times.units import SETTLED, UNITS, Unit, are_dates

_FEW = 100
"""Number of events below which nothing can be told about their unit."""
_FEWEST = (1e-3, 1e3)
"""Events a pixel a second, and a second: both fewer is no camera's rate [Hz]."""
_MOST = (1e3, 1e7)
"""Events a pixel a second, and a second: both more is no camera's rate [Hz]."""
_THOUSANDTH, _FINE = 1e-3, 0.01
"""Numbers of less than 64 bits with larger steps tell nothing; fine ones are more than this share.

From 8192 on, thousandths leave out 24 of 1024 numbers of 32 bits.
"""
_SAMPLES = 10_000
"""Times that are looked at to see how fine they are."""


def event_unit(
    times: NDArray[Any],
    pixels: int,
    *,
    whole: bool,
    given: str | None = None,
    beside: Unit | None = None,
) -> Unit:
    """Return the unit of the times of events, as the rule of this module has it.

    Parameters
    ----------
    times : array of integers or floats, (events,)
        As the file has them, or many of them from its beginning.
    pixels : int
        Pixels of the sensor.
    whole : bool
        They are written as whole numbers.
    given : {'s', 'ms', 'us', 'ns'}, optional
        What the user says.
    beside : Unit, optional
        That of the frames in the same recording, where they are written as whole numbers exactly
        if these are.
    """
    if given is not None:
        return Unit(given)
    span = float(times.max()) - float(times.min()) if times.size else 0.0
    tells = times.size >= _FEW and 0 < span < np.inf
    if tells and not whole:
        whole = bool(np.all(times == np.floor(times)))
    usual = "us" if whole else "s"
    if beside is not None:
        return Unit(beside.name)
    if not tells:
        return Unit(usual, _taken(usual) if whole else "")
    rates = {name: times.size / span * (1e9 / ns) for name, ns in UNITS.items()}
    first, last = times.min().item(), times.max().item()
    for name in UNITS:
        if are_dates(first, last, name) and _is_rate(rates[name], pixels):
            return Unit(name)
    is_coarse = times.dtype.kind == "f" and np.spacing(np.abs(times).min()) > _THOUSANDTH
    if is_coarse and not whole:  # what nothing else tells
        return Unit("s", _taken("s", rates["s"]))
    if not whole and _are_fine(times):
        return Unit("s", "" if _is_rate(rates["s"], pixels) else _taken("s", rates["s"]))
    nearest = min(UNITS, key=lambda name: abs(np.log10(rates[name] / pixels)))
    if whole and _is_rate(rates["us"], pixels):
        nearest = "us"
    # half of it, as the rate of few events is known to chance only
    sure = not whole and nearest == "s" and not _is_rate(500 * rates["s"], pixels)
    return Unit(nearest, "" if sure else _taken(nearest, rates[nearest]))


def _is_rate(rate_hz: float, pixels: int) -> bool:
    """Tell whether cameras have such a rate."""
    each = rate_hz / pixels
    few = each < _FEWEST[0] and rate_hz < _FEWEST[1]
    many = each > _MOST[0] and rate_hz > _MOST[1]
    return not few and not many


def _are_fine(times: NDArray[Any]) -> bool:
    """Tell whether most times have digits beyond the third after the point."""
    if times.dtype.kind != "f":
        return False
    some = times[:: max(1, times.size // _SAMPLES)]
    thousands = some.astype(np.float64) * 1e3
    if times.dtype.itemsize < 8:  # what is left of thousandths is not a matter of slack
        return bool(np.mean((np.rint(thousands) / 1e3).astype(times.dtype) != some) > _FINE)
    slack = np.abs(thousands) * 4 * float(np.finfo(times.dtype).eps) + 1e-9
    return bool(np.mean(np.abs(thousands - np.rint(thousands)) > slack) > 0.5)


def _taken(unit: str, rate_hz: float | None = None) -> str:
    """Return the note on events whose unit is a guess."""
    rate = "" if rate_hz is None else f", {rate_hz:.3g} events a second"
    return f"no unit is stated: times are taken as {unit}{rate}; {SETTLED}"
