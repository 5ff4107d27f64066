"""The exact circuit over a tile: a screen for all pixels of a strip, then those that may fire.

One pole is solved in lanes, several pixels side by side; a second pole, and what else lanes do not
have, by :mod:`adv2e.kernel.cascade`.  A strip's rows stay in cache from frame to frame, so the
state of the pixels is read and written once a call, and only the frames stream through memory.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from adv2e.compiled import kernel
from adv2e.kernel import per_pixel, screen, special, static_pixels
from adv2e.kernel.borrowing import borrowed
from adv2e.kernel.cascade import pixel as alone
from adv2e.kernel.cascade import screen as cascade
from adv2e.kernel.cascade import second_look
from adv2e.kernel.circuit import EXACT, Circuit
from adv2e.kernel.event_buffer import with_room
from adv2e.kernel.frames import load
from adv2e.kernel.lanes import batch, exchange, rows
from adv2e.kernel.leak import fill_falls
from adv2e.kernel.photoreceptor import path as noise_path
from adv2e.kernel.photoreceptor import strip as photoreceptor
from adv2e.kernel.photoreceptor.path import LANES
from adv2e.kernel.quadrature import Rule
from adv2e.kernel.work_queue import STRIP, claim

_f = np.float32
_BLOCK = 256


class Scratch(NamedTuple):
    """Memory of whoever works on a tile."""

    strip: NDArray[np.float32]  # of the screen
    lanes: NDArray[np.float64]
    pixels: NDArray[np.int64]  # numbers of the lanes' pixels
    falls: NDArray[np.float64]
    means: NDArray[np.float64]
    x: NDArray[np.float64]  # log intensity at the start of an interval, how far it goes, and the
    dx: NDArray[np.float64]  # light at its end, where the interval is cut into pieces
    light: NDArray[np.float32]
    noise: photoreceptor.Scratch
    path: noise_path.Path  # and of that of a few pixels,
    places: NDArray[np.int64]  # which are at these places of the sorted strip
    look: second_look.Look
    nothing: NDArray[np.float64]  # places in a piece from which on pixels may fire: its start
    whole: NDArray[np.float64]  # ends of the one substep of a piece in which nothing moves


def scratch() -> Scratch:
    """Return fresh memory."""
    pixels = np.zeros(STRIP + rows.WIDTH, np.int64)
    falls, means, x, dx = (np.zeros(STRIP) for _ in range(4))
    light = np.ones(STRIP, np.float32)
    return Scratch(
        cascade.scratch(), rows.scratch(), pixels, falls, means, x, dx, light,
        photoreceptor.scratch(), noise_path.path(), np.zeros(LANES, np.int64),
        second_look.memory(), np.zeros(STRIP), np.arange(2.0),
    )  # fmt: skip


def covers(circuit: Circuit) -> bool:
    """Tell whether this module advances the circuit; if not, it is solved in steps of time."""
    plain = circuit.slew == 0.0 and not circuit.printed
    return circuit.update == EXACT and circuit.filtered and plain


@kernel
def _alike(a, b):
    """Tell whether two rows of grey values are equal."""
    changes = np.uint8(0)
    for k in range(a.shape[0]):
        # narrow on purpose: as many at a time as there are bytes in a vector
        changes = np.uint8(changes | np.uint8(a[k] ^ b[k]))
    return changes == 0


@kernel
def _rests(frames, f, before, share, first, count):
    """Tell whether the grey values of a strip are those of the instant before."""
    if not frames.coded or share[f] != _f(1.0) or share[f + 1] != _f(1.0):
        return False
    if before[f + 1] != before[f] + 1:
        return False
    now = before[f + 1] + 1
    for lo in range(first, first + count, _BLOCK):
        hi = min(lo + _BLOCK, first + count)
        # slices: indices that count from zero need no test of their sign, which vectors bear ill
        if not _alike(frames.codes[now - 1, lo:hi], frames.codes[now, lo:hi]):
            return False
    return True


@kernel
def _open_strip(lo, count, start, circuit, state, strip, noise):
    """Rows of a strip at the start of a call, its light being in LIGHT_1."""
    noise.kept[0] = 0
    for k in range(count):
        noise.rows[photoreceptor.NOISE + k] = state[per_pixel.NOISE, lo + k]
        noise.rows[photoreceptor.SEEN + k] = state[per_pixel.SEEN, lo + k]
    for k in range(count):
        strip[screen.LIGHT_0 + k] = strip[screen.LIGHT_1 + k]
        strip[screen.LAG_0 + k] = state[per_pixel.LAG, lo + k]
        strip[cascade.SECOND + k] = state[per_pixel.SECOND, lo + k]
    for k in range(count):
        i = lo + k
        exchange.watch(k, i, state[per_pixel.X, i], start, circuit, state, strip)
        strip[screen.AWAY_0 + k] = strip[screen.AWAY_1 + k]
    # the rest of the last strip must be harmless
    for k in range(count, STRIP):
        strip[screen.LIGHT_0 + k] = 1.0
        strip[screen.LIGHT_1 + k] = 1.0
        strip[screen.LAG_0 + k] = 0.0
        strip[cascade.SECOND + k] = 0.0
        strip[screen.AWAY_0 + k] = 0.0
        strip[screen.FALL + k] = 0.0
        strip[screen.ON + k] = screen.NEVER
        strip[screen.OFF + k] = screen.NEVER
        strip[screen.DUE + k] = screen.NEVER


@kernel
def _close_strip(lo, count, piece, circuit, state, strip, noise):
    """State of a strip at the end of a call, before piece number `piece` of all."""
    if circuit.noise_rms > 0.0:
        photoreceptor.put_back(count, noise)
        for k in range(count):
            state[per_pixel.NOISE, lo + k] = noise.rows[photoreceptor.NOISE + k]
            state[per_pixel.SEEN, lo + k] = noise.rows[photoreceptor.SEEN + k]
            state[per_pixel.NOISE_DRAW, lo + k] = piece
    for k in range(count):
        state[per_pixel.LAG, lo + k] = strip[screen.LAG_0 + k]
        state[per_pixel.SECOND, lo + k] = strip[cascade.SECOND + k]
        state[per_pixel.X, lo + k] = exchange.log_of(np.float64(strip[screen.LIGHT_0 + k]), circuit)


@kernel
def _mean_lights(strip, knee_dn, means):
    """Mean light of each pixel over the interval [DN]."""
    for k in range(STRIP):
        i0, i1 = strip[screen.LIGHT_0 + k], strip[screen.LIGHT_1 + k]
        dx = special.log_ratio32((i1 - i0) / (i1 + i0 + _f(1e-30)))
        grown = i1 * (_f(1.0) - dx * special.psi32(-dx))
        means[k] = grown if min(i0, i1) >= knee_dn else _f(0.5) * (i0 + i1)


@kernel
def _leak_strip(lo, count, length, circuit, state, strip, falls, means):
    """Fall of the reference of a strip over the interval."""
    if circuit.photo_leak > 0.0:
        _mean_lights(strip, _f(circuit.slope * circuit.knee), means)
    fill_falls(lo, count, length, means, circuit, state, falls)
    for k in range(count):
        strip[screen.FALL + k] = falls[k]


@kernel
def _lower_references(lo, count, state, strip, falls):
    """Take the fall from the references of the pixels that are done."""
    reference = state[per_pixel.REFERENCE, lo : lo + count]
    for k in range(count):
        fall = falls[k] if strip[screen.HIT + k] == 0.0 else 0.0
        reference[k] -= fall


@kernel
def _screen(strip, end, length, circuit, rule):
    screen.screen(
        strip, end, _f(circuit.dark * length), _f(circuit.per_dn * length),
        _f(circuit.slope * circuit.knee), _f(circuit.slope), rule,
    )  # fmt: skip


@kernel
def _solve_flagged(
    lo, m, start, ta, length, t_base, circuit, rule, state, scratch, keys, times, n
):  # fmt: skip
    """Solve the m pixels whose numbers are in scratch.pixels, in lanes."""
    strip, pixels, lanes = scratch.strip, scratch.pixels, scratch.lanes
    waiting = exchange.held_first(m, strip, pixels)
    exchange.load(lo, m, ta, length, circuit, state, strip, scratch.falls, pixels, lanes)
    while True:
        keys, times = with_room(keys, times, n, n + 2 * m)
        m, n = batch.decide(
            lo, m, waiting, start, ta, length, t_base, circuit, rule, state, strip, pixels, lanes,
            keys, times, n,
        )  # fmt: skip
        if m == 0:
            return n, keys, times
        n, waiting = batch.search(
            lo, m, ta, length, t_base, circuit, rule, state, pixels, lanes, keys, times, n
        )


@kernel
def _advance_strip(
    lo, count, start, ta, length, circuit, rule, t_base, state, scratch, keys, times, n
):  # fmt: skip
    """Advance one strip over one interval, whose light is in LIGHT_0 and LIGHT_1."""
    strip, falls = scratch.strip, scratch.falls
    leaks = circuit.leak > 0.0 or circuit.photo_leak > 0.0
    if leaks:
        _leak_strip(lo, count, length, circuit, state, strip, falls, scratch.means)
    _screen(strip, _f(ta + length - start), length, circuit, rule)
    m = screen.flagged(strip, scratch.pixels)
    if m > 0:
        n, keys, times = _solve_flagged(
            lo, m, start, ta, length, t_base, circuit, rule, state, scratch, keys, times, n
        )
    if leaks:
        _lower_references(lo, count, state, strip, falls)
    screen.step_on(strip)
    return n, keys, times


@kernel
def _begin_pieces(strip, circuit, scratch):
    """Keep how the light goes from LIGHT_0 to LIGHT_1."""
    for k in range(STRIP):
        x0 = exchange.log_of(np.float64(strip[screen.LIGHT_0 + k]), circuit)
        x1 = exchange.log_of(np.float64(strip[screen.LIGHT_1 + k]), circuit)
        scratch.x[k], scratch.dx[k] = x0, x1 - x0
        scratch.light[k] = strip[screen.LIGHT_1 + k]


@kernel
def _end_piece(share, strip, circuit, scratch):
    """Row LIGHT_1 at `share` of the interval."""
    for k in range(STRIP):
        x = scratch.x[k] + scratch.dx[k] * share
        light = special.exp(x)
        light = light if x >= circuit.knee else circuit.slope * x
        strip[screen.LIGHT_1 + k] = _f(light) if share < 1.0 else scratch.light[k]


@kernel
def _solve_alone(
    lo, m, ta, length, start, before, substeps, places, levels, t_base, circuit, samples, depth,
    state, scratch, pixels, found, keys, times, n,
):  # fmt: skip
    """Solve m pixels over a piece one by one; `samples` and `depth`: of their noise."""
    j, s = np.int64(0), 0.0
    while j < m:
        n, j, s = alone.solve_flagged(
            lo, j, m, s, ta, length, start, before, substeps, places, levels, t_base, circuit,
            samples, depth, scratch.path, state, scratch.strip, pixels, found, keys, times, n,
        )  # fmt: skip
        if j < m:
            keys, times = with_room(keys, times, n, n + 1)
    return n, keys, times


@kernel
def _solve_beside_noise(
    lo, number, which, ta, length, start, before, substeps, places, levels, t_base, circuit,
    laws, state, scratch, keys, times, n,
):  # fmt: skip
    """Solve the flagged pixels of a strip over piece `number` of all, which has law `which`."""
    strip, noise, path, pixels = scratch.strip, scratch.noise, scratch.path, scratch.pixels
    factor = _f(min(levels[0], levels[1]))
    for g in range(laws.samples.shape[1]):
        samples, depth, p = laws.samples[which, g], laws.levels[which, g], noise.ends[g]
        while p < noise.ends[g + 1]:
            size = np.int64(0)
            while p < noise.ends[g + 1] and size < LANES:
                k = noise.order[p]
                scratch.places[size], pixels[size] = p, k
                size += 1 if strip[screen.HIT + k] > 0.0 else 0
                p += 1
            if size == 0:
                break
            noise_path.sample(
                size, scratch.places, number, samples, depth, circuit, laws.fine[which], noise, path
            )
            second_look.find_places(
                size, pixels, substeps, places, length, samples, depth, factor, circuit, strip,
                path, scratch.look,
            )  # fmt: skip
            n, keys, times = _solve_alone(
                lo, size, ta, length, start, before, substeps, places, levels, t_base, circuit,
                samples, depth, state, scratch, pixels, scratch.look.found, keys, times, n,
            )  # fmt: skip
    return n, keys, times


@kernel
def _advance_cascade(
    lo, count, start, ta, length, f, number, still, circuit, plan, t_base, state, scratch, keys,
    times, n,
):  # fmt: skip
    """Advance one strip over interval f, piece by piece; `still`: nothing moves or lags in it.

    number : of its first piece, of all in the recording
    """
    (plan,) = borrowed(plan)
    strip, falls, pixels, noise = scratch.strip, scratch.falls, scratch.pixels, scratch.noise
    laws, cut = plan.laws, plan.cut[f]
    leaks = circuit.leak > 0.0 or circuit.photo_leak > 0.0
    is_noisy = circuit.noise_rms > 0.0
    pieces = plan.pieces[cut]
    first, rise = plan.factors[f], plan.factors[f + 1] - plan.factors[f]
    if pieces > 1 and not still:
        _begin_pieces(strip, circuit, scratch)
    for p in range(pieces):
        substeps, places, which = plan.substeps[cut, p], plan.places[cut, p], plan.law[cut, p]
        a, b = plan.ends[cut, p], plan.ends[cut, p + 1]
        t0, piece = ta + a * length, (b - a) * length
        levels = first + rise * a, first + rise * b
        if pieces > 1 and not still:
            _end_piece(b, strip, circuit, scratch)
        if leaks:
            _leak_strip(lo, count, piece, circuit, state, strip, falls, scratch.means)
        if still:
            substeps, places = np.int64(1), scratch.whole
            cascade.stay(strip)
        else:
            cascade.follow(strip, substeps, places, piece, circuit, plan.weights[cut, p])
        on, off, factor = screen.ON, screen.OFF, _f(min(levels[0], levels[1]))
        if is_noisy:
            photoreceptor.draw(lo, count, number + p, which, still, circuit, laws, strip, noise)
            cascade.leave_room(strip, factor, noise.rows)
            on, off, factor = cascade.ON, cascade.OFF, _f(1.0)
        end = _f(t0 + piece - start)
        if still:
            cascade.flag_still(strip, end, on, off, factor)
        else:
            screen.flag(
                strip, end, _f(circuit.dark * piece), _f(circuit.per_dn * piece),
                _f(circuit.slope * circuit.knee), cascade.SECOND,
                cascade.SECOND + substeps * screen.STRIDE, on, off, factor, cascade.LARGEST,
            )  # fmt: skip
        if is_noisy:
            n, keys, times = _solve_beside_noise(
                lo, number + p, which, t0, piece, start, a / (b - a), substeps, places, levels,
                t_base, circuit, laws, state, scratch, keys, times, n,
            )  # fmt: skip
        else:
            m = screen.flagged(strip, pixels)
            n, keys, times = _solve_alone(
                lo, m, t0, piece, start, a / (b - a), substeps, places, levels, t_base, circuit,
                np.int64(1), np.int64(0), state, scratch, pixels, scratch.nothing, keys, times, n,
            )  # fmt: skip
        if leaks:
            _lower_references(lo, count, state, strip, falls)
        cascade.step_on(strip, substeps, still)
    return n, keys, times


@kernel
def _rule(rules, f):
    """Return the quadrature of interval f."""
    count, dead = rules.counts[f], rules.counts_dead[f]
    return Rule(
        rules.nodes[f, :count], rules.weights[f, :count],
        rules.nodes_dead[f, :dead], rules.weights_dead[f, :dead],
    )  # fmt: skip


@kernel
def _rest_strip(
    lo, count, first, last, starts, circuit, t_base, state, scratch, keys, times, n
):  # fmt: skip
    """Advance one strip over the intervals first..last: no light changes, no lag is left."""
    # numbers of one type from the start: a function is compiled anew for a constant
    none = np.int64(0)
    b, f, j, m, s = none, first, none, none, 0.0
    while b < count:
        n, b, f, j, m, s = static_pixels.go_through(
            lo, count, b, f, j, m, s, first, last, starts, circuit, t_base, state, scratch.strip,
            scratch.falls, scratch.means, scratch.pixels, keys, times, n,
        )  # fmt: skip
        if b < count:
            keys, times = with_room(keys, times, n, n + 1)
    return n, keys, times


@kernel
def _strip(
    lo, count, frames, before, share, starts, circuit, rules, plan, t_base,
    state, scratch, keys, times, n,
):  # fmt: skip
    """Advance one strip of the exact circuit over all intervals."""
    frames, before, share, starts = borrowed(frames, before, share, starts)
    rules, state, scratch = borrowed(rules, state, scratch)
    # what rests for long is gone through in closed form, where only leak and noise can fire
    may_rest = True
    if plan is not None:
        may_rest = plan.simple and not circuit.causes
    strip = scratch.strip
    light = strip[screen.LIGHT_1 : screen.LIGHT_1 + count]
    floor = 0.0 if circuit.slope > 0.0 else circuit.floor
    start = starts[0]
    load(frames, before[0], share[0], lo, floor, light)
    _open_strip(lo, count, start, circuit, state, strip, scratch.noise)
    number = np.int64(state[per_pixel.NOISE_DRAW, lo])
    leaks = circuit.leak > 0.0 or circuit.photo_leak > 0.0
    intervals = starts.shape[0] - 1
    settled, resting = cascade.is_settled(strip), False
    f = np.int64(0)
    while f < intervals:
        still = _rests(frames, f, before, share, lo, count)
        if not still:
            load(frames, before[f + 1], share[f + 1], lo, floor, light)
            still = screen.is_still(strip)
        if still and settled and may_rest:
            if not resting:
                if leaks:
                    _leak_strip(lo, count, 1.0, circuit, state, strip, scratch.falls, scratch.means)
                static_pixels.begin_rest(_f(starts[f] - start), strip)
                resting = True
            last = f + 1
            while last < intervals and _rests(frames, last, before, share, lo, count):
                last += 1
            n, keys, times = _rest_strip(
                lo, count, f, last, starts, circuit, t_base, state, scratch, keys, times, n
            )
            f = last
            continue
        if resting and leaks:
            static_pixels.end_rest(lo, count, circuit, state, strip)
        resting = False
        ta, length = starts[f], starts[f + 1] - starts[f]
        # of None the compiler knows that it is none: it compiles one of the two
        if plan is None:
            n, keys, times = _advance_strip(
                lo, count, start, ta, length, circuit, _rule(rules, f), t_base, state, scratch,
                keys, times, n,
            )  # fmt: skip
        else:
            n, keys, times = _advance_cascade(
                lo, count, start, ta, length, f, number, still and settled, circuit, plan, t_base,
                state, scratch, keys, times, n,
            )  # fmt: skip
            number += plan.pieces[plan.cut[f]]
        settled = still and (settled or cascade.is_settled(strip))
        f += 1
    _close_strip(lo, count, number, circuit, state, strip, scratch.noise)
    return n, keys, times


@kernel
def run_exact(
    claimed, most, frames, before, share, starts, begins, last, circuit, rules, plan, t_base,
    state, scratch, keys, times,
):  # fmt: skip
    """Advance strips that nobody else works on over the intervals between neighbouring frames.

    Parameters
    ----------
    claimed : (1,)
        See :mod:`adv2e.kernel.work_queue`.
    most : int
        Strips after which to return, though there may be more.
    frames : Frames
    before, share : (intervals + 1[ + 1],)
        The light at the start and at the end of each interval is `share` of the way from frame
        `before` to the next; with the printed last interval one more follows, for the look-ahead.
    starts : (intervals + 1,)
        Ends of the intervals since the start of the recording [us], the first being their start.
    begins : bool
        Whether the recording begins here.
    last : (intervals + 1,)
        With the paper's last interval as printed: which intervals are the last of an input
        interval (the final entry looks ahead); else all False.
    rules : Rules
        Quadrature for each interval.
    plan : Plan or None
        How each interval is cut for the cascade; None where lanes do.
    keys, times : (n,)
        Memory for events; see :mod:`adv2e.kernel.event_buffer`.

    Returns
    -------
    events written, keys, times
    """
    n = np.int64(0)
    for _ in range(most):
        lo, hi = claim(claimed, state.shape[1])
        if lo == hi:
            break
        n, keys, times = _strip(
            lo, hi - lo, frames, before, share, starts, circuit, rules, plan, t_base,
            state, scratch, keys, times, n,
        )  # fmt: skip
    return n, keys, times
