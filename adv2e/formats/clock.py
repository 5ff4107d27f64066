"""The clock of a file of events: numbers that wrap, and clocks that were set back.

A clock of few bits begins again.  It is counted on where times fall from the end of its range to
the beginning: 2^32, with a sign or without, 2^31 and 2^24, in ticks of the file; of floats, in
microseconds.  The first and last 64th of the range count as such, 67 s of 2^32 us; a 16th where
the file has numbers of so few bits.

Other times that go back by more than `MOST_BACK_US` are no packets out of order: the clock was set
back, or the events are in another order.  That is an error, unless the user, or the file at that
place, says what to do.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from adv2e.errors import DataError
from adv2e.options import SET_BACK
from adv2e.sources.times.rates import UNITS
from adv2e.ticks import US, check_numbers, in_ticks

if TYPE_CHECKING:
    from adv2e.formats.event_file import Facts
    from adv2e.sources.frame import Shot

MOST_BACK_US = 100_000
"""Packets out of order, and those of several cameras, are nearer to each other than this [us]."""

CONTINUE, SORT = SET_BACK

_WRAPS = ((1 << 32, 0), (1 << 32, -1 << 31), (1 << 31, 0), (1 << 24, 0))
"""Range and lowest number of clocks."""
_SHARE, _NARROW_SHARE = 64, 16
"""Divisors of a clock's range for the width of its ends; the second one for 32-bit numbers."""

Times = NDArray[Any]


class _Wraps:
    """Counts the wraps (overflows) of a clock.

    Parameters
    ----------
    bits : int
        Bits of the clock, where the format says it: then any fall by half the range is a wrap.
    """

    def __init__(self, bits: int = 0) -> None:
        self.modulus: float = 1 << bits if bits else 0
        self._low: float = 0
        self._slack: float = self.modulus
        self.share = _SHARE
        self.turns = 0

    def __call__(self, before: Times, after: Times) -> Times | None:
        """Return the turns at each of the times `after` others; None: there were none."""
        if not self.modulus:
            self._find(before, after)
        if not self.modulus:
            return None
        down = self._across(before, after, self._slack)
        up = self._across(after, before, self.modulus / self.share)
        if not self.turns:  # no wrap yet from which late packets could come back
            up[: int(np.argmax(down)) if down.any() else up.size] = False
        turns: Times = self.turns + np.cumsum(down.astype(np.int64) - up)
        self.turns = int(turns[-1])
        return turns

    def _across(self, former: Times, latter: Times, slack: float) -> NDArray[np.bool_]:
        """Return a mask of the times that go from the end of the range to its beginning (wraps).

        Numbers beyond the range are of a clock that somebody counted on for a while.
        """
        near = (former - self._low) % self.modulus >= self.modulus - slack
        near &= (latter - self._low) % self.modulus < slack
        fall = former - latter
        near &= (fall > self.modulus / 2) & (fall < self.modulus)
        return near

    def _find(self, before: Times, after: Times) -> None:
        """Take the clock that the first wrap tells of."""
        first = before.size
        scales = [1.0]
        if before.dtype.kind == "f":
            scales += [UNITS["us"] / ns for ns in UNITS.values()]
        for modulus, low in ((m * scale, low * scale) for scale in scales for m, low in _WRAPS):
            end = modulus / self.share
            falls = (before - after > modulus - 2 * end) & (after >= low) & (after < low + end)
            falls &= (before < low + modulus) & (before >= low + modulus - end)
            at = int(np.argmax(falls)) if falls.any() else first
            if at < first:
                whole = float(modulus).is_integer() and before.dtype.kind != "f"
                self.modulus = int(modulus) if whole else modulus
                first, self._low, self._slack = at, low, end


def unwrapped(times: Times) -> Times:
    """Return times of one file, counted on where they wrap."""
    if times.dtype.kind not in "iuf" or times.size < 2 or np.all(times[1:] >= times[:-1]):
        return times
    wide: Times = times.astype(np.float64 if times.dtype.kind == "f" else np.int64)
    wraps = _Wraps()
    wraps.share = _share(times)
    turns = wraps(wide[:-1], wide[1:])
    if turns is None:
        return times
    wide[1:] += turns * wraps.modulus
    return wide


def _share(times: Times) -> int:
    is_narrow = times.dtype.kind in "iu" and times.dtype.itemsize <= 4
    return _NARROW_SHARE if is_narrow else _SHARE


class Clock:
    """Puts the times of a file on one axis, part by part, over wraps and where they were set back.

    Parameters
    ----------
    facts : Facts
        Says what to do where times go back, and is told what was done.
    unit_ns : int
        Of the times [ns].
    bits : int
        Bits of the clock, where the format says it.
    set_back : {'continue', 'sort'}, optional
        Treatment of times that go back, where the user does not say it; default: an error.
    items : str
        Name of the items that have the times, for messages.
    """

    def __init__(
        self,
        facts: Facts,
        unit_ns: int = US,
        *,
        bits: int = 0,
        set_back: str | None = None,
        items: str = "event",
    ) -> None:
        self._facts, self._unit_ns, self._items = facts, unit_ns, items
        self._how = facts.set_back or set_back
        self._most_back = MOST_BACK_US * US / unit_ns
        self._wraps, self._bits = _Wraps(bits), bits
        self._shift: Any = 0  # of all resets
        self._last: Any = None  # as the file has it
        self._before: Any = None  # the same, counted on
        self._most: Any = None
        self._count = 0
        self.resets = 0
        """Number of times that the clock was set back."""
        self._coarse_us = 0.0
        self._wrapped = self._reset = self._step = ""
        self.announced = False
        """The file says that the clock begins anew before the next time."""

    @property
    def offset(self) -> Any:
        """Offset that was added to the last time."""
        return 0 if self._last is None else self._before - self._last

    def ticks(self, times: Times, label: str) -> NDArray[np.int64]:
        """Return the next times in whole microseconds; errors as of :meth:`counted`."""
        return in_ticks(self.counted(times, label), self._unit_ns, US)

    def counted(self, times: Times, label: str) -> Times:
        """Return the next times, counted on, in the unit of the file.

        Raises
        ------
        DataError
            As :func:`adv2e.ticks.to_ticks`; or they go back, and nothing says what to do.
        """
        check_numbers(times, self._unit_ns, label)
        if not times.size:
            return times.astype(np.int64)
        is_float = times.dtype.kind == "f"
        raw = times.astype(np.float64 if is_float else np.int64)
        if self._last is None:
            self._last = self._before = self._most = raw[0]
            self._wraps.share = _share(times)
        rising = bool(raw[0] >= self._last and np.all(raw[1:] >= raw[:-1]))
        if rising and not raw[-1] - self._last > self._wraps.modulus / 2 > 0:
            counted = raw + self.offset if self.offset else raw
            self._most = max(self._most, counted[-1])
        else:
            counted = self._over_falls(raw)
        self._count += raw.size
        self._last, self._before, self.announced = raw[-1], counted[-1], False
        if is_float and times.dtype.itemsize < 8:
            step = np.spacing(np.abs(times).max())
            self._coarse_us = max(self._coarse_us, float(step) * self._unit_ns / US)
        return counted

    def _over_falls(self, raw: Times) -> Times:
        former = np.concatenate([[self._last], raw[:-1]])
        as_it_is = self._how == SORT and not self._bits
        turns = None if as_it_is else self._wraps(former, raw)
        counted = raw if turns is None else raw + turns * self._wraps.modulus
        if turns is not None and not self._wrapped and turns.any():
            self._wrapped = f"{self._items} {self._count + int(np.argmax(turns != 0))}"
        counted = counted + self._shift
        if self._how != SORT:
            counted = self._over_resets(raw, counted)
        self._most = max(self._most, counted.max())
        return counted

    def _over_resets(self, raw: Times, counted: Times) -> Times:
        step = np.diff(counted, prepend=self._before)
        resets = step < -self._most_back if self._how == CONTINUE else np.zeros(step.size, np.bool_)
        resets[0] |= self.announced and step[0] < 0
        if resets.any():
            at = int(np.argmax(resets))
            self.resets += int(np.count_nonzero(resets))
            self._reset = self._reset or f"{self._items} {self._count + at}"
            self._step = self._step or self._seconds(-step[at])
            # of a clock that begins anew at zero, the time since then is known
            is_new = (raw >= 0) & ((raw <= self._most_back) | self.announced)
            shift = np.cumsum(np.where(resets, np.where(is_new, raw, 0) - step, 0))
            self._shift += shift[-1]
            counted = counted + shift
        if self._how is None:
            highest = np.maximum.accumulate(np.concatenate([[self._most], counted]))[:-1]
            late = np.flatnonzero(highest - counted > self._most_back)
            if late.size:
                self._refuse(highest[late[0]], counted[late[0]], int(late[0]))
        return counted

    def _refuse(self, highest: Any, time: Any, at: int) -> None:
        raise DataError(
            f"{self._facts.path}: the clock was set back by {self._seconds(highest - time)} s at"
            f" {self._items} {self._count + at} ({self._seconds(highest)} to"
            f" {self._seconds(time)} s), or the events are not in the order of time: --set-back"
            " continue goes on from the time before, --set-back sort takes the times as they are"
        )

    def _seconds(self, ticks: Any) -> str:
        return f"{float(ticks) * self._unit_ns / 1e9:.10g}"

    def tell(self) -> None:
        """Report the wraps and resets of the clock that were corrected until now."""
        if self._wrapped:
            size = self._wraps.modulus
            unit = next(name for name, ns in UNITS.items() if ns == self._unit_ns)
            if isinstance(size, float):
                size, unit = size * self._unit_ns / US, "us"
            self._facts.tell(
                f"the clock wrapped{_times(self._wraps.turns)} at 2^{round(np.log2(size))} {unit}"
                f" at {self._wrapped}: counted on"
            )
        if self._reset:
            self._facts.tell(
                f"the clock was set back{_times(self.resets)} by {self._step} s at {self._reset}:"
                " times go on from those before"
            )
        if self._coarse_us > 1:
            self._facts.tell(
                f"times are of single precision: they have steps of up to {self._coarse_us:.3g} us"
            )


def shots_in_order(shots: list[Shot], facts: Facts, disorder: str) -> list[Shot]:
    """Return frames in the order of time, which goes on where the clock was set back.

    `disorder` is told of frames that lie nearer to each other, and are sorted.
    """
    clock = Clock(facts, 1, set_back=CONTINUE, items="frame")
    times = clock.counted(np.array([shot.t_ns for shot in shots], np.int64), str(facts.path))
    clock.tell()
    if np.any(times[1:] < times[:-1]):
        facts.tell(disorder)
    found = [replace(shot, t_ns=t) for shot, t in zip(shots, times.tolist(), strict=True)]
    return sorted(found, key=lambda shot: shot.t_ns)


def _times(count: int) -> str:
    return f" {count} times, first" if count > 1 else ""
