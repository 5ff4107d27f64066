"""Photoreceptor noise of some pixels over a piece, cell by cell, side by side in lanes.

The samples are drawn once more, and the cells between two samples by halves: in the middle of a
span that is not drawn yet the noise is normal, given both ends.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from adv2e.compiled import embedded, inlined, kernel
from adv2e.kernel import rng
from adv2e.kernel.borrowing import borrowed
from adv2e.kernel.photoreceptor import law, strip
from adv2e.kernel.photoreceptor.law import COARSE, FINE, MOST_CELLS, MOST_LEVELS
from adv2e.kernel.screen import STRIDE

_f = np.float32
_ZERO, _ONE = _f(0.0), _f(1.0)

LANES = 64
"""Pixels side by side."""

NOISE = 0
SEEN = (MOST_CELLS + 1) * LANES
"""Noise samples at cell boundaries: after pole 1, and at the comparator (after pole 2 if there is
one; else only the first of both is in use)."""

HIGH = 2 * (MOST_CELLS + 1) * LANES
LOW = HIGH + LANES
"""Bounds of the noise at the comparator over the piece."""

_KNOWN = LOW + LANES
"""Flags, a row for each sample: 1 if the cells between it and the next sample are drawn."""

_BY = _KNOWN + MOST_CELLS * LANES
_FIRST_BY = _BY // LANES
_MIDDLE = _BY + COARSE * LANES
"""Columns of the tables."""

THERE = _MIDDLE + MOST_LEVELS * FINE * LANES
"""First of the same rows for stretches between two samples: each stretch is the first of a lane."""

PIXELS, BLOCKS, FROM, SAMPLE = (row * LANES for row in range(4))
"""Whole numbers: of the pixel among all, and of its first block of random numbers; of a stretch
also the lane that it comes from, and the sample that it begins with."""

_NUMBERS = 4 * LANES
_SAMPLES = 2 * _NUMBERS  # samples of the piece
_LEVELS = _SAMPLES + 1  # 2^levels cells are between two of them


class NoisePath(NamedTuple):
    """Memory for the noise of some pixels."""

    rows: NDArray[np.float32]
    numbers: NDArray[np.int64]
    words: NDArray[np.uint32]  # (4, LANES)
    normals: NDArray[np.float32]  # (4, LANES)


def new_path() -> NoisePath:
    """Return fresh memory."""
    return NoisePath(
        np.zeros(2 * THERE, np.float32), np.zeros(_LEVELS + 1, np.int64),
        np.zeros((4, LANES), np.uint32), np.zeros((4, LANES), np.float32),
    )  # fmt: skip


@inlined
def grid(path):
    """Return the samples of the piece, and the levels: 2^levels cells are between two samples."""
    return path.numbers[_SAMPLES], path.numbers[_LEVELS]


@kernel
def seen_from(circuit):
    """Return the first row of the noise at the comparator."""
    return SEEN if circuit.follower > 0.0 else NOISE


@kernel
def _column(column, size, rows):
    return rows[column * LANES : column * LANES + size]


@kernel
def _next_sample(size, at, after, z, rows):
    """Row `after` of NOISE, the sample that follows row `at`, behind one pole."""
    n0, n1 = rows[at : at + size], rows[after : after + size]
    keep = _column(_FIRST_BY + law.KEPT_N, size, rows)
    by_n = _column(_FIRST_BY + law.BY_N, size, rows)
    for c in range(size):
        n1[c] = keep[c] * n0[c] + by_n[c] * z[c]


@kernel
def _next_sample_of_two(size, at, after, z, v, rows):
    """Rows `after`, the sample that follows rows `at`, behind two poles."""
    n0, n1 = rows[at : at + size], rows[after : after + size]
    s0, s1 = rows[SEEN + at : SEEN + at + size], rows[SEEN + after : SEEN + after + size]
    keep = _column(_FIRST_BY + law.KEPT_N, size, rows)
    by_n = _column(_FIRST_BY + law.BY_N, size, rows)
    given = _column(_FIRST_BY + law.GIVEN, size, rows)
    keep_s = _column(_FIRST_BY + law.KEPT_S, size, rows)
    by_n_s = _column(_FIRST_BY + law.BY_N_S, size, rows)
    by_s = _column(_FIRST_BY + law.BY_S, size, rows)
    for c in range(size):
        n1[c], s1[c] = strip.next_of_two(
            n0[c], s0[c], keep[c], given[c], keep_s[c], by_n[c], by_n_s[c], by_s[c], z[c], v[c]
        )


@kernel
def _middle(size, at, r, after, first, z, rows):
    """Row r of NOISE, in the middle of rows `at` and `after`, behind one pole.

    first : number of the row that holds the first of the level's columns
    """
    n0, n, n1 = rows[at : at + size], rows[r : r + size], rows[after : after + size]
    by_0, by_1 = _column(first + law.N_OF_N0, size, rows), _column(first + law.N_OF_N1, size, rows)
    new = _column(first + law.NEW_N, size, rows)
    for c in range(size):
        n[c] = by_0[c] * n0[c] + by_1[c] * n1[c] + new[c] * z[c]


@kernel
def _middle_of_two(size, at, r, after, first, z, v, rows):
    """Rows r, in the middle of rows `at` and `after`, behind two poles; `first`: as above."""
    n0, n, n1 = rows[at : at + size], rows[r : r + size], rows[after : after + size]
    s0, s = rows[SEEN + at : SEEN + at + size], rows[SEEN + r : SEEN + r + size]
    s1 = rows[SEEN + after : SEEN + after + size]
    n_n0, n_s0 = _column(first + law.N_OF_N0, size, rows), _column(first + law.N_OF_S0, size, rows)
    n_n1, n_s1 = _column(first + law.N_OF_N1, size, rows), _column(first + law.N_OF_S1, size, rows)
    s_n0, s_s0 = _column(first + law.S_OF_N0, size, rows), _column(first + law.S_OF_S0, size, rows)
    s_n1, s_s1 = _column(first + law.S_OF_N1, size, rows), _column(first + law.S_OF_S1, size, rows)
    new_n, new_s = _column(first + law.NEW_N, size, rows), _column(first + law.NEW_S, size, rows)
    new_n_s = _column(first + law.NEW_N_S, size, rows)
    for c in range(size):
        a, b, d, e = n0[c], s0[c], n1[c], s1[c]
        n[c] = (n_n0[c] * a + n_s0[c] * b) + (n_n1[c] * d + n_s1[c] * e) + new_n[c] * z[c]
        mean = (s_n0[c] * a + s_s0[c] * b) + (s_n1[c] * d + s_s1[c] * e)
        s[c] = mean + (new_n_s[c] * z[c] + new_s[c] * v[c])


@kernel
def _halve(size, begin, levels, more, circuit, rows, numbers, path):
    """Draw the noise between two samples, the first of which is in row `begin`, of all lanes.

    more : added to the number of each lane's first block of random numbers
    """
    words, normals, follows = path.words, path.normals, circuit.follower > 0.0
    pixels, blocks = numbers[PIXELS : PIXELS + size], numbers[BLOCKS : BLOCKS + size]
    a_block, drawn = 2 if follows else 4, np.int64(0)
    for level in range(levels - 1, -1, -1):
        half, first = LANES << level, _MIDDLE // LANES + level * FINE
        for j in range(1 << (levels - 1 - level)):
            r = drawn % a_block
            if r == 0:
                rng.normals32_of_blocks(
                    circuit.seed, rng.PHOTORECEPTOR_BETWEEN, pixels, blocks,
                    more + drawn // a_block, words, normals,
                )  # fmt: skip
            at = begin + 2 * j * half
            if follows:
                _middle_of_two(
                    size, at, at + half, at + 2 * half, first, normals[2 * r], normals[2 * r + 1],
                    rows,
                )  # fmt: skip
            else:
                _middle(size, at, at + half, at + 2 * half, first, normals[r], rows)
            drawn += 1


@kernel
def _blocks_between(levels, circuit):
    """Return the number of blocks of random numbers for the noise between two samples."""
    a_block = 2 if circuit.follower > 0.0 else 4
    return ((1 << levels) - 2) // a_block + 1


@kernel
def sample(size, pixels, piece, samples, levels, circuit, fine, noise, path):
    """Draw the samples of some pixels over piece number `piece` of all, once more.

    Parameters
    ----------
    size : int
        Number of pixels.
    pixels : (LANES,) int64
        Their numbers in the strip.
    samples, levels : int
        Samples of the piece, and levels of these pixels.
    fine : (entries, levels, FINE) float32
    noise : StripNoise
        Noise of the strip.
    path : NoisePath
    """
    fine, noise, path = borrowed(fine, noise, path)
    rows, normals, follows = path.rows, path.normals, circuit.follower > 0.0
    path.numbers[_SAMPLES], path.numbers[_LEVELS] = samples, levels
    for c in range(size):
        k = pixels[c]
        path.numbers[PIXELS + c] = noise.pixels[k]
        path.numbers[BLOCKS + c] = piece * strip.BLOCKS
        rows[HIGH + c] = noise.rows[strip.HIGH + k]
        rows[LOW + c] = noise.rows[strip.LOW + k]
        rows[NOISE + c] = noise.rows[strip.NOISE_0 + k]
        rows[SEEN + c] = noise.rows[strip.SEEN_0 + k]
        entry = noise.entries[k]
        for level in range(levels):
            for column in range(FINE):
                row = _MIDDLE + (level * FINE + column) * LANES
                rows[row + c] = fine[entry, level, column]
    for column in range(COARSE):
        for c in range(size):
            rows[_BY + column * LANES + c] = noise.rows[strip.BY + column * STRIDE + pixels[c]]
    a_block, q = 2 if follows else 4, np.int64(1) << levels
    for j in range(samples):
        r, at = j % a_block, NOISE + j * q * LANES
        if r == 0:
            rng.normals32_of_pixels(
                circuit.seed, rng.PHOTORECEPTOR_SAMPLES, path.numbers[PIXELS : PIXELS + size],
                piece * strip.BLOCKS + j // a_block, path.words, normals,
            )  # fmt: skip
        if follows:
            _next_sample_of_two(size, at, at + q * LANES, normals[2 * r], normals[2 * r + 1], rows)
        else:
            _next_sample(size, at, at + q * LANES, normals[r], rows)
        for c in range(size):
            rows[_KNOWN + j * LANES + c] = _ONE if levels == 0 else _ZERO


@kernel
def bounds_of_stretch(j, c, levels, seen, rows):
    """Bounds of the noise at the comparator from sample j of lane c to the next."""
    at, after = (j << levels) * LANES + c, ((j + 1) << levels) * LANES + c
    a, b = rows[seen + at], rows[seen + after]
    high, low = strip.bounds(
        a, rows[at] - a, b, rows[after] - b, rows[_BY + law.BEND * LANES + c],
        rows[_BY + law.PULL * LANES + c],
    )  # fmt: skip
    reach = rows[_BY + law.REACH * LANES + c]
    return high + reach, low - reach


@kernel
def bound_stretch(size, j, levels, seen, high, low, rows):
    """Fill `high` and `low`, (LANES,), with bounds of the noise from sample j to the next."""
    for c in range(size):
        high[c], low[c] = bounds_of_stretch(j, c, levels, seen, rows)


@kernel
def is_known(j, c, rows):
    """Tell whether the noise between sample j of lane c and the next is drawn."""
    return rows[_KNOWN + j * LANES + c] > _ZERO


@kernel
def draw_between(size, j, levels, circuit, path):
    """Draw the noise between sample j and the next, of all pixels of a path."""
    (path,) = borrowed(path)
    if levels > 0:
        more = j * _blocks_between(levels, circuit)
        begin = (j << levels) * LANES
        _halve(size, begin, levels, more, circuit, path.rows, path.numbers, path)
    for c in range(size):
        path.rows[_KNOWN + j * LANES + c] = _ONE


@kernel
def draw_stretches(count, levels, circuit, path):
    """Draw the first `count` stretches, whose numbers FROM and SAMPLE are given."""
    (path,) = borrowed(path)
    rows, there = path.rows, path.rows[THERE:]
    own, numbers = path.numbers, path.numbers[_NUMBERS:]
    lanes, samples = numbers[FROM : FROM + count], numbers[SAMPLE : SAMPLE + count]
    end, poles = LANES << levels, 2 if circuit.follower > 0.0 else 1
    for t in range(count):
        c, j = lanes[t], samples[t]
        begin = (j << levels) * LANES + c
        numbers[PIXELS + t] = own[PIXELS + c]
        numbers[BLOCKS + t] = own[BLOCKS + c] + j * _blocks_between(levels, circuit)
        rows[_KNOWN + j * LANES + c] = _ONE
        for pole in range(poles):
            there[pole * SEEN + t] = rows[pole * SEEN + begin]
            there[pole * SEEN + end + t] = rows[pole * SEEN + begin + end]
    for row in range(levels * FINE):
        first = _MIDDLE + row * LANES
        for t in range(count):
            there[first + t] = rows[first + lanes[t]]
    _halve(count, 0, levels, 0, circuit, there, numbers, path)
    for pole in range(poles):
        for t in range(count):
            begin = pole * SEEN + (samples[t] << levels) * LANES + lanes[t]
            for r in range(LANES, end, LANES):
                rows[begin + r] = there[pole * SEEN + r + t]


@kernel
def wait(t, c, j, path):
    """Note the span from sample j of lane c to the next sample as stretch number t."""
    path.numbers[_NUMBERS + FROM + t] = c
    path.numbers[_NUMBERS + SAMPLE + t] = j


@kernel
def origin(t, path):
    """Return lane and sample of stretch number t."""
    return path.numbers[_NUMBERS + FROM + t], path.numbers[_NUMBERS + SAMPLE + t]


@kernel
def cubic_of(n0, s0, n1, s1, start, width, corner, is_line):
    """Coefficients of the noise in a cell, as a cubic of the place in a substep.

    n0, s0, n1, s1 : noise behind the first pole and at the comparator, at both ends
    start, width : of the cell, as shares of the substep
    corner : of the second pole, in the cell [rad]
    is_line : whether there is none, and the noise is a line
    """
    v0, v1, rise = corner * (n0 - s0), corner * (n1 - s1), s1 - s0
    a1 = rise if is_line else v0
    a2 = 0.0 if is_line else 3.0 * rise - 2.0 * v0 - v1
    a3 = 0.0 if is_line else v0 + v1 - 2.0 * rise
    scale = 1.0 / width
    a1, a2, a3 = a1 * scale, a2 * scale * scale, a3 * scale * scale * scale
    return (
        s0 - start * (a1 - start * (a2 - start * a3)),
        a1 - start * (2.0 * a2 - 3.0 * start * a3),
        a2 - 3.0 * start * a3,
        a3,
    )


@kernel
def draw_rest(size, places, circuit, path):
    """Draw all noise of the pixels whose place is 1 or less, from that place of the piece on."""
    (path,) = borrowed(path)
    samples, levels = grid(path)
    waiting = np.int64(0)
    for j in range(samples):
        for c in range(size):
            if places[c] * samples < j + 1 and not is_known(j, c, path.rows):
                wait(waiting, c, j, path)
                waiting += 1
                if waiting == LANES:
                    draw_stretches(waiting, levels, circuit, path)
                    waiting = np.int64(0)
    if waiting > 0:
        draw_stretches(waiting, levels, circuit, path)


@embedded
def copy_cells(c, seen, path, cells):
    """Copy the noise of lane c at the ends of all cells, behind both poles; returns how many."""
    rows, count = path.rows, path.numbers[_SAMPLES] << path.numbers[_LEVELS]
    for r in range(count + 1):
        cells[2 * r], cells[2 * r + 1] = rows[r * LANES + c], rows[seen + r * LANES + c]
    return count


@embedded
def bounds_in_cell(n0, s0, n1, s1, third):
    """Bounds of the noise in a cell: those of the Bezier points of its cubic.

    n0, s0, n1, s1 : noise behind the first pole and at the comparator, at both ends
    third : a third of the corner of the second pole in the cell [rad]
    """
    a, b = s0 + third * (n0 - s0), s1 - third * (n1 - s1)
    return max(s0, s1, a, b), min(s0, s1, a, b)
