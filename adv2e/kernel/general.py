"""Circuits that neither lanes nor steps of time take: what may fire is solved by itself.

The K-step forms of the low-pass, with a second pole or not; ``exact`` without a low-pass, or with
the last interval as printed.
"""

from __future__ import annotations

import numpy as np

from adv2e.compiled import entry, kernel
from adv2e.effects.pixel.leak import fill_falls
from adv2e.kernel import general_screens as stepped
from adv2e.kernel import screen, special
from adv2e.kernel.event_buffer import tell_where
from adv2e.kernel.tile import load, solve_one
from adv2e.kernel.work_queue import claim
from adv2e.kernel.workspace import EXACT, S_LAG, S_LAG2, S_OFF, S_ON, S_REFERENCE, S_X


@kernel
def load_light(frames, before, share, first, count, circuit, rows, light, x):
    """Light and log intensity of a strip, `share` of the way from frame `before` to the next."""
    load(frames, before, share, first, count, 0.0, rows)
    stepped.load_strip(rows[screen.LIGHT_1 : screen.LIGHT_1 + count], circuit, light, x)


@kernel
def _bound(lo, count, ta, length, circuit, state, columns, falls, flags):
    """Row 4: lag at the end; flags: which pixels may fire, by bounds in double precision."""
    hi = lo + count
    x0, x1 = columns[1, :count], columns[3, :count]
    lag_end, low, high = columns[4, :count], columns[5, :count], columns[6, :count]
    lag = state[S_LAG, lo:hi]
    if circuit.filtered and (circuit.follower > 0.0 or circuit.update == EXACT):
        lag2 = state[S_LAG2, lo:hi] if circuit.follower > 0.0 else lag
        stepped.rest_hull(x0, x1, lag, lag2, circuit.update, count, lag_end, low, high)
    elif not circuit.filtered:
        stepped.line_hull(x0, x1, lag_end, count, low, high)
    else:
        stepped.stepped_lags(x0, x1, lag, length, circuit, count, columns[7:12], lag_end, low, high)
    stepped.flag_strip(
        low, high, state[S_REFERENCE, lo:hi], state[S_ON, lo:hi], state[S_OFF, lo:hi], falls,
        count, flags,
    )  # fmt: skip
    stepped.flag_due(lo, count, ta + length, circuit, state, flags)


@kernel
def _finish_unflagged(lo, count, state, lag_end, falls, flags):
    for k in range(count):
        if not flags[k]:
            state[S_LAG, lo + k] = lag_end[k]
            state[S_REFERENCE, lo + k] -= falls[k]


@kernel
def _fill_falls(lo, count, length, circuit, state, columns, falls, means):
    for k in range(count):
        dx = columns[3, k] - columns[1, k]
        on_log = min(columns[1, k], columns[3, k]) >= circuit.knee and abs(dx) <= 1.0
        i0, i1 = columns[0, k], columns[2, k]
        means[k] = i1 * (1.0 - dx * special.psi(-dx)) if on_log else 0.5 * (i0 + i1)
    fill_falls(lo, count, length, means, circuit, state, falls)


@kernel
def samples(xa, xb, ahead, begins, is_last, next_is_last):
    """Continuity samples of an interval, as solve_interval takes them: start, base, step, end.

    With the paper's last interval as printed, the samples of a last one start from its end, but
    for the one at which the recording begins, and the interval before leads there.
    """
    base = xb if is_last else xa
    start = base if not begins else xa
    return start, base, xb - xa, ahead if next_is_last else xb


@kernel
def _swap(count, columns):
    for k in range(count):
        columns[0, k] = columns[2, k]
        columns[1, k] = columns[3, k]


@kernel
def _strip(
    lo, count, frames, before, share, starts, begins, last, circuit, t_base, state,
    scratch, keys, times, n,
):  # fmt: skip
    """Advance one strip over all intervals."""
    columns, flags, falls = scratch.columns, scratch.flags, scratch.falls
    leaks = circuit.leak > 0.0 or circuit.photo_leak > 0.0
    rows = scratch.rows
    load_light(
        frames, before[0], share[0], lo, count, circuit, rows, columns[0, :count],
        columns[1, :count],
    )  # fmt: skip
    for f in range(starts.shape[0] - 1):
        ta, length = starts[f], starts[f + 1] - starts[f]
        load_light(
            frames, before[f + 1], share[f + 1], lo, count, circuit, rows, columns[2, :count],
            columns[3, :count],
        )  # fmt: skip
        for k in range(count):
            flags[k] = True
        if not (last[f] or last[f + 1]):
            if leaks:
                _fill_falls(lo, count, length, circuit, state, columns, falls, scratch.means)
            _bound(lo, count, ta, length, circuit, state, columns, falls, flags)
            _finish_unflagged(lo, count, state, columns[4], falls, flags)
        if last[f + 1]:
            load_light(
                frames, before[f + 2], share[f + 2], lo, count, circuit, rows, columns[12, :count],
                columns[13, :count],
            )  # fmt: skip
        for k in range(count):
            if flags[k]:
                xs, base, step, end = samples(
                    columns[1, k], columns[3, k], columns[13, k], begins and f == 0, last[f],
                    last[f + 1],
                )  # fmt: skip
                n, keys, times = solve_one(
                    lo + k, xs, base, step, end, ta, length, t_base, circuit, state, scratch.ws,
                    keys, times, n,
                )  # fmt: skip
        _swap(count, columns)
    for k in range(count):
        state[S_X, lo + k] = columns[1, k]
    return n, keys, times


@entry
def run_general(
    claimed, most, frames, before, share, starts, begins, last, circuit, rules, t_base,
    state, scratch, keys, times, places,
):  # fmt: skip
    """Advance strips that nobody else works on; see :func:`adv2e.kernel.exact.run_exact`."""
    n = np.int64(0)
    for _ in range(most):
        lo, hi = claim(claimed, state.shape[1])
        if lo == hi:
            break
        n, keys, times = _strip(
            lo, hi - lo, frames, before, share, starts, begins, last, circuit, t_base, state,
            scratch, keys, times, n,
        )  # fmt: skip
    tell_where(keys, times, places)
    return n
