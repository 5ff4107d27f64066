"""A strip advances through the cascade: over an interval, piece by piece."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from adv2e.compiled import inlined, kernel
from adv2e.kernel import screen, special
from adv2e.kernel.borrowing import borrowed
from adv2e.kernel.cascade import lanes, second_look
from adv2e.kernel.cascade import screen as cascade
from adv2e.kernel.cascade.substep import Piece
from adv2e.kernel.leak import leak_strip, leaks, lower_references
from adv2e.kernel.photoreceptor import path as noise_path
from adv2e.kernel.photoreceptor import strip as photoreceptor
from adv2e.kernel.photoreceptor.path import LANES
from adv2e.kernel.screen import STRIDE
from adv2e.kernel.work_queue import STRIP

_f = np.float32


class CascadeMemory(NamedTuple):
    """Memory for the cascade, beside that of the strip."""

    x: NDArray[np.float64]  # log intensity at the start of an interval, how far it goes, and the
    dx: NDArray[np.float64]  # light at its end, where the interval is cut into pieces
    light: NDArray[np.float32]
    whole: NDArray[np.float64]  # ends of the one substep of a piece in which nothing moves
    noise: photoreceptor.StripNoise
    path: noise_path.NoisePath  # noise of a few pixels,
    flagged: NDArray[np.int64]  # and the numbers of all that may fire
    look: second_look.Look
    lanes: NDArray[np.float64]
    cells: NDArray[np.float32]
    roots: NDArray[np.float64]


def new_memory() -> CascadeMemory:
    """Return fresh memory."""
    return CascadeMemory(
        np.zeros(STRIP), np.zeros(STRIP), np.ones(STRIP, np.float32), np.arange(2.0),
        photoreceptor.new_memory(), noise_path.new_path(), np.zeros(STRIP + 1, np.int64),
        second_look.new_look(), lanes.new_lanes(), lanes.new_cells(), lanes.new_roots(),
    )  # fmt: skip


@kernel
def _begin_pieces(strip, circuit, own):
    """Store log intensity at LIGHT_0, its change up to LIGHT_1, and LIGHT_1 in memory `own`."""
    for k in range(STRIP):
        x0 = screen.log_of(np.float64(strip[screen.LIGHT_0 + k]), circuit)
        x1 = screen.log_of(np.float64(strip[screen.LIGHT_1 + k]), circuit)
        own.x[k], own.dx[k] = x0, x1 - x0
        own.light[k] = strip[screen.LIGHT_1 + k]


@kernel
def _end_piece(share, strip, circuit, own):
    """Row LIGHT_1 at `share` of the interval."""
    for k in range(STRIP):
        x = own.x[k] + own.dx[k] * share
        light = special.exp(x)
        light = light if x >= circuit.knee else circuit.slope * x
        strip[screen.LIGHT_1 + k] = _f(light) if share < 1.0 else own.light[k]


@inlined
def _solve_beside_noise(lo, number, which, piece, circuit, laws, state, memory, buffer, n):
    """Solve the flagged pixels of a strip over piece `number` of all, which has law `which`."""
    strip, pixels, own = memory.strip.rows, memory.strip.pixels, memory.cascade
    noise, path, held = own.noise, own.path, np.int64(0)
    m, depth, j = screen.flagged(strip, own.flagged), np.int64(0), np.int64(0)
    while m > 0 and depth <= laws.fine.shape[2]:  # those that are cut as finely, side by side
        size = np.int64(0)
        while j < m and size < LANES:
            k = own.flagged[j]
            pixels[size] = k
            size += 1 if laws.levels[which, noise.entries[k]] == depth else 0
            j += 1
        if size > 0:
            noise_path.sample(
                size, pixels, number, laws.samples[which], depth, circuit, laws.fine[which], noise,
                path,
            )  # fmt: skip
            second_look.find_places(size, piece, circuit, memory.strip, path, own.look)
            held = lanes.load(lo, held, 0, size, circuit, state, memory)
        if held > lanes.MOST - LANES:
            n, buffer = lanes.solve(lo, held, piece, circuit, state, memory, buffer, n)
            held = np.int64(0)
        if j == m:
            depth, j = depth + 1, np.int64(0)
    if held > 0:
        n, buffer = lanes.solve(lo, held, piece, circuit, state, memory, buffer, n)
    return n, buffer


@inlined
def advance(lo, count, interval, until, number, still, circuit, plan, state, memory, buffer, n):
    """Advance one strip over an interval, piece by piece; `still`: nothing moves or lags in it.

    until : number of its end
    number : of its first piece, of all in the recording
    """
    (plan,) = borrowed(plan)
    strip, own, laws, f = memory.strip.rows, memory.cascade, plan.laws, interval.f
    noise, has_leak, is_noisy = own.noise, leaks(circuit), circuit.noise_rms > 0.0
    cut = plan.cut_still[f] if until > f + 1 else plan.cut[f]
    pieces = plan.pieces[cut]
    first, rise = plan.factors[f], plan.factors[until] - plan.factors[f]
    if pieces > 1 and not still:
        _begin_pieces(strip, circuit, own)
    for p in range(pieces):
        substeps, places, which = plan.substeps[cut, p], plan.places[cut, p], plan.law[cut, p]
        a, b = plan.ends[cut, p], plan.ends[cut, p + 1]
        t0, length = interval.start + a * interval.length, (b - a) * interval.length
        levels = first + rise * a, first + rise * b
        if pieces > 1 and not still:
            _end_piece(b, strip, circuit, own)
        if has_leak:
            leak_strip(lo, count, length, circuit, state, memory.strip)
        if still:
            substeps, places = np.int64(1), own.whole
            cascade.stay(strip)
        else:
            cascade.follow(strip, substeps, places, length, circuit, plan.weights[cut, p])
        on, off, factor = screen.ON, screen.OFF, _f(min(levels[0], levels[1]))
        if is_noisy:
            photoreceptor.draw(lo, count, number + p, which, still, circuit, laws, strip, noise)
            cascade.leave_room(strip, factor, noise.rows)
            on, off, factor = cascade.ON, cascade.OFF, _f(1.0)
        end = _f(t0 + length - interval.origin)
        if still:
            cascade.flag_still(strip, end, on, off, factor)
        else:
            screen.flag(
                strip, end, _f(circuit.dark * length), _f(circuit.per_dn * length),
                _f(circuit.slope * circuit.knee), cascade.SECOND,
                cascade.SECOND + substeps * STRIDE, on, off, factor, cascade.LARGEST,
            )  # fmt: skip
        piece = Piece(interval.origin, t0, length, a / (b - a), substeps, places, levels)
        if is_noisy:
            n, buffer = _solve_beside_noise(
                lo, number + p, which, piece, circuit, laws, state, memory, buffer, n
            )
        else:
            m = screen.flagged(strip, memory.strip.pixels)
            for j in range(0, m, lanes.MOST):
                size = lanes.load(lo, 0, j, min(lanes.MOST, m - j), circuit, state, memory)
                n, buffer = lanes.solve(lo, size, piece, circuit, state, memory, buffer, n)
        if has_leak:
            lower_references(lo, 0, count, state, memory.strip)
        cascade.step_on(strip, substeps, still)
    return n, buffer, number + pieces


def parts(circuit, plan, state, memory, buffer):
    """Return parts of :func:`advance`, for a second process and this one."""
    strip, own, laws = memory.strip, memory.cascade, plan.laws
    piece = Piece(0.0, 0.0, 0.0, 0.0, 0, plan.places[0, 0], (0.0, 0.0))
    noise, path = own.noise, own.path
    theirs = [
        (photoreceptor.draw, (0, 0, 0, 0, False, circuit, laws, strip.rows, noise)),
        (noise_path.sample, (0, strip.pixels, 0, 0, 0, circuit, laws.fine[0], noise, path)),
        (second_look.find_places, (0, piece, circuit, strip, path, own.look)),
    ]
    return theirs, [
        (lanes.solve, (0, 0, piece, circuit, state, memory, buffer, 0)),
        (lanes.load, (0, 0, 0, 0, circuit, state, memory)),
    ]
