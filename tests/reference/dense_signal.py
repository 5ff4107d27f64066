r"""Filtered signal of the exact pixel, by dense integration of the circuit's equations.

.. math:: \dot y = 2\pi f(t)\,(x - y), \qquad \dot z = 2\pi f_s\,(y - z), \qquad
          \dot\ell = R_0 + R_1\,DN/255

for all pixels at once by DOP853 with rtol 1e-12, piece by piece (a piece ends at each knot, and
where x passes the knee of the log map).  None of the three feels the events, so one solution
serves any thresholds, dead time and injected events.  Each solver step's own interpolant is a
polynomial of degree 7, kept as a Chebyshev series.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import solve_ivp

from reference.circuit import Array, Circuit

DEGREE = 7
"""Degree of DOP853's interpolant."""

_NODES = np.cos(math.pi * (np.arange(DEGREE + 1) + 0.5) / (DEGREE + 1))
_FROM_NODES = np.linalg.inv(chebyshev.chebvander(_NODES, DEGREE))


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
