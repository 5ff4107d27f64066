"""Photoreceptor noise of a strip over one piece of an interval.

All pixels take as many samples, so that the loops have no branches.
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

NOISE, SEEN, HIGH, LOW, NOISE_0, SEEN_0, BY = (row * STRIDE for row in range(7))
"""Rows: noise behind the first pole and at the comparator, bounds of the latter over the last
piece, the noise at its start; from the last row on, a column of the coarse table each."""

BLOCK = 64
"""Pixels that are looked up together, if one of them moves: most of a strip may rest."""

BLOCKS = MOST_CELLS // 2
"""Most blocks of random numbers of a piece."""

_f = np.float32
_ZERO, _ONE = _f(0.0), _f(1.0)


class StripNoise(NamedTuple):
    """Memory for the noise of a strip, one for each thread."""

    rows: NDArray[np.float32]
    entries: NDArray[np.int64]  # of each pixel in the tables,
    looked_up: NDArray[np.int64]  # and that of which the columns are; -1: of none
    pixels: NDArray[np.int64]  # their numbers of all
    law: NDArray[np.int64]  # (1,): 1 + the law of the last piece; 0: there was none
    words: NDArray[np.uint32]
    normals: NDArray[np.float32]


def new_memory() -> StripNoise:
    """Return fresh memory."""
    entries, looked_up, pixels = (np.zeros(STRIP, np.int64) for _ in range(3))
    return StripNoise(
        np.zeros(BY + COARSE * STRIDE, np.float32), entries, looked_up, pixels,
        np.zeros(1, np.int64), np.zeros((4, STRIDE), np.uint32), np.zeros((4, STRIDE), np.float32),
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
def _look_up(count, coarse, noise):
    """Fill the columns of the coarse table, but for blocks that have them already."""
    for first in range(0, count, BLOCK):
        last = min(first + BLOCK, count)
        entries, held = noise.entries[first:last], noise.looked_up[first:last]
        changes = 0
        for k in range(entries.shape[0]):
            changes |= entries[k] ^ held[k]
        if changes == 0:
            continue
        columns = noise.rows[BY + first :]
        for k in range(entries.shape[0]):
            held[k] = entries[k]
            row = coarse[entries[k]]
            for column in range(COARSE):
                columns[column * STRIDE + k] = row[column]


@kernel
def next_of_two(n, s, keep, given, keep_s, by_n, by_n_s, by_s, z, v):
    """Return the next sample of noise n and s behind two poles, from two normal numbers."""
    return keep * n + by_n * z, given * n + keep_s * s + by_n_s * z + by_s * v


@kernel
def _sample(count, normals, rows):
    """Advance the pixels to the next sample, behind one pole."""
    for k in range(count):
        n0 = rows[NOISE + k]
        n1 = rows[BY + law.KEPT_N * STRIDE + k] * n0 + rows[BY + law.BY_N * STRIDE + k] * normals[k]
        rows[NOISE + k] = n1
        high, low = bounds(n0, _ZERO, n1, _ZERO, _ZERO, rows[BY + law.PULL * STRIDE + k])
        rows[HIGH + k] = max(rows[HIGH + k], high)
        rows[LOW + k] = min(rows[LOW + k], low)


@kernel
def _sample_of_two(count, z, v, rows):
    """Advance the pixels to the next sample, behind two poles, by two normal numbers each."""
    for k in range(count):
        n0, s0 = rows[NOISE + k], rows[SEEN + k]
        n1, s1 = next_of_two(
            n0, s0, rows[BY + law.KEPT_N * STRIDE + k], rows[BY + law.GIVEN * STRIDE + k],
            rows[BY + law.KEPT_S * STRIDE + k], rows[BY + law.BY_N * STRIDE + k],
            rows[BY + law.BY_N_S * STRIDE + k], rows[BY + law.BY_S * STRIDE + k], z[k], v[k],
        )  # fmt: skip
        rows[NOISE + k] = n1
        rows[SEEN + k] = s1
        bend, pull = rows[BY + law.BEND * STRIDE + k], rows[BY + law.PULL * STRIDE + k]
        high, low = bounds(s0, n0 - s0, s1, n1 - s1, bend, pull)
        rows[HIGH + k] = max(rows[HIGH + k], high)
        rows[LOW + k] = min(rows[LOW + k], low)


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
def _begin(count, follows, rows):
    """Rows at the start of a piece; `follows`: the comparator sees noise behind a second pole."""
    for k in range(count):
        rows[NOISE_0 + k] = rows[NOISE + k]
        rows[SEEN_0 + k] = rows[SEEN + k]
    for k in range(count):
        seen = rows[SEEN + k] if follows else rows[NOISE + k]
        rows[HIGH + k] = seen
        rows[LOW + k] = seen


@kernel
def _end(count, follows, rows):
    """Rows SEEN, HIGH and LOW at the end of a piece."""
    for k in range(count):
        rows[SEEN + k] = rows[SEEN + k] if follows else rows[NOISE + k]
        reach = rows[BY + law.REACH * STRIDE + k]
        rows[HIGH + k] += reach
        rows[LOW + k] -= reach


@kernel
def draw(lo, count, piece, which, rests, circuit, laws, strip, noise):
    """Draw the noise of a strip over piece number `piece` of all, which has law `which`.

    The light at both ends is in the rows of the screen; `rests`: it is that of the piece before.
    Fills rows HIGH and LOW.
    """
    strip, laws, noise = borrowed(strip, laws, noise)
    rows, normals, follows = noise.rows, noise.normals, circuit.follower > 0.0
    is_new = noise.law[0] != which + 1
    if is_new:
        for k in range(count):
            noise.looked_up[k], noise.pixels[k] = -1, lo + k
    if is_new or not rests:
        _find_entries(
            count, _f(circuit.dark), _f(circuit.per_dn), laws.lowest, laws.levels.shape[1] - 1,
            strip, noise.entries,
        )  # fmt: skip
        _look_up(count, laws.coarse[which], noise)
    noise.law[0] = which + 1
    _begin(count, follows, rows)
    a_block = 2 if follows else 4
    for j in range(laws.samples[which]):
        r = j % a_block
        if r == 0:
            rng.normals32_of_pixels(
                circuit.seed, rng.PHOTORECEPTOR_SAMPLES, noise.pixels[:count],
                piece * BLOCKS + j // a_block, noise.words, normals,
            )  # fmt: skip
        if follows:
            _sample_of_two(count, normals[2 * r], normals[2 * r + 1], rows)
        else:
            _sample(count, normals[r], rows)
    _end(count, follows, rows)
