"""A tile over several intervals: screen all its pixels, solve the few that can fire."""

from __future__ import annotations

import numpy as np

from adv2e.jit import allocating_kernel, kernel
from adv2e.kernel import batch, screen, special
from adv2e.kernel.comparator import put_found
from adv2e.kernel.screen import STRIP
from adv2e.kernel.solve import solve_interval
from adv2e.kernel.workspace import (
    EXACT,
    S_HOLD,
    S_HOT_TIME,
    S_LAG,
    S_LAG2,
    S_LEAK_FACTOR,
    S_LIGHT,
    S_OFF,
    S_ON,
    S_REFERENCE,
    S_SHOT_TIME,
    S_X,
    SAVED,
)


@kernel
def _save(i, state, ws):
    for row in range(S_LAG, state.shape[0]):
        ws[SAVED, row] = state[row, i]


@kernel
def _restore(i, state, ws):
    for row in range(S_LAG, state.shape[0]):
        state[row, i] = ws[SAVED, row]


@allocating_kernel
def _grown(old, used, needed):
    """Return a longer array with the first `used` entries of the old one."""
    new = np.empty(2 * old.shape[0] + needed, old.dtype)
    for k in range(used):  # a loop: assigning slices costs two seconds of compile time
        new[k] = old[k]
    return new


@kernel
def _falls(lo, count, i0, i1, x0, x1, length, circuit, state, fall):
    """Fall of the reference by leak over the interval, for each pixel of a strip."""
    for k in range(count):
        fall[k] = 0.0
    if circuit.leak > 0.0 or circuit.photo_leak > 0.0:
        for k in range(count):
            dx = x1[k] - x0[k]
            on_log = min(x0[k], x1[k]) >= circuit.knee and abs(dx) <= 1.0
            z = -dx if on_log else 0.0
            mean = i1[k] * (1.0 - dx * special.psi(z)) if on_log else 0.5 * (i0[k] + i1[k])
            fall[k] = state[S_ON, lo + k] * length * (circuit.leak + circuit.photo_leak * mean)
        if circuit.leak_jitter > 0.0:
            for k in range(count):
                fall[k] *= state[S_LEAK_FACTOR, lo + k]


@kernel
def _flag_due(lo, count, t_end, circuit, state, flags, any_flag):
    """Flag the pixels in dead time, and those with a noise event due."""
    if circuit.dead_time > 0.0:
        for k in range(count):
            if state[S_HOLD, lo + k] >= 0.0:
                flags[k] = True
                any_flag = True
    if circuit.shot_rate > 0.0:
        for k in range(count):
            if state[S_SHOT_TIME, lo + k] < t_end:
                flags[k] = True
                any_flag = True
    if circuit.hot_rate > 0.0:
        for k in range(count):
            if state[S_HOT_TIME, lo + k] < t_end:
                flags[k] = True
                any_flag = True
    return any_flag


@kernel
def _screen_strip(lo, count, i1, x1, ta, length, circuit, nodes, weights, state, columns, flags):
    """Move the unflagged pixels of a strip over the interval; flags say which are left."""
    hi = lo + count
    i0, x0 = state[S_LIGHT, lo:hi], state[S_X, lo:hi]
    lag, reference = state[S_LAG, lo:hi], state[S_REFERENCE, lo:hi]
    lag_end, fall = columns[5, :count], columns[6, :count]
    low, high = columns[11, :count], columns[12, :count]
    for k in range(count):
        lag_end[k] = 0.0
    if circuit.follower > 0.0:
        screen.rest_hull(x0, x1, lag, state[S_LAG2, lo:hi], count, low, high)
        for k in range(count):
            lag_end[k] = lag[k]
    elif not circuit.filtered:
        screen.hull(i0, x0, x1, lag, lag_end, length, circuit, count, low, high)
    elif circuit.update == EXACT:
        screen.end_lags(
            i0, i1, x0, x1, lag, length, circuit, nodes, weights, count, columns, lag_end
        )
        screen.hull(i0, x0, x1, lag, lag_end, length, circuit, count, low, high)
    else:
        screen.stepped_lags(
            i0, i1, x0, x1, lag, length, circuit, count, columns, lag_end, low, high
        )
    _falls(lo, count, i0, i1, x0, x1, length, circuit, state, fall)
    any_flag = screen.flag_strip(
        i1, x0, x1, low, high, reference, state[S_ON, lo:hi], state[S_OFF, lo:hi], fall,
        circuit.knee, count, flags,
    )  # fmt: skip
    any_flag = _flag_due(lo, count, ta + length, circuit, state, flags, any_flag)
    for k in range(count):
        if not flags[k]:
            lag[k] = lag_end[k]
            reference[k] -= fall[k]
    return any_flag


@allocating_kernel
def _with_room(keys, times, used, needed):
    """Return the two arrays of events, longer where they cannot hold `needed`."""
    if needed > keys.shape[0]:
        if times.shape[0] > 0:
            times = _grown(times, used, needed)
        keys = _grown(keys, used, needed)
    return keys, times


@allocating_kernel
def _solve_in_batches(
    lo, count, i1, x1, ta, length, circuit, nodes, weights, t_base, state, columns, flags, items,
    keep, found_time, found_pixel, keys, times, n,
):  # fmt: skip
    """Solve the usual crossings among the flagged pixels of a strip, and clear their flags."""
    lag_end, fall = columns[5], columns[6]
    k = 0
    while k < count:
        m, k = batch.gather(
            k, lo, count, i1, x1, lag_end, fall, ta, length, circuit, state, flags, items
        )
        if m > 0:
            m = batch.solve_items(
                lo, m, ta, length, circuit, nodes, weights, state, flags, items, keep, found_time,
                found_pixel,
            )  # fmt: skip
            keys, times = _with_room(keys, times, n, n + m)
            n = put_found(lo, m, found_time, found_pixel, t_base, keys, times, n)
    return n, keys, times


@kernel
def _samples(xa, xb, ahead, begins, is_last, next_is_last):
    """Continuity samples of an interval, as solve_interval takes them: start, base, step, end.

    With the paper's last interval as printed, the samples of a last one start from its end, but
    for the one at which the recording begins, and the interval before leads there.
    """
    base = xb if is_last else xa
    start = base if not begins else xa
    return start, base, xb - xa, ahead if next_is_last else xb


@allocating_kernel
def _solve_singly(
    lo, count, x1, ahead, begins, is_last, next_is_last, ta, length, t_base, circuit, state, ws,
    flags, keys, times, n,
):  # fmt: skip
    """Solve the flagged pixels of a strip one by one."""
    for k in range(count):
        if not flags[k]:
            continue
        i = lo + k
        start, base, step, end = _samples(
            state[S_X, i], x1[k], ahead[k], begins, is_last, next_is_last
        )
        _save(i, state, ws)
        while True:
            m = solve_interval(
                i, start, base, step, end, ta, length, t_base, circuit, state, ws, keys, times, n
            )
            if m <= keys.shape[0]:
                break
            keys, times = _with_room(keys, times, n, m)
            _restore(i, state, ws)
        n = m
    return n, keys, times


@allocating_kernel
def run_tile(
    lo, hi, frames, starts, first, last, floor, circuit, nodes, weights, counts, t_base,
    state, ws, columns, flags, items, keep, found_time, found_pixel, keys, times,
):  # fmt: skip
    """Advance the pixels lo..hi over the intervals between neighbouring frames.

    Parameters
    ----------
    frames : (intervals + 1, pixels)
        Light [DN]; with the printed last interval one more frame follows, for the look-ahead.
    starts : (intervals + 1,)
        Times of the frames since the start of the recording [us].
    first : bool
        Whether the recording begins here.
    last : (intervals + 1,)
        With the paper's last interval as printed: which intervals are the last of an input
        interval (the final entry looks ahead); else all False.
    nodes, weights : (intervals, NODES_MAX); counts : (intervals,)
        Quadrature for each interval.

    Returns
    -------
    events written, and the arrays that hold them (larger ones where the given ones were full)
    """
    n = 0
    screened = circuit.noise_rms == 0.0
    batched = screened and circuit.update == EXACT and circuit.filtered and circuit.follower == 0.0
    for f in range(starts.shape[0] - 1):
        ta = starts[f]
        length = starts[f + 1] - ta
        node, weight = nodes[f, : counts[f]], weights[f, : counts[f]]
        one_line = not (last[f] or last[f + 1])
        for s in range(lo, hi, STRIP):
            count = min(STRIP, hi - s)
            i1, x1, ahead = columns[7, :count], columns[8, :count], columns[9, :count]
            screen.load_strip(frames[f + 1, s : s + count], circuit, floor, i1, x1)
            any_flag = True
            if screened and one_line:
                any_flag = _screen_strip(
                    s, count, i1, x1, ta, length, circuit, node, weight, state, columns, flags
                )
            else:
                for k in range(count):
                    flags[k] = True
            if any_flag and one_line and batched:
                n, keys, times = _solve_in_batches(
                    s, count, i1, x1, ta, length, circuit, node, weight, t_base, state, columns,
                    flags, items, keep, found_time, found_pixel, keys, times, n,
                )  # fmt: skip
            if any_flag:
                if last[f + 1]:
                    screen.load_strip(
                        frames[f + 2, s : s + count], circuit, floor, columns[10, :count], ahead
                    )
                n, keys, times = _solve_singly(
                    s, count, x1, ahead, first and f == 0, last[f], last[f + 1], ta, length,
                    t_base, circuit, state, ws, flags, keys, times, n,
                )  # fmt: skip
            for k in range(count):
                state[S_LIGHT, s + k] = i1[k]
                state[S_X, s + k] = x1[k]
    return n, keys, times
