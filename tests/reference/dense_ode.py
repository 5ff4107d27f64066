r"""Dense-ODE truth of the exact pixel: events on the densely integrated signal, roots bracketed.

Thresholds are sought between the extremes of signal minus reference, so that no pair of crossings
is lost, and bracketed to rounding.  Where the answer hangs by a thread it says so: see
:class:`Truth`.  Leak, dead time, second pole and injected events are known; noise on the signal and
the K-step forms are not.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq

from reference.circuit import Array, Circuit, Draws
from reference.dense_signal import Path, around, light_for, solve_signal, turning_points, value

TIE = 1e-7
"""Events whose existence changes when thresholds shift by this much are ties [ln units]."""

TIMING_SHIFT, TIMING_US = 1e-9, 0.5
"""Events that this shift [ln units] moves by this much [us] are ties too: their time is not defined
to a microsecond (a pixel that rests at a level it has all but reached, and then goes on)."""


@dataclass(frozen=True)
class Truth:
    """Events of one pixel.

    Attributes
    ----------
    events : (events, 2)
        Time [s] and polarity, 1 or -1.
    ties : list of float
        Times [s] from which the answer is not defined: a crossing that a shift of the threshold by
        1e-7 makes or unmakes, or whose time a shift of 1e-9 moves by more than 0.5 us.
    valid_until : float
        Events before this time [s] do not depend on any tie; infinity without ties.
    """

    events: Array
    ties: list[float]

    @property
    def valid_until(self) -> float:
        return min(self.ties, default=math.inf)


@dataclass
class _Pixel:
    """Comparator of one pixel on its path."""

    path: Path
    on: float
    off: float
    circuit: Circuit
    injected: Array
    leak_factors: Array | None
    offset: float
    events: list[tuple[float, int]] = field(default_factory=list)
    ties: list[float] = field(default_factory=list)
    near: dict[int, float] = field(default_factory=dict)
    used: int = 0
    release: float = -math.inf
    factor: float = 1.0
    base: float = 0.0

    def __post_init__(self) -> None:
        if self.leak_factors is not None:
            self.factor = float(self.leak_factors[0])
        start = value(self.path.signal[0], -1.0)
        self.set_reference(0, -1.0, start + self.offset)
        reach = np.abs(self.path.signal[:, 1:]).sum(axis=1)
        self.low = self.path.signal[:, 0] - reach
        self.high = self.path.signal[:, 0] + reach

    def leaked(self, k: int, s: float) -> float:
        """Fall of the reference since the beginning at nominal speed [ln units]."""
        return self.on * value(self.path.leak[k], s)

    def set_reference(self, k: int, s: float, reference: float) -> None:
        """Put the reference at segment k, s; it then falls at the present leak speed."""
        self.base = reference + self.factor * self.leaked(k, s)

    def distance(self, k: int) -> Array:
        """Signal minus reference on segment k, as a Chebyshev series."""
        d = self.path.signal[k] + (self.factor * self.on) * self.path.leak[k]
        d[0] -= self.base
        return np.asarray(d)

    def time(self, k: int, s: float) -> float:
        return float(self.path.start[k] + self.path.length[k] * 0.5 * (s + 1))

    def place(self, k: int, t: float) -> float:
        return float(2 * (t - self.path.start[k]) / self.path.length[k] - 1)

    def run(self) -> Truth:
        """Walk over all segments."""
        for k in range(len(self.path.start)):
            if self.path.length[k] > 0:
                self.segment(k)
        self.ties += self.near.values()
        return Truth(np.array(self.events, np.float64).reshape(-1, 2), sorted(self.ties))

    def quiet(self, k: int, end: float) -> bool:
        """Tell whether nothing can happen on segment k, from bounds alone."""
        if self.near or self.release > -math.inf or self.next_time() < end:
            return False
        fall = self.factor * self.leaked(k, 1.0) - self.base
        before = self.factor * self.leaked(k, -1.0) - self.base
        return (
            self.high[k] + max(fall, before) < self.on - TIE
            and self.low[k] + min(fall, before) > -self.off + TIE
        )

    def next_time(self) -> float:
        return float(self.injected[self.used, 0]) if self.used < len(self.injected) else math.inf

    def segment(self, k: int) -> None:
        """Fire the events of segment k."""
        end = self.time(k, 1.0)
        if self.release >= end or self.quiet(k, end):
            return
        s = -1.0
        if self.release > -math.inf:
            s = max(s, self.place(k, self.release))
            self.set_reference(k, s, value(self.path.signal[k], s))
            self.release = -math.inf
        while s < 1.0:
            s = self.until_next_event(k, s)
            if self.release > -math.inf:
                if self.release >= end:
                    return
                s = max(s, self.place(k, self.release))
                self.set_reference(k, s, value(self.path.signal[k], s))
                self.release = -math.inf

    def until_next_event(self, k: int, s: float) -> float:
        """Go on from s to the next event of segment k, or to its end; return where that is."""
        while self.next_time() < self.time(k, s):
            self.used += 1
        s_end = 1.0
        injection = self.next_time() < self.time(k, 1.0)
        if injection:
            s_end = min(1.0, max(s, self.place(k, self.next_time())))
        d = self.distance(k)
        a = s
        for b in [*turning_points(d, s, s_end), s_end]:
            reached = value(d, b)
            for polarity, level in ((1, self.on), (-1, -self.off)):
                if polarity * (reached - level) >= 0:
                    return self.cross(k, d, a, b, polarity, level)
            self.watch(k, d, a, b)
            a = b
        if injection:
            self.inject(k, s_end)
        return s_end

    def cross(self, k: int, d: Array, a: float, b: float, polarity: int, level: float) -> float:
        """Fire where d reaches `level` in (a, b), where it is monotone."""
        s = a
        if polarity * (value(d, a) - level) < 0:
            s = brentq(lambda v: value(d, v) - level, a, b, xtol=1e-15, rtol=1e-14)
        half = TIMING_US * 1e-6 / (0.5 * self.path.length[k])
        timed = (
            polarity * (around(d, s, half) - level) > TIMING_SHIFT
            and polarity * (level - around(d, s, -half)) > TIMING_SHIFT
        )
        if not timed or not self.goes_on(k, b, polarity, level):
            self.ties.append(self.near.get(polarity, self.entry(k, d, a, s, polarity, level)))
        self.near.pop(polarity, None)
        reference = value(self.path.signal[k], s) - value(d, s)
        self.fire(k, s, polarity, reference + level)
        return s

    def goes_on(self, k: int, b: float, polarity: int, level: float) -> bool:
        """Tell whether d, beyond `level` since before b, goes on to TIE past it before it returns.

        b is where d is monotone from the crossing on; factor and base are those of the crossing.
        """
        while k < len(self.path.start):
            d = self.distance(k)
            for s in [*turning_points(d, b, 1.0), 1.0] if b > -1.0 else [1.0]:
                beyond = [polarity * (value(d, v) - level) for v in (b, s)]
                if max(beyond) >= TIE:
                    return True
                if min(beyond) < -TIE:
                    return False
                b = s
            k, b = k + 1, -1.0
        return False

    def entry(self, k: int, d: Array, a: float, b: float, polarity: int, level: float) -> float:
        """Time at which d came within TIE of `level`, less half a microsecond."""
        before: Callable[[float], float] = lambda v: polarity * (value(d, v) - level) + TIE  # noqa: E731
        s = a if before(a) >= 0 or before(b) <= 0 else brentq(before, a, b, xtol=1e-15)
        return self.time(k, s) - TIMING_US * 1e-6

    def watch(self, k: int, d: Array, a: float, b: float) -> None:
        """Note when the signal comes within TIE of a level at b; a tie if it then leaves again."""
        for polarity, level in ((1, self.on), (-1, -self.off)):
            if polarity * (value(d, b) - level) > -TIE:
                self.near.setdefault(polarity, self.entry(k, d, a, b, polarity, level))
            elif polarity in self.near:
                self.ties.append(self.near.pop(polarity))

    def inject(self, k: int, s: float) -> None:
        """Use up the injected event at s."""
        _, uniform, polarity = self.injected[self.used]
        self.used += 1
        share = 0.5 * (s + 1)
        x = self.path.x_start[k] + (self.path.x_end[k] - self.path.x_start[k]) * share
        if uniform < 1 - 0.75 / 255 * float(light_for(x, self.circuit)):
            self.fire(k, s, int(polarity), value(self.path.signal[k], s))

    def fire(self, k: int, s: float, polarity: int, reference: float) -> None:
        """Record an event at s; `reference` holds from there on unless a dead time follows."""
        t = self.time(k, s)
        self.events.append((t, polarity))
        self.ties += self.near.values()
        self.near.clear()
        if self.leak_factors is not None:
            self.factor = float(self.leak_factors[len(self.events)])
        self.set_reference(k, s, reference)
        if self.circuit.dead_time_us is not None:
            self.release = t + self.circuit.dead_time_us * 1e-6


def find_events(paths: list[Path], circuit: Circuit, draws: Draws | None = None) -> list[Truth]:
    """Events of every pixel, on signals solved before.

    Parameters
    ----------
    paths : list of Path
        From :func:`solve_signal` with the same log map, poles and leak rates.
    circuit : Circuit
        Thresholds, dead time.
    draws : Draws, optional
        Injected events, leak factors, offsets of the first reference.
    """
    draws = draws or Draws()
    assert draws.signal_noise is None, "the dense ODE knows no noise on the signal"
    on, off = circuit.levels(len(paths))
    truths = []
    for i, path in enumerate(paths):
        factors = None if draws.leak_factors is None else draws.leak_factors[i]
        injected = np.empty((0, 3)) if draws.injected is None else draws.injected[i]
        offset = 0.0 if draws.reference_offset is None else float(draws.reference_offset[i])
        pixel = _Pixel(path, on[i], off[i], circuit, injected, factors, offset)
        truths.append(pixel.run())
    return truths


def dense_truth(
    light: ArrayLike, times: ArrayLike, circuit: Circuit, draws: Draws | None = None
) -> list[Truth]:
    """Events of every pixel; see :func:`solve_signal` and :func:`find_events`."""
    return find_events(solve_signal(light, times, circuit), circuit, draws)


def as_lists(truths: list[Truth]) -> tuple[list[Array], Array]:
    """Return the events of each pixel, and until when each may be compared [s]."""
    return [t.events for t in truths], np.array([t.valid_until for t in truths])
