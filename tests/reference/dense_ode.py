r"""Dense-ODE truth of the exact pixel: the circuit's equations integrated, roots bracketed.

.. math:: \dot y = 2\pi f(t)\,(x - y), \qquad \dot z = 2\pi f_s\,(y - z), \qquad
          \dot\ell = R_0 + R_1\,DN/255

for all pixels at once by DOP853 with rtol 1e-12, piece by piece (a piece ends at each knot, and
where x passes the knee of the log map).  None of the three feels the events, so one solution
serves any thresholds, dead time and injected events.  Each solver step's own interpolant is a
polynomial of degree 7; thresholds are sought between its extremes, so that no pair of crossings is
lost, and bracketed to rounding.

Where the answer hangs by a thread it says so: see :class:`Truth`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from reference.circuit import Array, Circuit, Draws

DEGREE = 7
"""Degree of DOP853's interpolant."""

TIE = 1e-7
"""Events whose existence changes when thresholds shift by this much are ties [ln units]."""

TIMING_SHIFT, TIMING_US = 1e-9, 0.5
"""Events that this shift [ln units] moves by this much [us] are ties too: their time is not defined
to a microsecond (a pixel that rests at a level it has all but reached, and then goes on)."""

_NODES = np.cos(math.pi * (np.arange(DEGREE + 1) + 0.5) / (DEGREE + 1))
_FROM_NODES = np.linalg.inv(chebyshev.chebvander(_NODES, DEGREE))


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
class Path:
    """Signal of one pixel as polynomials: Chebyshev coefficients, (DEGREE + 1,) a segment.

    Attributes
    ----------
    start, length : (segments,)
        [s]
    signal : (segments, DEGREE + 1)
        Filtered log intensity.
    leak : (segments, DEGREE + 1)
        Integral of the leak rate since the beginning [events].
    x_start, x_end : (segments,)
        Log intensity before the filter, linear inside a segment.
    """

    start: Array
    length: Array
    signal: Array
    leak: Array
    x_start: Array
    x_end: Array


# --------------------------------------------------------------------------- log map and corner


def log_intensity(dn: ArrayLike, circuit: Circuit) -> Array:
    """Log intensity of light [DN]."""
    light = np.asarray(dn, np.float64)
    if circuit.linear_below == 0:
        return np.log(np.maximum(light, circuit.floor))
    foot = light < circuit.linear_below
    slope = math.log(circuit.linear_below) / circuit.linear_below
    out = np.log(np.where(foot, 1.0, light))
    out[foot] = slope * light[foot]
    return out


def light_for(x: Array, circuit: Circuit) -> Array:
    """Light [DN] for log intensity x."""
    if circuit.linear_below == 0:
        return np.exp(x)
    knee = math.log(circuit.linear_below)
    return np.where(x < knee, x * (circuit.linear_below / knee), np.exp(x))


def corner(light: Array, circuit: Circuit) -> Array:
    """Corner of the low-pass [rad/s]."""
    assert circuit.cutoff_hz is not None
    rise = (circuit.cutoff_hz - circuit.dark_cutoff_hz) / 255.0
    return 2 * math.pi * (circuit.dark_cutoff_hz + rise * light)


# ------------------------------------------------------------------------------ signal as pieces


def pieces_of(x: Array, times: Array, circuit: Circuit) -> list[tuple[float, float, float, float]]:
    """Cut one pixel's x(t) at knots and at the knee: (start, length, x at start, x at end)."""
    knee = math.log(circuit.linear_below) if circuit.linear_below else -math.inf
    pieces = []
    for xa, xb, ta, tb in zip(x[:-1], x[1:], times[:-1], times[1:], strict=True):
        if (xa - knee) * (xb - knee) < 0:
            tk = ta + (tb - ta) * (knee - xa) / (xb - xa)
            pieces += [(ta, tk - ta, xa, knee), (tk, tb - tk, knee, xb)]
        else:
            pieces.append((ta, tb - ta, xa, xb))
    return pieces


def solve_signal(
    light: ArrayLike, times: ArrayLike, circuit: Circuit, *, rtol: float = 1e-12
) -> list[Path]:
    """Integrate the circuit for every pixel.

    Parameters
    ----------
    light : (knots, pixels)
        Light [DN]; log intensity is linear in time between knots.
    times : (knots,)
        [s], increasing.
    circuit : Circuit
        Thresholds and dead time do not matter here.
    rtol : float
        Relative tolerance of the solver a step.
    """
    assert circuit.update == "exact"
    assert not circuit.printed_last_interval
    x, at = log_intensity(light, circuit), np.asarray(times, np.float64)
    pixels = x.shape[1]
    cut = [pieces_of(x[:, i], at, circuit) for i in range(pixels)]
    state = np.stack([x[0], x[0], np.zeros(pixels)])
    segments: list[list[tuple[float, float, float, float, Array, Array]]]
    segments = [[] for _ in range(pixels)]
    for rank in range(max(map(len, cut))):
        active = [i for i in range(pixels) if len(cut[i]) > rank]
        start, length, xa, xb = np.array([cut[i][rank] for i in active]).T
        for s0, s1, signal, leak in _solve_piece(
            state, np.array(active), length, xa, xb, circuit, rtol
        ):
            for j, i in enumerate(active):
                segments[i].append((
                    start[j] + s0 * length[j],
                    (s1 - s0) * length[j],
                    xa[j] + (xb[j] - xa[j]) * s0,
                    xa[j] + (xb[j] - xa[j]) * s1,
                    signal[:, j],
                    leak[:, j],
                ))  # fmt: skip
    paths = []
    for rows in segments:
        t, h, x0, x1, z, leak = (np.array(column) for column in zip(*rows, strict=True))
        paths.append(Path(t, h, z, leak, x0, x1))
    return paths


def _solve_piece(
    state: Array, active: NDArray[np.int64], length: Array, xa: Array, xb: Array, circuit: Circuit,
    rtol: float,
) -> Iterator[tuple[float, float, Array, Array]]:  # fmt: skip
    """Move `state` (y, z, leak) of the active pixels over one piece each.

    Yields each solver step, as shares of the piece, with the coefficients (DEGREE + 1, active) of
    signal and leak.
    """
    count = len(active)
    dx = xb - xa
    follower = 2 * math.pi * (circuit.follower_hz or 0.0)
    leaks = circuit.leak_hz > 0 or circuit.photo_leak_hz > 0

    def slope(s: float, flat: Array) -> Array:
        v = flat.reshape(-1, count)
        x = xa + dx * s
        light = light_for(x, circuit)
        rows = [dx if circuit.cutoff_hz is None else length * corner(light, circuit) * (x - v[0])]
        if follower:
            rows.append(length * follower * (v[0] - v[1]))
        if leaks:
            rows.append(length * (circuit.leak_hz + circuit.photo_leak_hz / 255 * light))
        return np.concatenate(rows)

    used = [True, follower > 0, leaks]
    solution = solve_ivp(
        slope, (0.0, 1.0), state[used][:, active].ravel(), method="DOP853", rtol=rtol, atol=1e-13,
        dense_output=True,
    )  # fmt: skip
    assert solution.success, solution.message
    for s0, s1, interpolant in zip(
        solution.t[:-1], solution.t[1:], solution.sol.interpolants, strict=True
    ):
        at_nodes = interpolant(s0 + (s1 - s0) * 0.5 * (_NODES + 1)).reshape(-1, count, DEGREE + 1)
        coefficients = np.einsum("kn,rcn->rkc", _FROM_NODES, at_nodes)
        leak = coefficients[-1] if leaks else np.zeros((DEGREE + 1, count))
        yield float(s0), float(s1), coefficients[1 if follower else 0], leak
    for row, values in zip(np.flatnonzero(used), solution.y[:, -1].reshape(-1, count), strict=True):
        state[row, active] = values


# ---------------------------------------------------------------------------------- polynomials


def value(c: Array, s: float) -> float:
    """Chebyshev series at s, by Clenshaw's recurrence."""
    b1 = b2 = 0.0
    for a in c[:0:-1].tolist():
        b1, b2 = 2 * s * b1 - b2 + a, b1
    return float(s * b1 - b2 + c[0])


def turning_points(c: Array, low: float, high: float) -> list[float]:
    """Where a Chebyshev series turns inside (low, high), in order."""
    slope = chebyshev.chebder(c)
    slope = chebyshev.chebtrim(slope, 1e-15 * float(np.abs(c).max()))
    if len(slope) < 2:
        return []
    roots = chebyshev.chebroots(slope)
    real = np.sort(roots.real[np.abs(roots.imag) < 1e-7])
    return [float(s) for s in real if low < s < high]


def around(c: Array, s: float, ds: float) -> float:
    """Series at s + ds; outside its segment along the tangent at the border."""
    inside = min(1.0, max(-1.0, s + ds))
    beyond = s + ds - inside
    result = value(c, inside)
    return result + beyond * value(chebyshev.chebder(c), inside) if beyond else result


# ----------------------------------------------------------------------------------- comparator


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
