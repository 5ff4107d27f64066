"""Photoreceptor noise of a strip over one piece of an interval.

Pixels that take as many samples go together: they lie side by side in a pack, for which the loops
have no branches.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from adv2e.compiled import kernel
from adv2e.kernel import rng, screen
from adv2e.kernel.borrowing import borrowed
from adv2e.kernel.photoreceptor import law
from adv2e.kernel.photoreceptor.law import COARSE, MOST_CELLS, SHIFT
from adv2e.kernel.screen import STRIDE
from adv2e.kernel.work_queue import STRIP

NOISE_0, NOISE_1, SEEN_0, SEEN_1, HIGH, LOW = (row * STRIDE for row in range(6))
"""Rows: noise behind the first pole and as the comparator sees it, at the start and the end of a
piece; and bounds of the latter in between."""

_OF_PACK = 6 * STRIDE
_N, _S, _HIGH, _LOW = (_OF_PACK + row * STRIDE for row in range(4))
_BY = _OF_PACK + 4 * STRIDE
"""Rows of the pack; from the last one on, a column of the coarse table each."""

BLOCKS = MOST_CELLS // 2
"""Most blocks of random numbers of a piece."""

_f = np.float32
_ZERO, _ONE, _HALF = _f(0.0), _f(1.0), _f(0.5)


class Scratch(NamedTuple):
    """Memory for noise of whoever works on a strip."""

    rows: NDArray[np.float32]
    entries: NDArray[np.int64]  # of each pixel in the tables
    order: NDArray[np.int64]  # pixels by their number of samples
    pixels: NDArray[np.int64]  # numbers of the pack's pixels
    starts: NDArray[np.int64]  # of each number of samples in that order
    words: NDArray[np.uint32]
    normals: NDArray[np.float32]


def scratch() -> Scratch:
    """Return fresh memory."""
    entries, order, pixels = (np.zeros(STRIP, np.int64) for _ in range(3))
    return Scratch(
        np.zeros(_BY + COARSE * STRIDE, np.float32), entries, order, pixels,
        np.zeros(MOST_CELLS + 2, np.int64), np.zeros((4, STRIDE), np.uint32),
        np.zeros((4, STRIDE), np.float32),
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
def _sort(count, samples, entries, starts, order):
    """Pixels by their number of samples; returns the largest number."""
    for j in range(starts.shape[0]):
        starts[j] = 0
    largest = np.int64(0)
    for k in range(count):
        m = samples[entries[k]]
        largest = max(largest, m)
        starts[m + 1] += 1
    for m in range(largest + 1):
        starts[m + 1] += starts[m]
    for k in range(count):
        m = samples[entries[k]]
        order[starts[m]] = k
        starts[m] += 1
    # each start is now that of the next number
    return largest


@kernel
def _pack(lo, first, size, seen, coarse, scratch):
    """Fill the pack with the pixels from the `first` of the order on."""
    rows, order, entries, pixels = scratch.rows, scratch.order, scratch.entries, scratch.pixels
    for c in range(size):
        k = order[first + c]
        pixels[c] = lo + k
        rows[_N + c] = rows[NOISE_0 + k]
        rows[_S + c] = rows[SEEN_0 + k]
        rows[_HIGH + c] = rows[seen + k]
        rows[_LOW + c] = rows[seen + k]
        entry = entries[k]
        for column in range(COARSE):
            rows[_BY + column * STRIDE + c] = coarse[entry, column]


@kernel
def _sample(size, normals, rows):
    """Advance the pack to the next sample, behind one pole."""
    keep, by_n = rows[_BY + law.KEPT_N * STRIDE :], rows[_BY + law.BY_N * STRIDE :]
    pull = rows[_BY + law.PULL * STRIDE :]
    for c in range(size):
        n0 = rows[_N + c]
        n1 = keep[c] * n0 + by_n[c] * normals[c]
        rows[_N + c] = n1
        low, high = min(n0, n1), max(n0, n1)
        high = high if high > _ZERO else high * (_ONE - pull[c])
        low = low if low < _ZERO else low * (_ONE - pull[c])
        rows[_HIGH + c] = max(rows[_HIGH + c], high)
        rows[_LOW + c] = min(rows[_LOW + c], low)


@kernel
def _sample_of_two(size, first, second, rows):
    """Advance the pack to the next sample, behind two poles, by two normal numbers each."""
    keep, by_n = rows[_BY + law.KEPT_N * STRIDE :], rows[_BY + law.BY_N * STRIDE :]
    given, keep_s = rows[_BY + law.GIVEN * STRIDE :], rows[_BY + law.KEPT_S * STRIDE :]
    by_n_s, by_s = rows[_BY + law.BY_N_S * STRIDE :], rows[_BY + law.BY_S * STRIDE :]
    bend, pull = rows[_BY + law.BEND * STRIDE :], rows[_BY + law.PULL * STRIDE :]
    for c in range(size):
        n0, s0 = rows[_N + c], rows[_S + c]
        n1 = keep[c] * n0 + by_n[c] * first[c]
        s1 = given[c] * n0 + keep_s[c] * s0 + by_n_s[c] * first[c] + by_s[c] * second[c]
        rows[_N + c] = n1
        rows[_S + c] = s1
        high, low = bounds(s0, n0 - s0, s1, n1 - s1, bend[c], pull[c])
        rows[_HIGH + c] = max(rows[_HIGH + c], high)
        rows[_LOW + c] = min(rows[_LOW + c], low)


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
def _unpack(first, size, follows, scratch):
    """Rows of the pixels of the pack at the end of the piece."""
    rows, order = scratch.rows, scratch.order
    for c in range(size):
        k = order[first + c]
        reach = rows[_BY + law.REACH * STRIDE + c]
        rows[NOISE_1 + k] = rows[_N + c]
        rows[SEEN_1 + k] = rows[_S + c] if follows else rows[_N + c]
        rows[HIGH + k] = rows[_HIGH + c] + reach
        rows[LOW + k] = rows[_LOW + c] - reach


@kernel
def draw(lo, count, piece, which, circuit, laws, strip, scratch):
    """Draw the noise of a strip over piece number `piece` of all, which has law `which`.

    The light at both ends is in the rows of the screen.  Fills rows NOISE_1, SEEN_1, HIGH and LOW.
    """
    strip, laws, scratch = borrowed(strip, laws, scratch)
    rows = scratch.rows
    follows = circuit.follower > 0.0
    _find_entries(
        count, _f(circuit.dark), _f(circuit.per_dn), laws.lowest, laws.samples.shape[1] - 1, strip,
        scratch.entries,
    )  # fmt: skip
    samples, coarse = laws.samples[which], laws.coarse[which]
    largest = _sort(count, samples, scratch.entries, scratch.starts, scratch.order)
    begin = np.int64(0)
    for m in range(largest + 1):
        size = scratch.starts[m] - begin
        if size == 0:
            continue
        _pack(lo, begin, size, SEEN_0 if follows else NOISE_0, coarse, scratch)
        a_block = 2 if follows else 4
        for j in range(m):
            r = j % a_block
            if r == 0:
                rng.normals32_of_pixels(
                    circuit.seed, rng.PHOTORECEPTOR_SAMPLES, scratch.pixels[:size],
                    piece * BLOCKS + j // a_block, scratch.words, scratch.normals,
                )  # fmt: skip
            if follows:
                _sample_of_two(size, scratch.normals[2 * r], scratch.normals[2 * r + 1], rows)
            else:
                _sample(size, scratch.normals[r], rows)
        _unpack(begin, size, follows, scratch)
        begin = scratch.starts[m]


@kernel
def step_on(rows):
    """Make the end of this piece the start of the next."""
    for k in range(STRIP):
        rows[NOISE_0 + k] = rows[NOISE_1 + k]
        rows[SEEN_0 + k] = rows[SEEN_1 + k]
