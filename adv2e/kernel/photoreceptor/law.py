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

from adv2e.kernel.inputs import Circuit, fastest_corner

SHIFT = 16
"""Bits of a corner in single precision that its entry does not depend on."""

MOST_CELLS = 256
"""Most cells of a piece."""

CELLS_AT_WHITE = 128
"""Most cells of a piece for white: brighter pixels need more."""

COARSE = 9
(KEPT_N, GIVEN, KEPT_S, BY_N, BY_N_S, BY_S, BEND, PULL, REACH) = range(COARSE)
"""Columns of the coarse table, from one sample to the next: weight of n in n, of n in s, of s in s;
factors of two normal numbers; and bounds between them: bend of the mean for each of n - s, pull of
the mean to zero, reach of the bridge about its mean."""

FINE = 11
(N_OF_N0, N_OF_S0, N_OF_N1, N_OF_S1, S_OF_N0, S_OF_S0, S_OF_N1, S_OF_S1, NEW_N, NEW_N_S, NEW_S) = (
    range(FINE)
)
"""Columns of the fine table, for the middle of 2, 4, 8 ... cells: weights of n and s at both ends
in the means of n and s there, and the factors of two normal numbers."""

_SURE = 6.0
"""Standard deviations that the bridge does not leave: one of a billion does."""

_CLEAR, _LEAST = 4.5, 1.0
"""Reach of the bridge, in standard deviations of the noise: noise below _CLEAR of them stays clear
of a threshold; at least _LEAST.  More samples cost as much as they save."""

_FINE = 0.015
"""Standard deviation of the noise that cells leave out behind two poles, as a share of that of all
noise.  The share of events that this loses is about as small."""

_SLOWEST, _BRIGHTEST = 2.0**-12, 1000.0
_INNER = np.arange(1, 8) / 8.0
_COUNTS = 1 << np.arange(9)
"""Cells of a piece behind two poles: those between two samples are drawn by halves."""

MOST_LEVELS = 8
"""Most levels of halving between two samples."""


class Laws(NamedTuple):
    """Tables of some lengths of pieces."""

    lowest: int  # bits of the corner of the first entry
    samples: NDArray[np.int64]  # (lengths,) of a piece
    levels: NDArray[np.int64]  # (lengths, entries): 2^levels cells lie between two samples
    coarse: NDArray[np.float32]  # (lengths, entries, COARSE)
    fine: NDArray[np.float32]  # (lengths, entries, levels, FINE)


class NoiseTerms(NamedTuple):
    """Parameters of the noise that the tables depend on, besides the length of a piece."""

    dark: float  # corner of the low-pass in darkness [rad/us],
    fastest: float  # at white or in darkness, whichever is faster,
    follower: float  # and of the second pole
    rms: float
    cell: float  # longest cell behind one pole [us]
    level: float  # the lower threshold [ln]


def noise_of(circuit: Circuit, level: float, longest: float) -> NoiseTerms:
    """Return the parameters of the noise, with cells of at most `longest` us."""
    fastest = fastest_corner(circuit)
    cell = min(circuit.noise_step / fastest, longest)
    return NoiseTerms(circuit.dark, fastest, circuit.follower, circuit.noise_rms, cell, level)


def laws_for(lengths: tuple[float, ...], noise: NoiseTerms) -> Laws:
    """Return the tables for pieces of these lengths [us]."""
    tables = [_table(length, noise) for length in lengths]
    samples, levels, coarse, fine = (np.stack(columns) for columns in zip(*tables, strict=True))
    deepest = max(int(levels.max()), 1)
    return Laws(
        _entries(noise)[0], samples, levels, coarse, np.ascontiguousarray(fine[:, :, :deepest])
    )


def no_laws() -> Laws:
    """Return empty tables, for a circuit without photoreceptor noise."""
    return Laws(
        0, np.zeros(0, np.int64), np.zeros((1, 0), np.int64), np.zeros((1, 0, COARSE), np.float32),
        np.zeros((1, 0, 1, FINE), np.float32),
    )  # fmt: skip


def cells_of(length: float, noise: NoiseTerms) -> float:
    """Return the number of cells that the fastest pixel needs in `length` us, up to white."""
    return float(_needed(length, np.array([noise.fastest]), noise)[0])


def _entries(noise: NoiseTerms) -> tuple[int, NDArray[np.float64]]:
    """Return the bits of the first corner, and the corner of each entry [rad/us]."""
    slowest = max(noise.dark, noise.fastest * _SLOWEST)
    ends = np.array([slowest, noise.fastest * _BRIGHTEST], np.float32).view(np.int32) >> SHIFT
    bits = np.arange(ends[0], ends[1] + 1, dtype=np.int32)
    middle = (bits << SHIFT) | (1 << (SHIFT - 1))
    return int(ends[0]), middle.view(np.float32).astype(float)


def _needed(length: float, corner: NDArray[Any], noise: NoiseTerms) -> NDArray[Any]:
    """Return the number of cells that each corner needs in `length` us.

    Behind one pole the noise is a line in each cell, so that the length of cells is a part of the
    model.  Behind two, it is a cubic but for h^3 w b (w + b)/96 of its variance.
    """
    if noise.follower == 0.0:
        return np.full(corner.shape, math.ceil(length / noise.cell))
    b = noise.follower
    return np.ceil(length * np.cbrt(corner * b * (corner + b) / (96.0 * _FINE**2)))


class Moments(NamedTuple):
    """Moments from one instant to another, for each corner: of noise of rms 1."""

    kept_n: NDArray[Any]
    given: NDArray[Any]
    kept_s: NDArray[Any]
    nn: NDArray[Any]
    ns: NDArray[Any]
    ss: NDArray[Any]


def step_over(h: NDArray[Any], w: NDArray[Any], b: float) -> Moments:
    """Return the moments of (n, s) after `h` us; without a second pole (b = 0), s is 0."""
    a, beta = w * h, b * h
    kept_n, kept_s = np.exp(-a), np.exp(-beta)
    apart = np.abs(a - beta)
    given = beta * np.exp(-np.minimum(a, beta))
    given = given * np.where(apart > 1e-12, -np.expm1(-apart) / np.maximum(apart, 1e-12), 1.0)
    share = b / (w + b)
    nn = -np.expm1(-2.0 * a)
    ns = share - kept_n * (given + kept_s * share)
    ss = share - (given**2 + 2.0 * given * kept_s * share + kept_s**2 * share)
    return Moments(kept_n, given, kept_s, nn, np.maximum(ns, 0.0), np.maximum(ss, 0.0))


class Bridge(NamedTuple):
    """Moments at an instant, given those before and after it, for each corner; noise of rms 1."""

    n: list[NDArray[Any]]  # weights of n and s at the start, and at the end, in the mean of n
    s: list[NDArray[Any]]  # and in that of s
    nn: NDArray[Any]  # covariances
    ns: NDArray[Any]
    ss: NDArray[Any]


def bridge_over(t: float, h: NDArray[Any], w: NDArray[Any], b: float) -> Bridge:
    """Return the moments at share t of `h` us, given both ends; without a second pole s is n."""
    first, rest, whole = (step_over(part * h, w, b) for part in (t, 1.0 - t, 1.0))
    if b == 0.0:
        by_end = first.nn * rest.kept_n / whole.nn
        none = np.zeros_like(by_end)
        weights = [first.kept_n - by_end * whole.kept_n, none, by_end, none]
        left = first.nn * (1.0 - by_end * rest.kept_n)
        return Bridge(weights, weights, left, left, left)
    size = np.maximum(whole.nn * whole.ss - whole.ns**2, 1e-300)
    # covariances of n, and of s, there with both at the end, and from them the gains
    n_n, n_s = first.nn * rest.kept_n, first.nn * rest.given + first.ns * rest.kept_s
    s_n, s_s = first.ns * rest.kept_n, first.ns * rest.given + first.ss * rest.kept_s
    k_nn, k_ns = (n_n * whole.ss - n_s * whole.ns) / size, (n_s * whole.nn - n_n * whole.ns) / size
    k_sn, k_ss = (s_n * whole.ss - s_s * whole.ns) / size, (s_s * whole.nn - s_n * whole.ns) / size
    return Bridge(
        [first.kept_n - k_nn * whole.kept_n - k_ns * whole.given, -k_ns * whole.kept_s, k_nn, k_ns],
        [
            first.given - k_sn * whole.kept_n - k_ss * whole.given,
            first.kept_s - k_ss * whole.kept_s, k_sn, k_ss,
        ],
        np.maximum(first.nn - k_nn * n_n - k_ns * n_s, 0.0),
        first.ns - k_sn * n_n - k_ss * n_s,
        np.maximum(first.ss - k_sn * s_n - k_ss * s_s, 0.0),
    )  # fmt: skip


def _factors(nn: NDArray[Any], ns: NDArray[Any], ss: NDArray[Any]) -> list[NDArray[Any]]:
    """Return the factors of two normal numbers that have these covariances."""
    by_n = np.sqrt(nn)
    by_n_s = ns / np.maximum(by_n, 1e-150)
    return [by_n, by_n_s, np.sqrt(np.maximum(ss - by_n_s**2, 0.0))]


@lru_cache(maxsize=64)
def _table(length: float, noise: NoiseTerms) -> tuple[NDArray[Any], ...]:
    """Return the samples of a piece, the levels of each entry, coarse and fine table.

    length : of the piece [us]
    """
    w = _entries(noise)[1]
    b, rms = noise.follower, noise.rms
    share = b / (w + b) if b > 0.0 else np.ones_like(w)
    seen = np.sqrt(share)
    needed = np.minimum(_needed(length, w, noise), MOST_CELLS)
    cells = _COUNTS[np.searchsorted(_COUNTS, needed)]
    if b == 0.0:  # as many in all pixels, and their length matters
        part = 1 << int(math.log2(max(needed[0] / 12, 1)))
        cells = (-(-needed // part) * part).astype(np.int64)
    far = np.maximum(noise.level / (rms * seen) - _CLEAR, _LEAST) * seen
    levels = np.zeros_like(cells)
    for level in range(1, MOST_LEVELS + 1):
        count = 1 << level
        reach = _SURE * np.sqrt(bridge_over(0.5, length * count / cells, w, b).ss)
        levels[(reach <= far) & (cells % count == 0)] = level
    # as many samples in all pixels: loops over a strip have no branches
    samples = (cells >> levels)[w <= max(w[0], noise.fastest)].max()
    if b == 0.0 and samples % 2 == 0:  # half of what white takes: darker pixels need less
        samples //= 2
    cells = np.maximum(cells, samples)
    levels = np.log2(cells // samples).astype(np.int64)
    h = np.full_like(w, length / samples)
    bend, pull, reach = (np.zeros_like(w) for _ in range(3))
    for t in _INNER.tolist():
        between = bridge_over(t, h, w, b)
        n0, s0, n1, s1 = between.s
        if b > 0.0:
            bend = np.maximum(bend, np.maximum(np.abs(n0), np.abs(n1)))
        of_ends = n0 + s0 + n1 + s1
        pull = np.maximum(pull, 1.0 - of_ends)
        # where the means of both poles do not fall towards zero, what they rise is in the reach
        more = np.maximum(of_ends - 1.0, 0.0) * _SURE * seen
        reach = np.maximum(reach, _SURE * np.sqrt(between.ss) + more)
    alone = levels == 0  # nothing is drawn between
    reach[alone] = 0.0
    bend[alone & (b == 0.0)], pull[alone & (b == 0.0)] = 0.0, 0.0
    step = step_over(h, w, b)
    coarse = np.stack(
        [step.kept_n, step.given, step.kept_s,
         *(rms * factor for factor in _factors(step.nn, step.ns, step.ss)),
         bend, np.clip(pull, 0.0, 1.0), rms * reach], axis=1,
    )  # fmt: skip
    fine = []
    for level in range(1, MOST_LEVELS + 1):
        middle = bridge_over(0.5, length * (1 << level) / cells, w, b)
        new = [rms * factor for factor in _factors(middle.nn, middle.ns, middle.ss)]
        fine.append(np.stack([*middle.n, *middle.s, *new], axis=1))
    return samples, levels, coarse.astype(np.float32), np.stack(fine, axis=1).astype(np.float32)
