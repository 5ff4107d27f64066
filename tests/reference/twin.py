r"""Slow, obvious twin of the whole pixel: many small straight lines, one comparator.

Every form of the low-pass is turned into straight lines of the signal: ``exact`` by classical
Runge-Kutta steps of a few microseconds, the others by their own K steps.  The comparator walks
along each line.  At 4 us and 300 Hz the lines leave the true curve by less than w h^2/8 of its
slope, 4 ns of event time.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from reference.circuit import Array, Circuit, Draws

TIE = 1e-9
"""A level counts as reached this far beyond it: a signal that only approaches it never fires."""


class Line(NamedTuple):
    """Straight line of every pixel's signal; signals and log intensities are (pixels,) arrays."""

    start: float
    end: float
    signal_start: Array
    signal_end: Array
    x_start: Array
    x_end: Array


def log_of(dn: ArrayLike, circuit: Circuit) -> Array:
    """Log intensity of light [DN]."""
    dn = np.asarray(dn, np.float64)
    knee = circuit.linear_below
    if knee == 0:
        return np.log(np.maximum(dn, circuit.floor))
    return np.where(dn < knee, dn * math.log(knee) / knee, np.log(np.maximum(dn, knee)))


def light_of(x: ArrayLike, circuit: Circuit) -> Array:
    """Light [DN] that log intensity x stands for."""
    x = np.asarray(x, np.float64)
    knee = circuit.linear_below
    if knee == 0:
        return np.exp(x)
    return np.where(x < math.log(knee), x * knee / math.log(knee), np.exp(x))


def corner_of(x: ArrayLike, circuit: Circuit) -> Array:
    """Corner of the low-pass at log intensity x [rad/s]."""
    assert circuit.cutoff_hz is not None
    dark, white = circuit.dark_cutoff_hz, circuit.cutoff_hz
    return 2 * math.pi * (dark + (white - dark) * light_of(x, circuit) / 255)


def continuity_samples(x: Array, times: Array, circuit: Circuit) -> tuple[Array, Array]:
    """Sample log intensity K times an interval, as the paper's equation or its correction says.

    Parameters
    ----------
    x : (knots, pixels); times : (knots,)

    Returns
    -------
    samples ((knots - 1) K + 1, pixels) and their times; the first is always the first frame, where
    the poles rest.
    """
    K = circuit.K
    if circuit.update == "exact" and not circuit.printed_last_interval:
        K = 1
    samples, at = [], []
    for m in range(len(x) - 1):
        printed = circuit.printed_last_interval and m % circuit.L == circuit.L - 1
        base = x[m + 1] if printed else x[m]
        for k in range(K):
            samples.append(base + (x[m + 1] - x[m]) * k / K)
            at.append(times[m] + (times[m + 1] - times[m]) * k / K)
    samples[0] = x[0]
    return np.array([*samples, x[-1]]), np.array([*at, times[-1]])


def paper_gain(a: ArrayLike) -> Array:
    """Gain at rest of the printed update, a/(1 - e^-a)."""
    a = np.asarray(a, np.float64)
    return a / -np.expm1(-a)


def stepped(y: Array, x0: Array, x1: Array, h: float, circuit: Circuit) -> Array:
    """Output of the low-pass after one step of h s from x0 to x1, in the K-step forms."""
    if circuit.cutoff_hz is None:
        return x1
    a1 = corner_of(x1, circuit) * h
    if circuit.update == "paper":
        return np.exp(-a1) * y + a1 * x1
    if circuit.update == "zero_order_hold":
        return np.exp(-a1) * y + (1 - np.exp(-a1)) * x1
    if circuit.update == "euler":
        share = np.minimum(1, a1)
        return (1 - share) * y + share * x1
    assert circuit.update == "first_order_hold"
    return ramp_response(y, x0, x1, 0.5 * (corner_of(x0, circuit) * h + a1))


def ramp_response(y: Array, x0: Array, x1: Array, a: ArrayLike) -> Array:
    """Pole with a constant corner after a ramp from x0 to x1; a: corner times length."""
    a = np.maximum(a, 1e-300)
    E = np.exp(-a)
    q = np.where(a < 1e-4, 1 - a / 2 + a * a / 6, -np.expm1(-a) / a)
    return E * y + (q - E) * x0 + (1 - q) * x1


class Noise:
    """Added to the low-pass output: linear between the knots handed in, or zero."""

    def __init__(self, draws: Draws, pixels: int) -> None:
        self.paths, self.zero = draws.signal_noise, np.zeros(pixels)

    def at(self, t: float) -> Array:
        """Return the noise of each pixel at time t [s]."""
        if self.paths is None:
            return self.zero
        return np.array([np.interp(t, times, values) for times, values in self.paths])


def exact_lines(
    samples: Array, at: Array, noise: Noise, step_us: float, circuit: Circuit
) -> Iterator[Line]:
    """Integrate both poles in small Runge-Kutta steps; x is linear between samples."""
    follower = 2 * math.pi * (circuit.follower_hz or 0.0)
    filtered = circuit.cutoff_hz is not None

    def slopes(y: Array, z: Array, x: Array, w: Array, n: Array) -> tuple[Array, Array]:
        return w * (x - y), follower * ((y if filtered else x) + n - z)

    y, z = samples[0], samples[0]
    if not follower:
        z = y + noise.at(at[0])
    for x0, x1, t0, t1 in zip(samples[:-1], samples[1:], at[:-1], at[1:], strict=True):
        steps = math.ceil((t1 - t0) / (step_us * 1e-6))
        h = (t1 - t0) / steps
        xs = x0 + (x1 - x0) * (np.arange(2 * steps + 1) / (2 * steps))[:, None]
        ws = corner_of(xs, circuit) if filtered else np.zeros_like(xs)
        for k in range(steps):
            ta, tb = t0 + k * h, (t0 + (k + 1) * h if k + 1 < steps else t1)
            xa, xm, xb = xs[2 * k : 2 * k + 3]
            wa, wm, wb = ws[2 * k : 2 * k + 3]
            na, nm, nb = noise.at(ta), noise.at(0.5 * (ta + tb)), noise.at(tb)
            dy1, dz1 = slopes(y, z, xa, wa, na)
            dy2, dz2 = slopes(y + 0.5 * h * dy1, z + 0.5 * h * dz1, xm, wm, nm)
            dy3, dz3 = slopes(y + 0.5 * h * dy2, z + 0.5 * h * dz2, xm, wm, nm)
            dy4, dz4 = slopes(y + h * dy3, z + h * dz3, xb, wb, nb)
            before = z
            y = y + h / 6 * (dy1 + 2 * dy2 + 2 * dy3 + dy4)
            z = z + h / 6 * (dz1 + 2 * dz2 + 2 * dz3 + dz4)
            if not follower:
                z = (y if filtered else xb) + nb
            yield Line(ta, tb, before, z, xa, xb)


def stepped_lines(
    samples: Array, at: Array, noise: Noise, fixed_point: bool, circuit: Circuit
) -> Iterator[Line]:
    """One line a continuity sample; the second pole follows the low-pass's line exactly."""
    y = samples[0]
    if fixed_point:
        y = paper_gain(corner_of(y, circuit) * (at[1] - at[0])) * y
    z = y if circuit.follower_hz else y + noise.at(at[0])
    for x0, x1, t0, t1 in zip(samples[:-1], samples[1:], at[:-1], at[1:], strict=True):
        drive, before = y + noise.at(t0), z
        y = stepped(y, x0, x1, t1 - t0, circuit)
        z = y + noise.at(t1)
        if circuit.follower_hz:
            a = 2 * math.pi * circuit.follower_hz * (t1 - t0)
            z = ramp_response(before, drive, z, a)
        yield Line(t0, t1, before, z, x0, x1)


class Comparator:
    """References, dead times and injected events of all pixels, along lines of the signal."""

    def __init__(self, first: Array, circuit: Circuit, draws: Draws, tie: float) -> None:
        pixels = len(first)
        self.circuit, self.draws, self.tie = circuit, draws, tie
        self.on, self.off = circuit.levels(pixels)
        offset = draws.reference_offset
        self.reference = first + (0.0 if offset is None else offset)
        self.release = np.full(pixels, -np.inf)
        self.injected = draws.injected or [np.empty((0, 3))] * pixels
        self.used = [0] * pixels
        self.due = np.array([c[0, 0] if len(c) else np.inf for c in self.injected])
        self.events: list[list[tuple[float, int]]] = [[] for _ in range(pixels)]
        self.factor = np.array([self.leak_factor(i) for i in range(pixels)])

    def leak_factor(self, i: int) -> float:
        """Relative speed of the leak of pixel i after the events it has fired."""
        if self.draws.leak_factors is None:
            return 1.0
        return float(self.draws.leak_factors[i][len(self.events[i])])

    def follow(self, line: Line) -> None:
        """Fire all events on a line."""
        circuit = self.circuit
        fall = np.zeros_like(self.reference)
        if circuit.leak_hz or circuit.photo_leak_hz:
            light = 0.5 * (light_of(line.x_start, circuit) + light_of(line.x_end, circuit))
            fall = (circuit.leak_hz + circuit.photo_leak_hz * light / 255) * self.on
        drop = fall * self.factor * (line.end - line.start)
        high = np.maximum(line.signal_start, line.signal_end)
        low = np.minimum(line.signal_start, line.signal_end)
        busy = (high + drop - self.reference >= self.on) | (self.reference - low >= self.off)
        busy |= (self.release >= line.start) | (self.due < line.end)
        busy &= self.release < line.end
        self.reference[~busy] -= drop[~busy]
        for i in np.flatnonzero(busy):
            self.follow_one(int(i), float(fall[i]), line)

    def follow_one(self, i: int, fall: float, line: Line) -> None:
        """Fire the events of pixel i on a line; fall: of its reference a second, nominal."""
        t, end = line.start, line.end
        za, slope_z = line.signal_start[i], 0.0
        if end > t:
            slope_z = (line.signal_end[i] - za) / (end - t)
        reference = self.reference[i]
        while self.release[i] < end:
            if self.release[i] >= t:
                t = self.release[i]
                reference = za + slope_z * (t - line.start)
                self.release[i] = -np.inf
            distance = za + slope_z * (t - line.start) - reference
            slope = slope_z + fall * self.factor[i]
            t_cross, polarity = math.inf, 0
            if slope > 0:
                t_cross, polarity = t + (self.on[i] + self.tie - distance) / slope, 1
            elif slope < 0:
                t_cross, polarity = t + (-self.off[i] - self.tie - distance) / slope, -1
            t_cross = max(t, t_cross)
            t_noise, noise_polarity = self.next_injected(i, t, line)
            if min(t_cross, t_noise) >= end:
                break
            signal_event = t_cross <= t_noise
            if not signal_event:
                t_cross, polarity = t_noise, noise_polarity
                self.used[i] += 1
            reference -= fall * self.factor[i] * (t_cross - t)
            t = t_cross
            self.events[i].append((t, polarity))
            self.factor[i] = self.leak_factor(i)
            if self.circuit.dead_time_us is not None:
                self.release[i] = t + self.circuit.dead_time_us * 1e-6
            elif signal_event:
                reference += self.on[i] if polarity > 0 else -self.off[i]
            else:
                reference = za + slope_z * (t - line.start)
        self.reference[i] = reference - fall * self.factor[i] * (end - t)
        waiting = self.injected[i][self.used[i] :]
        self.due[i] = waiting[0, 0] if len(waiting) else math.inf

    def next_injected(self, i: int, t: float, line: Line) -> tuple[float, int]:
        """Time and polarity of the next injected event in [t, end) that the light keeps."""
        candidates = self.injected[i]
        found = (math.inf, 0)
        while self.used[i] < len(candidates):
            at, uniform, polarity = candidates[self.used[i]]
            if at >= line.end:
                break
            share = (at - line.start) / (line.end - line.start)
            x = line.x_start[i] + (line.x_end[i] - line.x_start[i]) * share
            kept = uniform < 1 - 0.75 * float(light_of(x, self.circuit)) / 255
            if at >= t and kept:
                found = (float(at), int(polarity))
                break
            self.used[i] += 1
        return found


def simulate_twin(
    light: ArrayLike,
    times: ArrayLike,
    circuit: Circuit,
    draws: Draws | None = None,
    *,
    step_us: float = 4.0,
    fixed_point: bool = False,
    tie: float = TIE,
) -> list[Array]:
    """Events of every pixel.

    Parameters
    ----------
    light : (knots, pixels)
        Light of the (interpolated) frames [DN]; log intensity is linear in time between them.
    times : (knots,)
        Times of the knots [s], increasing.
    circuit, draws
        See :mod:`reference.circuit`; no draws: no noise, leak at its nominal speed.
    step_us : float
        Longest step of ``exact`` [us]; the other forms make K steps an interval.
    fixed_point : bool
        Start ``paper`` at its own fixed point, gain * x, instead of at x.
    tie : float
        How far beyond a level the signal must be to have reached it [ln units].

    Returns
    -------
    per pixel, (events, 2)
        Time [s] and polarity, 1 or -1.
    """
    draws = draws or Draws()
    x = log_of(light, circuit)
    samples, at = continuity_samples(x, np.asarray(times, np.float64), circuit)
    noise = Noise(draws, x.shape[1])
    if circuit.update == "exact":
        lines = exact_lines(samples, at, noise, step_us, circuit)
    else:
        lines = stepped_lines(samples, at, noise, fixed_point, circuit)
    comparator = None
    for line in lines:
        if comparator is None:
            comparator = Comparator(line.signal_start, circuit, draws, tie)
        comparator.follow(line)
    assert comparator is not None
    return [np.array(e, np.float64).reshape(-1, 2) for e in comparator.events]
