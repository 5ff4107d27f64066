"""Unit of the timestamps of frames: one rule for every list.

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
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from decimal import Decimal
from itertools import pairwise
from statistics import median
from typing import Any

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
    own_step_s: float | None = None,
) -> Unit:
    """Return the unit of the times of frames, as the rule of this module has it.

    Parameters
    ----------
    times : sequence of Decimal
        As the list has them, in any order.
    given, stated : {'s', 'ms', 'us', 'ns'}, optional
        What the user says, and what the list itself says.
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
    else:
        unit, sure = _by_step(step, steps, ordered)
    apart_s = max(step * UNITS[unit] / 1e9, 1e-12)
    if own_step_s and not 1 / 300 < apart_s / own_step_s < 300:
        told = f"times taken as {unit} are {apart_s:.6g} s apart, where the video's own are"
        return Unit(unit, f"{told} {own_step_s:.6g} s apart; {SETTLED}")
    if sure:
        return Unit(unit)
    apart = f"{step:.6g} apart" + (", as frame numbers are," if min(steps) == 1 > step - 1 else "")
    rate = f"{1 / apart_s:.6g} frames a second"
    if stated is not None:
        return Unit(unit, f"times {apart} in {unit} are {rate}: is that right? {SETTLED}")
    return Unit(unit, f"no unit is stated: times {apart} are taken as {unit} ({rate}); {SETTLED}")


def _by_step(step: float, steps: Sequence[Any], ordered: Sequence[Any]) -> tuple[str, bool]:
    """Return (unit, whether it is beyond doubt) of frames from the number between them."""
    dated = [name for name in UNITS if are_dates(ordered[0], ordered[-1], name)]
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


def are_dates(first: Any, last: Any, unit: str) -> bool:
    """Tell whether times in a unit are dates from 2000 to 2100, counted from 1970."""
    a_second = 10**9 // UNITS[unit]
    return bool(_EARLIEST_S * a_second <= first and last <= _LATEST_S * a_second)
