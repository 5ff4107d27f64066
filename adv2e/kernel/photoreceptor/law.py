"""The moments of photoreceptor noise by the corner of a pixel, as tables for the compiled code.

Corners that share the exponent and the first seven bits of a single precision number share an
entry: each is right to 0.4 %.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from adv2e.kernel.circuit import Circuit, fastest_corner

SHIFT = 16
"""Bits of a corner in single precision that its entry does not depend on."""

MOST_CELLS = 4096
"""Most cells of a piece."""

COARSE = 9
(KEPT_N, GIVEN, KEPT_S, BY_N, BY_N_S, BY_S, BEND, PULL, REACH) = range(COARSE)
"""Columns of the coarse table, from one sample to the next: what n keeps, what s takes of n, what s
keeps; the factors of two normal numbers; how far the mean bends between for each of n - s, what it
is drawn to zero, and how far the rest may reach."""

FINE = 5
(CELL_N, CELL_GIVEN, CELL_S, SHARE, CELL_REACH) = range(FINE)
"""Columns of the fine table: the first three for a cell, the share of variance behind both poles,
and how far the bridge over a cell may reach.  Over n cells it reaches at most n^(3/2) times as far,
behind one pole n^(1/2) times."""

_SURE = 6.0
"""Standard deviations that the bridge does not leave: one of a billion does."""

_CLEAR, _LEAST = 5.5, 0.7
"""How far the bridge may reach, in standard deviations of the noise: so that noise below _CLEAR of
them stays clear of a threshold, but at least _LEAST.  More samples cost as much as they save."""

_FINE = 0.015
"""Standard deviation of what cells leave out behind two poles, as a share of that of the noise.
The share of events that this loses is about as small."""

_SLOWEST, _BRIGHTEST = 2.0**-12, 1000.0
_INNER = np.arange(1, 8) / 8.0
_CELLS_BETWEEN = (
    2, 3, 4, 5, 6, 8, 10, 12, 16, 20, 24, 32, 48, 64, 96, 128, 192, 256, 384, 512, 1024,
)  # fmt: skip
"""Tried between two samples, where one is too few."""


class Laws(NamedTuple):
    """Tables of some lengths of pieces."""

    lowest: int  # bits of the corner of the first entry
    samples: NDArray[np.int64]  # (lengths, entries) of a piece
    cells: NDArray[np.int64]  # (lengths, entries) between two samples
    coarse: NDArray[np.float32]  # (lengths, entries, COARSE)
    fine: NDArray[np.float64]  # (lengths, entries, FINE)


class Noise(NamedTuple):
    """What the tables follow from, but for the length."""

    dark: float  # corner of the low-pass in darkness [rad/us],
    fastest: float  # at white or in darkness, whichever is faster,
    follower: float  # and of the second pole
    rms: float
    cell: float  # longest cell behind one pole [us]
    level: float  # the lower threshold [ln]


def noise_of(circuit: Circuit, level: float, longest: float) -> Noise:
    """Return what tables follow from; cells are at most `longest` us, whatever the circuit says."""
    fastest = fastest_corner(circuit)
    cell = min(circuit.noise_step / fastest, longest)
    return Noise(circuit.dark, fastest, circuit.follower, circuit.noise_rms, cell, level)


def laws_for(lengths: NDArray[np.float64], noise: Noise) -> Laws:
    """Return the tables for pieces of these lengths [us], (lengths,)."""
    tables = [_table(length, noise) for length in lengths.tolist()]
    stacked = [np.stack(column) for column in zip(*tables, strict=True)]
    return Laws(_entries(noise)[0], *stacked)


def no_laws() -> Laws:
    """Return what stands in the place of tables where there is no noise."""
    return Laws(
        0, np.zeros((1, 0), np.int64), np.zeros((1, 0), np.int64),
        np.zeros((1, 0, COARSE), np.float32), np.zeros((1, 0, FINE)),
    )  # fmt: skip


def cells_of(length: float, noise: Noise) -> float:
    """Return how many cells the fastest pixel needs in `length` us, white being the brightest."""
    return float(_needed(length, np.array([noise.fastest]), noise)[0])


def _entries(noise: Noise) -> tuple[int, NDArray[np.float64]]:
    """Return the bits of the first corner, and the corner of each entry [rad/us]."""
    slowest = max(noise.dark, noise.fastest * _SLOWEST)
    ends = np.array([slowest, noise.fastest * _BRIGHTEST], np.float32).view(np.int32) >> SHIFT
    bits = np.arange(ends[0], ends[1] + 1, dtype=np.int32)
    middle = (bits << SHIFT) | (1 << (SHIFT - 1))
    return int(ends[0]), middle.view(np.float32).astype(float)


def _needed(length: float, corner: NDArray[Any], noise: Noise) -> NDArray[Any]:
    """Return how many cells are needed in `length` us.

    Behind one pole the noise is a line in each, so that their length is a part of the model.
    Behind two, it is a cubic but for h^3 w b (w + b)/96 of its variance.
    """
    if noise.follower == 0.0:
        return np.full(corner.shape, math.ceil(length / noise.cell))
    b = noise.follower
    return np.ceil(length * np.cbrt(corner * b * (corner + b) / (96.0 * _FINE**2)))


class Step(NamedTuple):
    """From one instant to another, for each corner: means and covariances, of noise of rms 1."""

    kept_n: NDArray[Any]
    given: NDArray[Any]
    kept_s: NDArray[Any]
    nn: NDArray[Any]
    ns: NDArray[Any]
    ss: NDArray[Any]


def step_over(h: NDArray[Any], w: NDArray[Any], b: float) -> Step:
    """Return what (n, s) becomes over `h` us; without a second pole (b = 0), s is 0."""
    a, beta = w * h, b * h
    kept_n, kept_s = np.exp(-a), np.exp(-beta)
    apart = np.abs(a - beta)
    given = beta * np.exp(-np.minimum(a, beta))
    given = given * np.where(apart > 1e-12, -np.expm1(-apart) / np.maximum(apart, 1e-12), 1.0)
    share = b / (w + b)
    nn = -np.expm1(-2.0 * a)
    ns = share - kept_n * (given + kept_s * share)
    ss = share - (given**2 + 2.0 * given * kept_s * share + kept_s**2 * share)
    return Step(kept_n, given, kept_s, nn, np.maximum(ns, 0.0), np.maximum(ss, 0.0))


def _bridge(
    t: float, h: NDArray[Any], w: NDArray[Any], b: float
) -> tuple[NDArray[Any], list[NDArray[Any]]]:
    """Return variance, and weights in the mean, of what is seen at share t between two samples.

    The weights are those of n and s at the start, and at the end.
    """
    first, rest, whole = (step_over(part * h, w, b) for part in (t, 1.0 - t, 1.0))
    if b == 0.0:
        by_end = first.nn * rest.kept_n / whole.nn
        none = np.zeros_like(by_end)
        return first.nn * (1.0 - by_end * rest.kept_n), [
            first.kept_n - by_end * whole.kept_n, none, by_end, none,
        ]  # fmt: skip
    # covariance of s at t with (n, s) at the end, and from it the gain
    cn = first.ns * rest.kept_n
    cs = first.ns * rest.given + first.ss * rest.kept_s
    size = np.maximum(whole.nn * whole.ss - whole.ns**2, 1e-300)
    gn = (cn * whole.ss - cs * whole.ns) / size
    gs = (cs * whole.nn - cn * whole.ns) / size
    variance = np.maximum(first.ss - gn * cn - gs * cs, 0.0)
    by_n = first.given - gn * whole.kept_n - gs * whole.given
    by_s = first.kept_s - gs * whole.kept_s
    return variance, [by_n, by_s, gn, gs]


@lru_cache(maxsize=64)
def _table(length: float, noise: Noise) -> tuple[NDArray[Any], ...]:
    """Return samples, cells, coarse and fine table of a piece of `length` us."""
    w = _entries(noise)[1]
    b = noise.follower
    share = b / (w + b) if b > 0.0 else np.ones_like(w)
    seen = np.sqrt(share)
    needed = np.clip(_needed(length, w, noise), 1, MOST_CELLS).astype(np.int64)
    far = np.maximum(noise.level / (noise.rms * seen) - _CLEAR, _LEAST) * seen
    cells, samples = np.ones_like(needed), needed.copy()
    for between in _CELLS_BETWEEN:
        count = -(-needed // between)
        reach = _SURE * np.sqrt(_bridge(0.5, length / count, w, b)[0])
        good = (reach <= far) & (between <= needed)
        cells[good], samples[good] = between, count[good]
    h = length / samples
    bend, pull, reach = (np.zeros_like(w) for _ in range(3))
    for t in _INNER.tolist():
        variance, (n0, s0, n1, s1) = _bridge(t, h, w, b)
        if b > 0.0:
            bend = np.maximum(bend, np.maximum(np.abs(n0), np.abs(n1)))
        of_ends = n0 + s0 + n1 + s1
        pull = np.maximum(pull, 1.0 - of_ends)
        # where the means of both poles do not fall towards zero, what they rise is in the reach
        more = np.maximum(of_ends - 1.0, 0.0) * _SURE * seen
        reach = np.maximum(reach, _SURE * np.sqrt(variance) + more)
    alone = cells == 1  # nothing is drawn between
    reach[alone] = 0.0
    bend[alone & (b == 0.0)], pull[alone & (b == 0.0)] = 0.0, 0.0
    step = step_over(h, w, b)
    by_n = np.sqrt(step.nn)
    by_n_s = step.ns / by_n
    by_s = np.sqrt(np.maximum(step.ss - by_n_s**2, 0.0))
    rms = noise.rms
    coarse = np.stack(
        [step.kept_n, step.given, step.kept_s, rms * by_n, rms * by_n_s, rms * by_s, bend,
         np.clip(pull, 0.0, 1.0), rms * reach], axis=1,
    )  # fmt: skip
    cell = step_over(h / cells, w, b)
    of_cell = rms * _SURE * np.sqrt(_bridge(0.5, h / cells, w, b)[0])
    fine = np.stack([cell.kept_n, cell.given, cell.kept_s, share, of_cell], axis=1)
    return samples, cells, np.ascontiguousarray(coarse, np.float32), np.ascontiguousarray(fine)
