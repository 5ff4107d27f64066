"""The exact circuit over a tile: a screen for all pixels of a strip, then those that may fire.

One pole is solved in lanes, several pixels side by side; a second pole, and what else lanes do not
have, by :mod:`adv2e.kernel.cascade`.  A strip's rows stay in cache from frame to frame, so the
state of the pixels is read and written once a call, and only the frames stream through memory.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from adv2e.compiled import in_parts, inlined, kernel
from adv2e.kernel import per_pixel, screen, static_pixels
from adv2e.kernel.borrowing import borrowed
from adv2e.kernel.cascade import advance as cascade
from adv2e.kernel.cascade import screen as cascade_screen
from adv2e.kernel.comparator import with_room
from adv2e.kernel.inputs import EXACT, Circuit, Interval, load, rests
from adv2e.kernel.lanes import batch, rows
from adv2e.kernel.leak import leak_strip, leaks, lower_references
from adv2e.kernel.photoreceptor import strip as photoreceptor
from adv2e.kernel.quadrature import Rule
from adv2e.kernel.work_queue import STRIP, claim

_f = np.float32


class StripMemory(NamedTuple):
    """Memory for the pixels of a strip."""

    rows: NDArray[np.float32]  # of the screens
    lanes: NDArray[np.float64]
    pixels: NDArray[np.int64]  # numbers of those that may fire
    falls: NDArray[np.float64]  # of the reference over the interval
    means: NDArray[np.float64]  # of the light there [DN]


class ExactMemory(NamedTuple):
    """Memory of whoever works on a strip."""

    strip: StripMemory
    cascade: cascade.CascadeMemory


def new_memory() -> ExactMemory:
    """Return fresh memory."""
    pixels = np.zeros(STRIP + rows.WIDTH, np.int64)
    strip = StripMemory(
        cascade_screen.new_rows(), rows.new_rows(), pixels, np.zeros(STRIP), np.zeros(STRIP)
    )
    return ExactMemory(strip, cascade.new_memory())


def covers(circuit: Circuit) -> bool:
    """Tell whether this module advances the circuit; if not, it is solved in steps of time."""
    plain = max(circuit.slew, circuit.high) == 0.0 and not circuit.printed
    return circuit.update == EXACT and circuit.filtered and plain


@kernel
def _rests(schedule, f, first, count):
    """Tell whether a strip's light is that of the instant before, as both frames are the same."""
    before = schedule.before[f + 1]
    at_frame = schedule.before[f] == before - 1 and schedule.share[f] == _f(1.0)
    return (at_frame or schedule.before[f] == before) and rests(schedule, f + 1, first, count)


@kernel
def _open_strip(lo, count, start, circuit, state, strip, noise):
    """Rows of a strip at the start of a call, its light being in LIGHT_1."""
    noise.law[0] = 0
    # slices: indices that count from zero need no test of their sign, which vectors bear ill
    behind, seen = state[per_pixel.NOISE, lo : lo + count], state[per_pixel.SEEN, lo : lo + count]
    first, second = state[per_pixel.LAG, lo : lo + count], state[per_pixel.SECOND, lo : lo + count]
    for k in range(count):
        noise.rows[photoreceptor.NOISE + k] = behind[k]
        noise.rows[photoreceptor.SEEN + k] = seen[k]
    for k in range(count):
        strip[screen.LIGHT_0 + k] = strip[screen.LIGHT_1 + k]
        strip[screen.LAG_0 + k] = first[k]
        strip[cascade_screen.SECOND + k] = second[k]
    screen.watch_all(lo, count, start, circuit, state, strip)
    # the rest of the last strip must be harmless
    for k in range(count, STRIP):
        strip[screen.LIGHT_0 + k] = 1.0
        strip[screen.LIGHT_1 + k] = 1.0
        strip[screen.LAG_0 + k] = 0.0
        strip[cascade_screen.SECOND + k] = 0.0
        strip[screen.AWAY_0 + k] = 0.0
        strip[screen.FALL + k] = 0.0
        strip[screen.ON + k] = screen.NEVER
        strip[screen.OFF + k] = screen.NEVER
        strip[screen.DUE + k] = screen.NEVER


@kernel
def _close_strip(lo, count, piece, circuit, state, strip, noise):
    """State of a strip at the end of a call, before piece number `piece` of all."""
    # slices, as above
    if circuit.noise_rms > 0.0:
        behind = state[per_pixel.NOISE, lo : lo + count]
        seen = state[per_pixel.SEEN, lo : lo + count]
        drawn = state[per_pixel.NOISE_DRAW, lo : lo + count]
        for k in range(count):
            behind[k] = noise.rows[photoreceptor.NOISE + k]
            seen[k] = noise.rows[photoreceptor.SEEN + k]
            drawn[k] = piece
    first, second = state[per_pixel.LAG, lo : lo + count], state[per_pixel.SECOND, lo : lo + count]
    x = state[per_pixel.X, lo : lo + count]
    for k in range(count):
        first[k] = strip[screen.LAG_0 + k]
        second[k] = strip[cascade_screen.SECOND + k]
    for k in range(count):
        x[k] = screen.log_of(np.float64(strip[screen.LIGHT_0 + k]), circuit)


@inlined
def _screen(strip, end, length, circuit, rule):
    screen.screen(
        strip, end, _f(circuit.dark * length), _f(circuit.per_dn * length),
        _f(circuit.slope * circuit.knee), _f(circuit.slope), rule,
    )  # fmt: skip


@kernel
def _solve_flagged(lo, m, interval, circuit, rule, state, memory, buffer, n):
    """Solve the m pixels whose numbers are in memory.pixels, in lanes."""
    waiting = batch.held_first(m, memory.rows, memory.pixels)
    batch.load(lo, m, interval, circuit, state, memory)
    while True:
        buffer = with_room(buffer, n, n + 2 * m)
        m, n = batch.decide(lo, m, waiting, interval, circuit, rule, state, memory, buffer, n)
        if m == 0:
            return n, buffer
        n, waiting = batch.search(lo, m, interval, circuit, rule, state, memory, buffer, n)


@inlined
def _advance_strip(lo, count, interval, circuit, rule, state, memory, buffer, n):
    """Advance one strip over one interval, whose light is in LIGHT_0 and LIGHT_1."""
    strip, length = memory.rows, interval.length
    has_leak = leaks(circuit)
    if has_leak:
        leak_strip(lo, count, length, circuit, state, memory)
    _screen(strip, _f(interval.start + length - interval.origin), length, circuit, rule)
    m = screen.flagged(strip, memory.pixels)
    if m > 0:
        n, buffer = _solve_flagged(lo, m, interval, circuit, rule, state, memory, buffer, n)
    if has_leak:
        lower_references(lo, 0, count, state, memory)
    screen.step_on(strip)
    return n, buffer


@inlined
def _rule(rules, f):
    """Return the quadrature of interval f."""
    count, dead = rules.counts[f], rules.counts_dead[f]
    return Rule(
        rules.nodes[f, :count], rules.weights[f, :count],
        rules.nodes_dead[f, :dead], rules.weights_dead[f, :dead],
    )  # fmt: skip


@inlined
def _strip(lo, count, schedule, circuit, rules, plan, state, memory, buffer, n):
    """Advance one strip of the exact circuit over all intervals."""
    schedule, all_rules, state, memory = borrowed(schedule, rules, state, memory)
    frames, before, share, starts = (
        schedule.frames, schedule.before, schedule.share, schedule.starts,
    )  # fmt: skip
    # what rests for long is gone through in closed form, where only leak and noise can fire
    may_rest = True
    if plan is not None:
        may_rest = plan.simple and not circuit.causes
    own = memory.strip
    strip = own.rows
    light = strip[screen.LIGHT_1 : screen.LIGHT_1 + count]
    floor = 0.0 if circuit.slope > 0.0 else circuit.floor
    start = starts[0]
    load(frames, before[0], share[0], lo, floor, light)
    _open_strip(lo, count, start, circuit, state, strip, memory.cascade.noise)
    number = np.int64(state[per_pixel.NOISE_DRAW, lo])
    has_leak = leaks(circuit)
    intervals = starts.shape[0] - 1
    settled, resting = cascade_screen.is_settled(strip), False
    f = np.int64(0)
    while f < intervals:
        same = _rests(schedule, f, lo, count)
        still = same
        if not still:
            load(frames, before[f + 1], share[f + 1], lo, floor, light)
            still = screen.is_still(strip)
        if still and settled and may_rest:
            if not resting:
                if has_leak:
                    leak_strip(lo, count, 1.0, circuit, state, own)
                static_pixels.begin_rest(_f(starts[f] - start), strip)
                resting = True
            last = f + 1
            while last < intervals and _rests(schedule, last, lo, count):
                last += 1
            n, buffer = static_pixels.go_through(
                lo, count, f, last, starts, circuit, state, own, buffer, n
            )
            f = last
            continue
        if resting and has_leak:
            static_pixels.end_rest(lo, count, circuit, state, strip)
        resting = False
        until = f + 1
        if plan is not None:
            until = plan.until[f] if same and settled else until
        interval = Interval(f, start, starts[f], starts[until] - starts[f])
        # of an argument that is None the compiler knows it, and compiles one of the two
        if plan is None:
            if rules is not None:
                rule = _rule(all_rules, f)
                n, buffer = _advance_strip(
                    lo, count, interval, circuit, rule, state, own, buffer, n
                )
        else:
            n, buffer, number = cascade.advance(
                lo, count, interval, until, number, still and settled, circuit, plan, state,
                memory, buffer, n,
            )  # fmt: skip
        settled = still and (settled or cascade_screen.is_settled(strip))
        f = until
    _close_strip(lo, count, number, circuit, state, strip, memory.cascade.noise)
    return n, buffer


@kernel
def run_exact(claimed, most, schedule, circuit, rules, plan, state, memory, buffer):
    """Advance strips that nobody else works on over the intervals between neighbouring frames.

    Parameters
    ----------
    claimed : (1,)
        See :mod:`adv2e.kernel.work_queue`.
    most : int
        Strips after which to return, though there may be more.
    schedule : Schedule
    rules : Rules or None
        Quadrature for each interval; None where the cascade does.
    plan : Plan or None
        How each interval is cut for the cascade; None where lanes do.
    buffer : EventBuffer

    Returns
    -------
    events written, buffer
    """
    n = np.int64(0)
    for _ in range(most):
        lo, hi = claim(claimed, state.shape[1])
        if lo == hi:
            break
        n, buffer = _strip(lo, hi - lo, schedule, circuit, rules, plan, state, memory, buffer, n)
    return n, buffer


def _parts(claimed, most, schedule, circuit, rules, plan, state, memory, buffer):
    """Return parts of :func:`run_exact`, for a second process and this one."""
    own, strip, frames = memory.strip, memory.strip.rows, schedule.frames
    light, noise = strip[:1], memory.cascade.noise
    rest = [
        (static_pixels.go_through, (0, 0, 0, 0, schedule.starts, circuit, state, own, buffer, 0)),
        (load, (frames, 0, _f(0.0), 0, 0.0, light)),
        (_open_strip, (0, 0, 0.0, circuit, state, strip, noise)),
        (_close_strip, (0, 0, 0, circuit, state, strip, noise)),
        (_rests, (schedule, 0, 0, 0)),
        (leak_strip, (0, 0, 0.0, circuit, state, own)),
    ]
    if plan is None:
        interval = Interval(0, 0.0, 0.0, 0.0)
        rule = Rule(*(one[0] for one in rules if one.ndim > 1))
        lanes = interval, circuit, rule, state, own, buffer, 0
        ours = [
            (batch.load, (0, 0, interval, circuit, state, own)),
            (batch.search, (0, 0, *lanes)),
            (screen.screen, (strip, *[_f(0.0)] * 5, rule)),
        ]
        return [(batch.decide, (0, 0, 0, *lanes))], [*ours, *rest]
    theirs, ours = cascade.parts(circuit, plan, state, memory, buffer)
    return theirs, [*ours, *rest]


in_parts(run_exact, _parts)
