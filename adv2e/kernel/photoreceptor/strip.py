"""Photoreceptor noise of a strip over one piece of an interval.

Pixels that take as many samples lie side by side, sorted, so that the loops have no branches.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from adv2e.compiled import kernel
from adv2e.kernel import rng, screen
from adv2e.kernel.borrowing import borrowed
from adv2e.kernel.photoreceptor import law
from adv2e.kernel.photoreceptor.law import COARSE, MOST_CELLS, MOST_GROUPS, SHIFT
from adv2e.kernel.screen import STRIDE
from adv2e.kernel.work_queue import STRIP

NOISE, SEEN, HIGH, LOW = (row * STRIDE for row in range(4))
"""Rows: noise behind the first pole and at the comparator, before the next piece; and bounds of the
noise at the comparator over the last piece."""

NOISE_0, SEEN_0, NOISE_1, SEEN_1, _HIGH, _LOW, BY = (row * STRIDE for row in range(4, 11))
"""Rows of the sorted pixels: noise at the start and at the end of the piece, bounds; from the last
one on, a column of the coarse table each."""

BLOCKS = MOST_CELLS // 2
"""Most blocks of random numbers of a piece."""

_f = np.float32
_ZERO, _ONE = _f(0.0), _f(1.0)


class StripNoise(NamedTuple):
    """Memory for the noise of a strip, one for each thread."""

    rows: NDArray[np.float32]
    entries: NDArray[np.int64]  # of each pixel in the tables
    order: NDArray[np.int64]  # sorted pixels,
    pixels: NDArray[np.int64]  # their numbers of all,
    ends: NDArray[np.int64]  # and where each group ends, from the second entry on; the first is 0
    kept: NDArray[np.int64]  # (1,): 1 + the law by which they are sorted; 0: they are not
    words: NDArray[np.uint32]
    normals: NDArray[np.float32]


def new_memory() -> StripNoise:
    """Return fresh memory."""
    entries, order, pixels = (np.zeros(STRIP, np.int64) for _ in range(3))
    return StripNoise(
        np.zeros(BY + COARSE * STRIDE, np.float32), entries, order, pixels,
        np.zeros(MOST_GROUPS + 1, np.int64), np.zeros(1, np.int64),
        np.zeros((4, STRIDE), np.uint32), np.zeros((4, STRIDE), np.float32),
    )  # fmt: skip


@kernel
def _find_entries(count, dark, per_dn, lowest, most, strip, entries):
    """Entry of each pixel's mean corner over the piece [rad/us]; light grows by itself."""
    for k in range(count):
        i0, i1 = strip[screen.LIGHT_0 + k], strip[screen.LIGHT_1 + k]
        mean = (i0 + i1 + _f(4.0) * np.sqrt(i0 * i1)) * _f(1.0 / 6.0)
        bits = np.int32(_f(dark + per_dn * mean).view(np.int32) >> np.int32(SHIFT))
        entry = np.int64(bits) - lowest
        entries[k] = min(max(entry, 0), most)


@kernel
def _sort(lo, count, group, groups, coarse, noise):
    """Sort the pixels by group, and their noise and tables likewise."""
    order, ends, entries, rows = noise.order, noise.ends, noise.entries, noise.rows
    for g in range(groups + 1):
        ends[g] = 0
    for k in range(count):
        ends[group[entries[k]] + 1] += 1
    for g in range(groups):
        ends[g + 1] += ends[g]
    for k in range(count):
        g = group[entries[k]]
        order[ends[g]] = k
        ends[g] += 1
    # each is the end of its group now
    for g in range(groups, 0, -1):
        ends[g] = ends[g - 1]
    ends[0] = 0
    for p in range(count):
        k = order[p]
        noise.pixels[p] = lo + k
        rows[NOISE_1 + p] = rows[NOISE + k]
        rows[SEEN_1 + p] = rows[SEEN + k]
    for p in range(count):
        entry = entries[order[p]]
        for column in range(COARSE):
            rows[BY + column * STRIDE + p] = coarse[entry, column]


@kernel
def put_back(count, noise):
    """Rows NOISE and SEEN, of the pixels in their own order."""
    rows, order = noise.rows, noise.order
    if noise.kept[0] > 0:
        for p in range(count):
            rows[NOISE + order[p]] = rows[NOISE_1 + p]
            rows[SEEN + order[p]] = rows[SEEN_1 + p]
    noise.kept[0] = 0


@kernel
def next_of_two(n, s, keep, given, keep_s, by_n, by_n_s, by_s, z, v):
    """Return the next sample of noise n and s behind two poles, from two normal numbers."""
    return keep * n + by_n * z, given * n + keep_s * s + by_n_s * z + by_s * v


@kernel
def _sample(first, size, normals, rows):
    """Advance sorted pixels from `first` on to the next sample, behind one pole."""
    noise = rows[NOISE_1 + first : NOISE_1 + first + size]
    top, bottom = rows[_HIGH + first :], rows[_LOW + first :]
    keep = rows[BY + law.KEPT_N * STRIDE + first :]
    by_n = rows[BY + law.BY_N * STRIDE + first :]
    pull = rows[BY + law.PULL * STRIDE + first :]
    for c in range(size):
        n0 = noise[c]
        n1 = keep[c] * n0 + by_n[c] * normals[c]
        noise[c] = n1
        low, high = min(n0, n1), max(n0, n1)
        high = high if high > _ZERO else high * (_ONE - pull[c])
        low = low if low < _ZERO else low * (_ONE - pull[c])
        top[c] = max(top[c], high)
        bottom[c] = min(bottom[c], low)


@kernel
def _sample_of_two(first, size, z, v, rows):
    """Advance sorted pixels to the next sample, behind two poles, by two normal numbers each."""
    noise, seen = rows[NOISE_1 + first : NOISE_1 + first + size], rows[SEEN_1 + first :]
    top, bottom = rows[_HIGH + first :], rows[_LOW + first :]
    keep = rows[BY + law.KEPT_N * STRIDE + first :]
    by_n = rows[BY + law.BY_N * STRIDE + first :]
    given = rows[BY + law.GIVEN * STRIDE + first :]
    keep_s = rows[BY + law.KEPT_S * STRIDE + first :]
    by_n_s = rows[BY + law.BY_N_S * STRIDE + first :]
    by_s = rows[BY + law.BY_S * STRIDE + first :]
    bend, pull = rows[BY + law.BEND * STRIDE + first :], rows[BY + law.PULL * STRIDE + first :]
    for c in range(size):
        n0, s0 = noise[c], seen[c]
        n1, s1 = next_of_two(
            n0, s0, keep[c], given[c], keep_s[c], by_n[c], by_n_s[c], by_s[c], z[c], v[c]
        )
        noise[c] = n1
        seen[c] = s1
        high, low = bounds(s0, n0 - s0, s1, n1 - s1, bend[c], pull[c])
        top[c] = max(top[c], high)
        bottom[c] = min(bottom[c], low)


@kernel
def bounds(s0, v0, s1, v1, bend, pull):
    """Bounds of the mean of the bridge between two samples; v: noise before the second pole less s.

    The mean is a part of s0, one of s1, both together at least 1 - pull, and at most bend times v0
    and -v1.
    """
    up = max(v0, _ZERO) + max(-v1, _ZERO)
    down = max(-v0, _ZERO) + max(v1, _ZERO)
    high, low = max(s0, s1), min(s0, s1)
    high = high if high > _ZERO else high * (_ONE - pull)
    low = low if low < _ZERO else low * (_ONE - pull)
    return high + bend * up, low - bend * down


@kernel
def _begin(count, seen, rows):
    """Rows of sorted pixels at the start of a piece; `seen`: row of what the comparator sees."""
    for p in range(count):
        rows[NOISE_0 + p] = rows[NOISE_1 + p]
        rows[SEEN_0 + p] = rows[SEEN_1 + p]
    for p in range(count):
        rows[_HIGH + p] = rows[seen + p]
        rows[_LOW + p] = rows[seen + p]


@kernel
def _end(count, follows, order, rows):
    """Rows SEEN_1 of sorted pixels, and HIGH and LOW, at the end of a piece."""
    if not follows:
        for p in range(count):
            rows[SEEN_1 + p] = rows[NOISE_1 + p]
    for p in range(count):
        k, reach = order[p], rows[BY + law.REACH * STRIDE + p]
        rows[HIGH + k] = rows[_HIGH + p] + reach
        rows[LOW + k] = rows[_LOW + p] - reach


@kernel
def draw(lo, count, piece, which, rests, circuit, laws, strip, noise):
    """Draw the noise of a strip over piece number `piece` of all, which has law `which`.

    The light at both ends is in the rows of the screen; `rests`: it is that of the piece before.
    Fills rows HIGH and LOW.
    """
    strip, laws, noise = borrowed(strip, laws, noise)
    rows, normals, follows = noise.rows, noise.normals, circuit.follower > 0.0
    if not rests or noise.kept[0] != which + 1:
        put_back(count, noise)
        _find_entries(
            count, _f(circuit.dark), _f(circuit.per_dn), laws.lowest, laws.group.shape[1] - 1,
            strip, noise.entries,
        )  # fmt: skip
        _sort(lo, count, laws.group[which], laws.samples.shape[1], laws.coarse[which], noise)
        noise.kept[0] = which + 1
    _begin(count, SEEN_1 if follows else NOISE_1, rows)
    a_block = 2 if follows else 4
    for g in range(laws.samples.shape[1]):
        first, size = noise.ends[g], noise.ends[g + 1] - noise.ends[g]
        if size == 0:
            continue
        for j in range(laws.samples[which, g]):
            r = j % a_block
            if r == 0:
                rng.normals32_of_pixels(
                    circuit.seed, rng.PHOTORECEPTOR_SAMPLES, noise.pixels[first : first + size],
                    piece * BLOCKS + j // a_block, noise.words, normals,
                )  # fmt: skip
            if follows:
                _sample_of_two(first, size, normals[2 * r], normals[2 * r + 1], rows)
            else:
                _sample(first, size, normals[r], rows)
    _end(count, follows, noise.order, rows)
