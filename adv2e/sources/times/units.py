"""In which unit times are: one rule for every list of frames and every file of events.

The first of these that tells something decides:

1. the user (``--time-unit``);
2. the file (a heading such as ``#timestamp [ns]``, a column ``t_us``, or that we wrote it);
3. the times themselves, as below; what they leave open is told as a doubt.

Frames, by the number that typically lies between one and the next (the median):

============== ====== ====================== ====================================
number         unit   that is                told as a doubt
============== ====== ====================== ====================================
below 0.5      s      over 2 frames/s        only where they are nearer than 10 us
0.5 to 1       s      1 to 2 frames/s        yes
1, mostly      s      1 frame/s              yes: frame numbers look like that
1 to 1000      ms     1 to 1000 frames/s     yes
1000 to 10^6   us     1 to 1000 frames/s     yes
above          ns     up to 1000 frames/s    yes
============== ====== ====================== ====================================

But dates from 2000 to 2100, counted from 1970, are in the unit that makes them so, beyond doubt
where frames are nearer than 1 s; in doubt, and in seconds, up to a minute.

Frames that are a thousandfold nearer or farther apart than the video's own times say are told,
too.

Events come at any rate, so that their times tell less.  Those of frames beside them decide where
both are whole numbers, or neither is.  Else they are, of the first kind that fits:

============================================ ===============================================
dates from 2000 to 2100                      in the unit that makes them so
finer than a thousandth                      s: ms are not written finer than cameras' ticks
whole numbers at a rate that us allow        us, told as a doubt
others                                       in the unit that comes nearest to one event a
                                             pixel a second, told as a doubt
fewer than 100                               us if whole numbers, told as a doubt; else s
============================================ ===============================================

What no camera's rate is (`_FEWEST`, `_MOST`) is told, too.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from decimal import Decimal
from itertools import pairwise
from statistics import median
from typing import Any

import numpy as np
from numpy.typing import NDArray

UNITS = {"s": 10**9, "ms": 10**6, "us": 10**3, "ns": 1}
"""Units of time [ns]."""

SETTLED = "--time-unit settles it"

_EARLIEST_S, _LATEST_S = 946_684_800, 4_102_444_800
"""Dates that are taken for such: 2000 to 2100 [s since 1970]."""
_LONGEST_S = 60.0
"""Frames with dates are nearer than this, typically [s]."""
_SLOW_S = 0.5
"""Frames farther apart than this may be milliseconds at a little over 1000 a second [s]."""
_NEAR_S, _FAR_S = 1e-5, 10.0
"""Frames nearer or farther apart than this are told even where the unit is known [s]."""

_FEW = 100
"""So few events tell nothing of their unit."""
_FEWEST = (1e-3, 1e3)
"""Events a pixel a second, and a second: both fewer is no camera's rate [Hz]."""
_MOST = (1e3, 1e7)
"""Events a pixel a second, and a second: both more is no camera's rate [Hz]."""
_SAMPLES = 10_000
"""Times that are looked at to see how fine they are."""


@dataclass(frozen=True)
class Unit:
    """A unit of time: its name in `UNITS`, and what is to be told if it is in doubt."""

    name: str
    doubt: str = ""

    @property
    def ns(self) -> int:
        """The unit [ns]."""
        return UNITS[self.name]


def frame_unit(
    times: Sequence[Decimal],
    *,
    given: str | None = None,
    stated: str | None = None,
    usual: str | None = None,
    own_step_s: float | None = None,
) -> Unit:
    """Return the unit of the times of frames, as the rule of this module has it.

    Parameters
    ----------
    times : sequence of Decimal
        As the list has them, in any order.
    given : {'s', 'ms', 'us', 'ns'}, optional
        What the user says.
    stated : {'s', 'ms', 'us', 'ns'}, optional
        What the list itself says.
    usual : {'s', 'ms', 'us', 'ns'}, optional
        What lists of its name are in: taken from 1 to 50,000 frames a second, and told above 1000.
    own_step_s : float, optional
        How far the frames are apart by the times of the video itself [s].
    """
    if given is not None:
        return Unit(given)
    ordered = sorted(times)
    steps = [after - before for before, after in pairwise(ordered) if after > before]
    if not steps:
        return Unit(stated or "s")
    step = float(median(steps))
    if stated is not None:
        unit, sure = stated, _NEAR_S < step * UNITS[stated] / 1e9 < _FAR_S
    elif usual is not None and 2e-5 <= step * UNITS[usual] / 1e9 < 1:
        unit, sure = usual, step * UNITS[usual] / 1e9 >= 1e-3
    else:
        unit, sure = _by_step(step, steps, ordered)
        sure = sure and usual is None
    apart_s = max(step * UNITS[unit] / 1e9, 1e-12)
    if own_step_s and not 1 / 300 < apart_s / own_step_s < 300:
        return Unit(unit, _thousandfold(unit, apart_s, own_step_s))
    if sure:
        return Unit(unit)
    apart = f"{step:.6g} apart" + (", as frame numbers are," if min(steps) == 1 > step - 1 else "")
    rate = f"{1 / apart_s:.6g} frames a second"
    if stated is not None:
        return Unit(unit, f"times {apart} in {unit} are {rate}: is that right? {SETTLED}")
    return Unit(unit, f"no unit is stated: times {apart} are taken as {unit} ({rate}); {SETTLED}")


def _by_step(step: float, steps: Sequence[Any], ordered: Sequence[Any]) -> tuple[str, bool]:
    """Return (unit, whether it is beyond doubt) of frames from the number between them."""
    dated = [name for name in UNITS if _are_dates(ordered[0], ordered[-1], name)]
    for name in dated:
        if _NEAR_S < step * UNITS[name] / 1e9 < 1:
            return name, True
    if "s" in dated and step < _LONGEST_S:
        return "s", False
    if step < 1:
        return "s", _NEAR_S < step < _SLOW_S
    if step < 2 and min(steps) == 1:
        return "s", False
    unit = "ms" if step < 1e3 else "us" if step < 1e6 else "ns"
    return unit, False


def _are_dates(first: Any, last: Any, unit: str) -> bool:
    a_second = 10**9 // UNITS[unit]
    return bool(_EARLIEST_S * a_second <= first and last <= _LATEST_S * a_second)


def _thousandfold(unit: str, apart_s: float, own_step_s: float) -> str:
    return (
        f"times taken as {unit} are {apart_s:.6g} s apart, where the video's own are"
        f" {own_step_s:.6g} s apart; {SETTLED}"
    )


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
        return Unit(usual, taken(usual) if whole else "")
    rates = {name: times.size / span * (1e9 / ns) for name, ns in UNITS.items()}
    first, last = times.min().item(), times.max().item()
    for name in UNITS:
        if _are_dates(first, last, name) and _is_rate(rates[name], pixels):
            return Unit(name)
    if not whole and _are_fine(times):
        return Unit("s", "" if _is_rate(rates["s"], pixels) else taken("s", rates["s"]))
    nearest = min(UNITS, key=lambda name: abs(np.log10(rates[name] / pixels)))
    if whole and _is_rate(rates["us"], pixels):
        nearest = "us"
    # half of it, as the rate of few events is known to chance only
    sure = not whole and nearest == "s" and not _is_rate(500 * rates["s"], pixels)
    return Unit(nearest, "" if sure else taken(nearest, rates[nearest]))


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
    some = times[:: max(1, times.size // _SAMPLES)].astype(np.float64)
    thousands = some * 1e3
    slack = np.abs(thousands) * 4 * float(np.finfo(times.dtype).eps) + 1e-9
    return bool(np.mean(np.abs(thousands - np.rint(thousands)) > slack) > 0.5)


def taken(unit: str, rate_hz: float | None = None) -> str:
    """Return what is told of events whose unit is a guess."""
    rate = "" if rate_hz is None else f", {rate_hz:.3g} events a second"
    return f"no unit is stated: times are taken as {unit}{rate}; {SETTLED}"
