"""Photoreceptor noise of one pixel: its samples once more, and what lies between two of them.

All that is known of the pixel is in one flat array, its `own`: each array more that a function
takes costs some ns a call.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from adv2e.compiled import kernel
from adv2e.kernel import rng
from adv2e.kernel.photoreceptor import law
from adv2e.kernel.photoreceptor.law import COARSE, FINE, MOST_CELLS
from adv2e.kernel.photoreceptor.strip import BLOCKS, NOISE_0, SEEN_0, bounds

_f = np.float32

DEEPEST = 16
"""Most halves of halves of MOST_CELLS."""

_LINE = MOST_CELLS + 1
SAMPLES, CELLS, _PIECE, _ENTERED = range(4)
"""Of an `own`: samples of the piece, cells between two samples, number of the piece, and the sample
behind which some is known of what is between."""

_BY = 4  # the coarse table's columns, and the fine one's
_IN_CELL = _BY + COARSE
SAMPLE_N = _IN_CELL + FINE  # noise behind the first pole, and as the comparator sees it, of samples
SAMPLE_S = SAMPLE_N + _LINE
HIGH = SAMPLE_S + _LINE  # bounds of what is seen from each sample to the next
LOW = HIGH + _LINE
NOISE = LOW + _LINE  # as of samples, at the ends of cells between two samples
SEEN = NOISE + _LINE
_KNOWN = SEEN + _LINE  # whether that is drawn
ENDS = _KNOWN + _LINE  # of what is to be looked at between the samples
SIGNALS = ENDS + DEEPEST  # without noise at these
_SIZE = SIGNALS + DEEPEST

_BEND = 0.15
"""Of a cubic that leaves zero with slope 1 and comes back with slope 0: 4/27."""


class Drawn(NamedTuple):
    """What is drawn of a strip over a piece; see :class:`adv2e.kernel.photoreceptor.law.Laws`."""

    piece: int  # number of the piece, of all in the recording
    samples: NDArray[np.int64]  # (entries,)
    cells: NDArray[np.int64]
    coarse: NDArray[np.float32]  # (entries, COARSE)
    fine: NDArray[np.float64]  # (entries, FINE)
    entries: NDArray[np.int64]  # of the strip's pixels
    rows: NDArray[np.float32]  # of the strip


def own() -> NDArray[np.float64]:
    """Return memory for one pixel."""
    return np.zeros(_SIZE)


@kernel
def _bound_samples(own):
    """Bounds of what is seen from each sample to the next."""
    bend, pull = _f(own[_BY + law.BEND]), _f(own[_BY + law.PULL])
    reach = own[_BY + law.REACH]
    for c in range(int(own[SAMPLES])):
        s0, s1 = own[SAMPLE_S + c], own[SAMPLE_S + c + 1]
        v0, v1 = own[SAMPLE_N + c] - s0, own[SAMPLE_N + c + 1] - s1
        high, low = bounds(_f(s0), _f(v0), _f(s1), _f(v1), bend, pull)
        own[HIGH + c], own[LOW + c] = high + reach, low - reach


@kernel
def begin(i, k, drawn, circuit, own):
    """Fill the `own` of pixel i, k of its strip: with its samples, drawn as the strip did."""
    entry, follows = drawn.entries[k], circuit.follower > 0.0
    m = drawn.samples[entry]
    own[SAMPLES], own[CELLS], own[_PIECE] = m, drawn.cells[entry], drawn.piece
    for column in range(COARSE):
        own[_BY + column] = drawn.coarse[entry, column]
    for column in range(FINE):
        own[_IN_CELL + column] = drawn.fine[entry, column]
    keep, by_n = _f(own[_BY + law.KEPT_N]), _f(own[_BY + law.BY_N])
    given, keep_s = _f(own[_BY + law.GIVEN]), _f(own[_BY + law.KEPT_S])
    by_n_s, by_s = _f(own[_BY + law.BY_N_S]), _f(own[_BY + law.BY_S])
    n, s = drawn.rows[NOISE_0 + k], drawn.rows[SEEN_0 + k]
    s = s if follows else n
    a_block = 2 if follows else 4
    own[SAMPLE_N], own[SAMPLE_S], own[_ENTERED] = n, s, -1.0
    z = (n, n, n, n)
    for j in range(m):
        r = j % a_block
        if r == 0:
            block = drawn.piece * BLOCKS + j // a_block
            z = rng.normals32(circuit.seed, rng.PHOTORECEPTOR_SAMPLES, i, block)
        if follows:
            first, second = (z[0], z[1]) if r == 0 else (z[2], z[3])
            s = given * n + keep_s * s + by_n_s * first + by_s * second
            n = keep * n + by_n * first
        else:
            n = keep * n + by_n * (z[0] if r == 0 else z[1] if r == 1 else z[2] if r == 2 else z[3])
            s = n
        own[SAMPLE_N + j + 1], own[SAMPLE_S + j + 1] = n, s
    _bound_samples(own)


@kernel
def enter(c, own):
    """Begin between samples c and c + 1."""
    if own[_ENTERED] == c:
        return
    q = int(own[CELLS])
    own[_ENTERED] = c
    for r in range(1, q):
        own[_KNOWN + r] = 0.0
    own[NOISE], own[SEEN] = own[SAMPLE_N + c], own[SAMPLE_S + c]
    own[NOISE + q], own[SEEN + q] = own[SAMPLE_N + c + 1], own[SAMPLE_S + c + 1]


@kernel
def bounds_of_cells(a, b, corner, own):
    """Bounds of what is seen from cell a on until cell b begins, both of which are known.

    corner : of the second pole, in a cell [rad]; 0: there is none
    """
    s0, s1 = own[SEEN + a], own[SEEN + b]
    v0, v1 = own[NOISE + a] - s0, own[NOISE + b] - s1
    if b - a == 1:  # the Bezier points of the cubic
        b0, b1 = s0 + corner * v0 / 3.0, s1 - corner * v1 / 3.0
        return max(s0, s1, b0, b1), min(s0, s1, b0, b1)
    count = float(b - a)
    reach = own[_IN_CELL + law.CELL_REACH] * math.sqrt(count)
    if corner > 0.0:
        reach *= count
    reach = min(reach, own[_BY + law.REACH])
    bend = min(_BEND * corner * count, own[_BY + law.BEND])
    high, low = bounds(_f(s0), _f(v0), _f(s1), _f(v1), _f(bend), _f(own[_BY + law.PULL]))
    return float(high) + reach, float(low) - reach


@kernel
def _over(count, e, g, d):
    """Return what n keeps, s takes of n, and s keeps over `count` cells; e, g, d: over one."""
    e_all, d_all = e**count, d**count
    if abs(e - d) > 1e-9:
        return e_all, g * (e_all - d_all) / (e - d), d_all
    return e_all, g * count * e ** (count - 1), d_all


@kernel
def _variances(e, g, d, share):
    """Covariances of what is new of n and s over a time, for noise of rms 1."""
    return (
        1.0 - e * e,
        share - e * (g + d * share),
        share - (g * g + 2.0 * g * d * share + d * d * share),
    )


@kernel
def draw_at(i, c, r, a, b, follows, rms, seed, own):
    """Draw what is where cell r begins, behind sample c of pixel i, given that at a < r and b > r.

    It is drawn once: the second time it is known.
    """
    if own[_KNOWN + r] != 0.0:
        return
    own[_KNOWN + r] = 1.0
    n0, s0, n1, s1 = own[NOISE + a], own[SEEN + a], own[NOISE + b], own[SEEN + b]
    number = (int(own[_PIECE]) * MOST_CELLS + c) * MOST_CELLS + r
    z, v = rng.normal_pair(seed, rng.PHOTORECEPTOR_BETWEEN, i, number)
    e, g = own[_IN_CELL + law.CELL_N], own[_IN_CELL + law.CELL_GIVEN]
    d, share = own[_IN_CELL + law.CELL_S], own[_IN_CELL + law.SHARE]
    if not follows:
        e0, e1 = e ** (r - a), e ** (b - r)
        nn = 1.0 - e0 * e0
        gain = nn * e1 / (1.0 - e0 * e1 * e0 * e1)
        n = e0 * n0 + gain * (n1 - e0 * e1 * n0) + rms * math.sqrt(nn * (1.0 - gain * e1)) * z
        own[NOISE + r], own[SEEN + r] = n, n
        return
    e0, g0, d0 = _over(r - a, e, g, d)
    e1, g1, d1 = _over(b - r, e, g, d)
    e2, g2, d2 = e0 * e1, g1 * e0 + d1 * g0, d0 * d1
    nn, ns, ss = _variances(e0, g0, d0, share)
    all_nn, all_ns, all_ss = _variances(e2, g2, d2, share)
    size = 1.0 / (all_nn * all_ss - all_ns * all_ns)
    # covariances of n and s there with both at the end, and from them the gain
    nn_1, ns_1 = nn * e1, nn * g1 + ns * d1
    sn_1, ss_1 = ns * e1, ns * g1 + ss * d1
    k_nn, k_ns = (nn_1 * all_ss - ns_1 * all_ns) * size, (ns_1 * all_nn - nn_1 * all_ns) * size
    k_sn, k_ss = (sn_1 * all_ss - ss_1 * all_ns) * size, (ss_1 * all_nn - sn_1 * all_ns) * size
    off_n, off_s = n1 - e2 * n0, s1 - g2 * n0 - d2 * s0
    by_n = math.sqrt(max(nn - k_nn * nn_1 - k_ns * ns_1, 0.0))
    by_n_s = (ns - k_sn * nn_1 - k_ss * ns_1) / max(by_n, 1e-150)
    by_s = math.sqrt(max(ss - k_sn * sn_1 - k_ss * ss_1 - by_n_s * by_n_s, 0.0))
    own[NOISE + r] = e0 * n0 + k_nn * off_n + k_ns * off_s + rms * by_n * z
    own[SEEN + r] = g0 * n0 + d0 * s0 + k_sn * off_n + k_ss * off_s
    own[SEEN + r] += rms * (by_n_s * z + by_s * v)


@kernel
def cubic_of(r, start, width, corner, own):
    """Coefficients of what is seen in cell r, as a cubic of the place in a substep.

    The cell begins at place `start` of the substep, and is `width` of it.
    corner : of the second pole, in the cell [rad]; 0: there is none, and what is seen is a line.
    """
    s0, s1 = own[SEEN + r], own[SEEN + r + 1]
    v0 = corner * (own[NOISE + r] - s0)
    v1 = corner * (own[NOISE + r + 1] - s1)
    rise = s1 - s0
    a1, a2, a3 = v0, 3.0 * rise - 2.0 * v0 - v1, v0 + v1 - 2.0 * rise
    if corner == 0.0:
        a1, a2, a3 = rise, 0.0, 0.0
    scale = 1.0 / width
    a1, a2, a3 = a1 * scale, a2 * scale * scale, a3 * scale * scale * scale
    return (
        s0 - start * (a1 - start * (a2 - start * a3)),
        a1 - start * (2.0 * a2 - 3.0 * start * a3),
        a2 - 3.0 * start * a3,
        a3,
    )
