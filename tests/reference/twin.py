r"""Slow, obvious twin of the whole pixel: many small straight lines, one comparator.

Every form of the low-pass is turned into straight lines of the signal: ``exact`` by classical
Runge-Kutta steps of a few microseconds, the others by their own K steps.  The comparator walks
along each line.  At 2 us and 300 Hz a line leaves the true curve by less than w h^2/8 of its slope,
1 ns of event time; a dead time carries that on into the next reference, and the slow tail after a
large step can make 0.7 us of it (4 us steps: 2 us).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from reference.circuit import Array, Circuit, Draws
from reference.twin_comparator import Comparator, Line

TIE = 1e-9
"""A level counts as reached this far beyond it: a signal that only approaches it never fires."""


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


def corner_of(light: ArrayLike, circuit: Circuit) -> Array:
    """Corner of the low-pass at a light [rad/s]."""
    assert circuit.cutoff_hz is not None
    dark, white = circuit.dark_cutoff_hz, circuit.cutoff_hz
    return 2 * math.pi * (dark + (white - dark) * np.asarray(light) / 255)


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
    a0 = corner_of(light_of(x0, circuit), circuit) * h
    a1 = corner_of(light_of(x1, circuit), circuit) * h
    if circuit.update == "paper":
        return np.exp(-a1) * y + a1 * x1
    if circuit.update == "zero_order_hold":
        return np.exp(-a1) * y + (1 - np.exp(-a1)) * x1
    if circuit.update == "euler":
        share = np.minimum(1, a1)
        return (1 - share) * y + share * x1
    assert circuit.update == "first_order_hold"
    return ramp_response(y, x0, x1, 0.5 * (a0 + a1))


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
    seen = noise.at(at[0]) if not follower else noise.zero  # as the comparator sees it
    if not follower:
        z = y + noise.at(at[0])
    for x0, x1, t0, t1 in zip(samples[:-1], samples[1:], at[:-1], at[1:], strict=True):
        steps = math.ceil((t1 - t0) / (step_us * 1e-6))
        h = (t1 - t0) / steps
        xs = x0 + (x1 - x0) * (np.arange(2 * steps + 1) / (2 * steps))[:, None]
        lights = light_of(xs, circuit)
        ws = corner_of(lights, circuit) if filtered else np.zeros_like(xs)
        for k in range(steps):
            ta, tb = t0 + k * h, (t0 + (k + 1) * h if k + 1 < steps else t1)
            xa, xm, xb = xs[2 * k : 2 * k + 3]
            wa, wm, wb = ws[2 * k : 2 * k + 3]
            na, nm, nb = noise.at(ta), noise.at(0.5 * (ta + tb)), noise.at(tb)
            dy1, dz1 = slopes(y, z, xa, wa, na)
            dy2, dz2 = slopes(y + 0.5 * h * dy1, z + 0.5 * h * dz1, xm, wm, nm)
            dy3, dz3 = slopes(y + 0.5 * h * dy2, z + 0.5 * h * dz2, xm, wm, nm)
            dy4, dz4 = slopes(y + h * dy3, z + h * dz3, xb, wb, nb)
            before, seen_before = z, seen
            y = y + h / 6 * (dy1 + 2 * dy2 + 2 * dy3 + dy4)
            z = z + h / 6 * (dz1 + 2 * dz2 + 2 * dz3 + dz4)
            if not follower:
                z, seen = (y if filtered else xb) + nb, nb
            elif noise.paths is not None:
                seen = ramp_response(seen, na, nb, follower * h)
            yield Line(ta, tb, before, z, lights[2 * k], lights[2 * k + 2], seen_before, seen)


def stepped_lines(
    samples: Array, at: Array, noise: Noise, fixed_point: bool, circuit: Circuit
) -> Iterator[Line]:
    """One line a continuity sample; the second pole follows the low-pass's line exactly."""
    y = samples[0]
    if fixed_point:
        y = paper_gain(corner_of(light_of(y, circuit), circuit) * (at[1] - at[0])) * y
    z = y if circuit.follower_hz else y + noise.at(at[0])
    seen = noise.zero if circuit.follower_hz else noise.at(at[0])
    for x0, x1, t0, t1 in zip(samples[:-1], samples[1:], at[:-1], at[1:], strict=True):
        drive, before, seen_before = y + noise.at(t0), z, seen
        y = stepped(y, x0, x1, t1 - t0, circuit)
        z, seen = y + noise.at(t1), noise.at(t1)
        if circuit.follower_hz:
            a = 2 * math.pi * circuit.follower_hz * (t1 - t0)
            z = ramp_response(before, drive, z, a)
            seen = ramp_response(seen_before, noise.at(t0), seen, a)
        lights = light_of(x0, circuit), light_of(x1, circuit)
        yield Line(t0, t1, before, z, *lights, seen_before, seen)


def run_twin(
    light: ArrayLike,
    times: ArrayLike,
    circuit: Circuit,
    draws: Draws | None = None,
    *,
    step_us: float = 2.0,
    fixed_point: bool = False,
    tie: float = TIE,
) -> Comparator:
    """Return the comparator after all; see `simulate_twin`."""
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
            comparator = Comparator(line, circuit, draws, tie)
        comparator.follow(line)
    assert comparator is not None
    return comparator


def simulate_twin(
    light: ArrayLike,
    times: ArrayLike,
    circuit: Circuit,
    draws: Draws | None = None,
    *,
    step_us: float = 2.0,
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
    options = {"step_us": step_us, "fixed_point": fixed_point, "tie": tie}
    return events_of(run_twin(light, times, circuit, draws, **options))


def events_of(comparator: Comparator) -> list[Array]:
    """Return the events of every pixel, (events, 2)."""
    return [np.array(e, np.float64).reshape(-1, 2) for e in comparator.events]


def moves_of_twin(*arguments: Any, **options: Any) -> tuple[list[Array], list[Array]]:
    """Return what `simulate_twin` does, and what moved each event's pixel since its reset.

    The latter, per pixel, (events, 3): see :class:`reference.twin_comparator.Moves`.
    """
    comparator = run_twin(*arguments, **options)
    moves = [np.array(m, np.float64).reshape(-1, 3) for m in comparator.moves]
    return events_of(comparator), moves
