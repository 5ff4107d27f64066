"""Refinement pass: bound the noise of pixels that the screen flagged more tightly, in lanes.

It draws more of the photoreceptor noise where that may cross a threshold, and finds the earliest
place in a piece at which each pixel may fire.  Most of them do not.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from adv2e.compiled import kernel
from adv2e.kernel import screen
from adv2e.kernel.borrowing import borrowed
from adv2e.kernel.cascade import screen as cascade
from adv2e.kernel.photoreceptor import path as noise
from adv2e.kernel.photoreceptor.law import MOST_CELLS
from adv2e.kernel.photoreceptor.path import LANES, THERE
from adv2e.kernel.screen import STRIDE

(
    _AWAY,  # x less the reference at the start of the piece
    _DX,  # change of x in the piece
    _MOST,  # fall of the reference over the piece, at its fastest and at its slowest
    _LEAST,
    _ON,  # thresholds
    _OFF,
    _HIGH,  # bounds of the noise between two samples
    _LOW,
    _PLACE,  # where it reaches a threshold first; beyond 1: nowhere
    _UP_THERE,  # the same of stretches: noise that reaches a threshold
    _DOWN_THERE,
    _PLACE_THERE,  # and where it does, as a share of the stretch
    _UP,  # noise that reaches a threshold between two samples: see `Look.room`
) = (row * LANES for row in range(13))
_DOWN = _UP + (MOST_CELLS + 1) * LANES
_SIZE = _DOWN + (MOST_CELLS + 1) * LANES

_NOWHERE = 2.0
_NEVER = 1e30
_ROUNDING = 1e-6
"""Largest error of a place in single precision: so much too late at most."""

_MANY = 0.5
"""Share of the pixels above which a stretch is drawn for all of them: no copies are needed."""

_f = np.float32
_ZERO, _ONE = _f(0.0), _f(1.0)


class Look(NamedTuple):
    """Memory for the lanes."""

    rows: NDArray[np.float32]
    room: NDArray[np.int64]  # (MOST_CELLS,): where in _UP and _DOWN that of each stretch begins
    found: NDArray[np.float64]  # (LANES,): places in the piece


def new_look() -> Look:
    """Return fresh memory."""
    return Look(np.zeros(_SIZE, np.float32), np.zeros(MOST_CELLS, np.int64), np.zeros(LANES))


@kernel
def _load(size, pixels, factor, photo_leak, strip, rows):
    """Load distance, thresholds and leak of these pixels from the strip into the lanes."""
    for c in range(size):
        k = pixels[c]
        rows[_AWAY + c] = strip[screen.AWAY_0 + k]
        rows[_DX + c] = strip[screen.DX + k]
        rows[_ON + c] = strip[screen.ON + k] * factor
        rows[_OFF + c] = strip[screen.OFF + k] * factor
        reason = strip[screen.HIT + k]
        rows[_PLACE + c] = _f(_NOWHERE) if reason == screen.BY_SIGNAL else _ZERO
        if reason == screen.BY_ITSELF:  # rows of its lags do not hold
            rows[_ON + c] = rows[_OFF + c] = -_f(_NEVER)
        fall, i0, i1 = strip[screen.FALL + k], strip[screen.LIGHT_0 + k], strip[screen.LIGHT_1 + k]
        ratio = max(i0, i1) / max(min(i0, i1), _f(1e-30)) if photo_leak else _ONE
        rows[_MOST + c], rows[_LEAST + c] = fall * ratio, fall / ratio


@kernel
def _leave_room(size, a, b, room, pixels, places, strip, rows):
    """Rows _UP and _DOWN from `room` on: noise that may cross a threshold in substeps a to b."""
    first, second = cascade.FIRST + a * STRIDE, cascade.SECOND + a * STRIDE
    on = (b - a) * STRIDE
    begin, end, span = _f(places[a]), _f(places[b]), _f(places[b] - places[a])
    for c in range(size):
        k = pixels[c]
        u0, u1 = strip[first + k], strip[first + on + k]
        q0, q1 = strip[second + k], strip[second + on + k]
        d = rows[_DX + c] * span
        # as in substep.hull
        turns = u0 * u1 < _ZERO
        flees = ((u0 + u1 <= _ZERO) & (q0 <= u0)) | ((u0 + u1 >= _ZERO) & (q0 >= u0))
        high, low = max(u0, q0, d + u1), min(u0, q0, d + u1)
        high, low = max(high, _ZERO, d) if turns else high, min(low, _ZERO, d) if turns else low
        simple = flees & (not turns)
        high = max(q0, d + q1) if simple else high
        low = min(q0, d + q1) if simple else low
        away = rows[_AWAY + c] + rows[_DX + c] * begin
        rows[_UP + room + c] = rows[_ON + c] - (away + high + rows[_MOST + c] * end)
        rows[_DOWN + room + c] = rows[_OFF + c] + (away + low + rows[_LEAST + c] * begin)


@kernel
def _leave_rooms(size, piece, samples, memory, look):
    """Rows _UP and _DOWN of each stretch, those of the substeps in which it is."""
    strip, pixels, substeps, places = memory.rows, memory.pixels, piece.substeps, piece.places
    a, b, room = np.int64(0), np.int64(1), np.int64(0)
    _leave_room(size, a, b, room, pixels, places, strip, look.rows)
    for s in range(samples):
        begins, ends = a, b
        while begins + 1 < substeps and places[begins + 1] * samples <= s:
            begins += 1
        while ends < substeps and places[ends] * samples < s + 1:
            ends += 1
        if begins != a or ends != b:
            a, b, room = begins, ends, room + LANES
            _leave_room(size, a, b, room, pixels, places, strip, look.rows)
        look.room[s] = room


@kernel
def _look_at_cells(size, first, count, shift, scale, third, seen, rows, up, down, found):
    """Fill `found` with the first of `count` cells in which noise may reach a threshold.

    first : row of the first cell; shift, scale : its place, and the length of each
    third : a third of the corner of the second pole in the cell [rad]
    """
    for r in range(count):
        at, place = (first + r) * LANES, _f(max(shift + r * scale - _ROUNDING, 0.0))
        n0, n1 = rows[at : at + size], rows[at + LANES : at + LANES + size]
        s0 = rows[seen + at : seen + at + size]
        s1 = rows[seen + at + LANES : seen + at + LANES + size]
        for c in range(size):
            high, low = noise.bounds_in_cell(n0[c], s0[c], n1[c], s1[c], third)
            hit = (high >= up[c]) | (-low >= down[c])
            found[c] = place if hit & (found[c] > place) else found[c]


@kernel
def _look_at_stretches(count, samples, levels, third, seen, circuit, path, look):
    """Draw the first `count` stretches and note the places at which they may reach a threshold."""
    rows = look.rows
    noise.draw_stretches(count, levels, circuit, path)
    for t in range(count):
        c, s = noise.origin(t, path)
        rows[_UP_THERE + t] = rows[_UP + look.room[s] + c]
        rows[_DOWN_THERE + t] = rows[_DOWN + look.room[s] + c]
        rows[_PLACE_THERE + t] = _f(_NOWHERE)
    q = np.int64(1) << levels
    _look_at_cells(
        count, 0, q, 0.0, 1.0 / q, third, seen, path.rows[THERE:],
        rows[_UP_THERE : _UP_THERE + LANES], rows[_DOWN_THERE : _DOWN_THERE + LANES],
        rows[_PLACE_THERE : _PLACE_THERE + LANES],
    )  # fmt: skip
    for t in range(count):
        if rows[_PLACE_THERE + t] <= _ONE:
            c, s = noise.origin(t, path)
            place = (float(s) + rows[_PLACE_THERE + t]) / samples
            rows[_PLACE + c] = min(rows[_PLACE + c], _f(max(place - _ROUNDING, 0.0)))


@kernel
def find_places(size, piece, circuit, memory, path, look):
    """Fill `look.found` with the earliest place in a piece at which each pixel may fire.

    A place beyond 1: the pixel cannot fire.  From that place on, all noise is drawn.

    Parameters
    ----------
    size : int
        Number of pixels, the samples of which are in `path`.
    piece : Piece
    memory : StripMemory
        With the numbers of these pixels.
    path : NoisePath
    look : Look
    """
    piece, memory, path, look = borrowed(piece, memory, path, look)
    rows, seen = look.rows, noise.seen_from(circuit)
    samples, levels = noise.grid(path)
    factor = _f(min(piece.levels[0], piece.levels[1]))
    _load(size, memory.pixels, factor, circuit.photo_leak > 0.0, memory.rows, rows)
    _leave_rooms(size, piece, samples, memory, look)
    cells, q, waiting = samples << levels, np.int64(1) << levels, np.int64(0)
    third = _f(circuit.follower * piece.length / (3.0 * cells))
    high, low = rows[_HIGH : _HIGH + LANES], rows[_LOW : _LOW + LANES]
    for s in range(samples):
        noise.bound_stretch(size, s, levels, seen, high, low, path.rows)
        up, down = rows[_UP + look.room[s] :], rows[_DOWN + look.room[s] :]
        many = np.int64(0)
        for c in range(size):
            many += (high[c] >= up[c]) | (-low[c] >= down[c])
        if many == 0:
            continue
        if many > _MANY * size or levels == 0:
            noise.draw_between(size, s, levels, circuit, path)
            _look_at_cells(
                size, s << levels, q, s / samples, 1.0 / cells, third, seen, path.rows, up, down,
                rows[_PLACE : _PLACE + LANES],
            )  # fmt: skip
            continue
        for c in range(size):
            if (high[c] >= up[c]) | (-low[c] >= down[c]):
                noise.wait(waiting, c, s, path)
                waiting += 1
                if waiting == LANES:
                    _look_at_stretches(waiting, samples, levels, third, seen, circuit, path, look)
                    waiting = np.int64(0)
    if waiting > 0:
        _look_at_stretches(waiting, samples, levels, third, seen, circuit, path, look)
    for c in range(size):
        look.found[c] = rows[_PLACE + c]
    noise.draw_rest(size, look.found, circuit, path)
