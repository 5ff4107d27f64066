"""Any circuit over a tile in steps of time, a strip of pixels at a time.

All pixels of a strip make each step together, in loops without branches; only those that may fire
in a step are solved by themselves.  The cost follows from pixels and steps and hardly from the
effects that are on, so this solver is for circuits that :mod:`adv2e.kernel.exact` does not cover.

An interval is cut into continuity samples (one piece, with ``exact``, unless its last one is as
printed), each piece into equal steps, and these into blocks of at most BLOCK.  A block computes
light and log intensity anew, so that a run may begin at any of them and still give the same bits.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from adv2e.compiled import in_parts, inlined, kernel
from adv2e.kernel import per_pixel, rng
from adv2e.kernel.borrowing import borrowed
from adv2e.kernel.comparator import with_room
from adv2e.kernel.inputs import EXACT, load
from adv2e.kernel.leak import leak_over
from adv2e.kernel.stepped import events, one_pole, rows, signal
from adv2e.kernel.stepped.signal import keep_first, limit_slew
from adv2e.kernel.work_queue import claim

BLOCK = 16
"""Steps after which light and log intensity are computed anew."""

ROOM = 64
"""Events that there is room for when a pixel is solved; where it has more, it goes on later."""


class Run(NamedTuple):
    """Steps that one call takes: from one block's start to another's end.

    A course has one row for the start of the run and one for the end of each of its steps, and
    one column or one a pixel; without rows it adds nothing.
    """

    first: int  # interval, and step of it, at which the run begins
    first_step: int
    last: int  # interval, and step of it, before which it ends
    last_step: int
    pieces: int  # of an interval
    steps: NDArray[np.int64]  # of a piece of each interval
    brightest: NDArray[np.float64]  # light of the frames in each interval [DN]
    gain: NDArray[np.float64]
    drive: NDArray[np.float64]
    signal: NDArray[np.float64]
    on: NDArray[np.float64]
    off: NDArray[np.float64]


class TimeStep(NamedTuple):
    """Step of a run."""

    m: int  # its number in the run
    draw: int  # and of all, for the noise drawn there
    start: float  # [us]
    h: float  # its length [us]
    share: float  # of its piece that is over at its end
    half: float  # half of that which it takes
    second: tuple[float, ...]  # weights of the second pole
    high: tuple[float, ...]  # and of the high-pass


class Pace(NamedTuple):
    """Steps of an interval."""

    start: float  # of the interval [us]
    length: float
    total: int  # number of its steps, and of those of a piece
    steps: int
    h: float
    half: float
    second: tuple[float, ...]
    high: tuple[float, ...]
    brightest: float  # light of the frames [DN]
    alone: bool  # whether there is but one pole
    above: float  # least light of the strip, as a multiple of that at the knee, if there is


class SteppedMemory(NamedTuple):
    """Memory of whoever works on a strip."""

    strip: NDArray[np.float64]
    normals: NDArray[np.float64]
    light: NDArray[np.float32]
    pixels: NDArray[np.int64]  # numbers, within the strip, of the pixels that may fire


def new_memory() -> SteppedMemory:
    """Return fresh memory."""
    return SteppedMemory(
        rows.new_rows(),
        rows.normals(),
        np.zeros(rows.WIDTH, np.float32),
        np.zeros(rows.WIDTH + 16, np.int64),
    )


@kernel
def _open(lo, count, n, circuit, run, injected, state, strip):
    """Rows of a strip at the start of a run."""
    noisy, jitter = circuit.noise_rms > 0.0, circuit.leak_jitter > 0.0
    for k in range(n):
        strip[rows.ON + k] = per_pixel.NEVER
        strip[rows.OFF + k] = per_pixel.NEVER
        strip[rows.ON_STEP + k] = per_pixel.NEVER
        strip[rows.OFF_STEP + k] = per_pixel.NEVER
        strip[rows.DUE + k] = per_pixel.NEVER
        strip[rows.ADDED + k] = 0.0
    for k in range(count):
        i = lo + k
        strip[rows.FIRST + k] = state[per_pixel.FIRST, i]
        strip[rows.INPUT1 + k] = state[per_pixel.FIRST, i]
        if noisy:
            strip[rows.NOISE + k] = state[per_pixel.NOISE, i]
            strip[rows.INPUT1 + k] += state[per_pixel.NOISE, i]
        strip[rows.SECOND + k] = state[per_pixel.SECOND, i]
        strip[rows.BEHIND + k] = (
            strip[rows.SECOND + k] if circuit.follower > 0.0 else strip[rows.INPUT1 + k]
        )
        strip[rows.SLOW + k] = state[per_pixel.SLOW, i]
        strip[rows.SIGNAL1 + k] = strip[rows.BEHIND + k] - strip[rows.SLOW + k]
        strip[rows.REFERENCE + k] = state[per_pixel.REFERENCE, i]
        if circuit.causes:
            strip[rows.SEEN + k] = state[per_pixel.SEEN, i]
        strip[rows.LEAK_ON + k] = state[per_pixel.ON, i] * (
            state[per_pixel.LEAK_FACTOR, i] if jitter else 1.0
        )
        events.watch(k, i, circuit, injected, state, strip)
    if run.signal.shape[0] > 0:
        signal.add_course(n, lo, count, run.signal, 0, rows.ADDED, strip)
        for k in range(n):
            strip[rows.SIGNAL1 + k] += strip[rows.ADDED + k]


@kernel
def _close(lo, count, draw, circuit, state, strip):
    """State of a strip at the end of a run."""
    for k in range(count):
        i = lo + k
        state[per_pixel.X, i] = strip[rows.XB + k]
        state[per_pixel.FIRST, i] = strip[rows.FIRST + k]
        state[per_pixel.SECOND, i] = strip[rows.SECOND + k]
        if circuit.high > 0.0:
            state[per_pixel.SLOW, i] = strip[rows.SLOW + k]
        state[per_pixel.REFERENCE, i] = strip[rows.REFERENCE + k]
        if circuit.noise_rms > 0.0:
            state[per_pixel.NOISE, i] = strip[rows.NOISE + k]
            state[per_pixel.NOISE_DRAW, i] = draw
            if circuit.causes:
                state[per_pixel.SEEN, i] = strip[rows.SEEN + k]


@kernel
def load_x(schedule, at, lo, count, circuit, memory, row):
    """Log intensity of a strip at instant `at`."""
    light = memory.light[:count]
    load(schedule.frames, schedule.before[at], schedule.share[at], lo, 0.0, light)
    signal.log_of_light(light, circuit, memory.strip[row : row + count])


@kernel
def _take_samples(count, begins, is_last, next_is_last, strip):
    """Continuity samples of an interval: base + step k/K, but for the first and the last.

    With the paper's last interval as printed, the samples of a last one start from its end, but
    for the one at which the recording begins, and the interval before leads there.
    """
    for k in range(count):
        xa, xb, ahead = strip[rows.XA + k], strip[rows.XB + k], strip[rows.AHEAD + k]
        base = xb if is_last else xa
        strip[rows.XA + k] = base if not begins else xa
        strip[rows.BASE + k] = base
        strip[rows.STEP + k] = xb - xa
        strip[rows.AHEAD + k] = ahead if next_is_last else xb


@kernel
def _take_piece(n, p, pieces, strip):
    """Rows PIECE and MOVE: from sample p to the next."""
    start, end = p / pieces, (p + 1) / pieces
    for k in range(n):
        a = strip[rows.BASE + k] + strip[rows.STEP + k] * start
        b = strip[rows.BASE + k] + strip[rows.STEP + k] * end
        a = strip[rows.XA + k] if p == 0 else a
        b = strip[rows.AHEAD + k] if p == pieces - 1 else b
        strip[rows.PIECE + k] = a
        strip[rows.MOVE + k] = b - a
        strip[rows.UNTIL + k] = b


@kernel
def _take_light(lo, count, n, step, circuit, run, strip):
    """Light over a step of a run, and what drives the poles."""
    m = step.m
    if circuit.update == EXACT:
        signal.advance_light(n, step.share, step.half, circuit, strip)
    else:
        signal.next_sample(n, circuit, strip)
    if run.gain.shape[0] > 0:
        signal.change_middle(lo, count, run.gain, m, strip)
        signal.change_light(lo, count, run.gain, m + 1, circuit, strip)
    if run.drive.shape[0] > 0:
        signal.add_course(n, lo, count, run.drive, m + 1, rows.DRIVEN1, strip)


@kernel
def _make_step(lo, count, n, step, circuit, run, memory):
    """Signal of a strip over a step of a run."""
    m, h, draw, normals, strip = step.m, step.h, step.draw, memory.normals, memory.strip
    if circuit.causes:
        signal.keep_parts(n, strip)
    _take_light(lo, count, n, step, circuit, run, strip)
    if circuit.slew > 0.0:
        keep_first(n, strip)
    if not circuit.filtered:
        signal.no_pole(n, strip)
    elif circuit.update == EXACT:
        signal.first_pole_exact(n, h, circuit, strip)
    else:
        signal.first_pole_stepped(n, h, circuit, strip)
    if circuit.slew > 0.0:
        limit_slew(n, h, circuit, strip)
    if circuit.noise_rms > 0.0:
        if draw % 4 == 0 or m == 0:
            rng.normals_of_four(circuit.seed, rng.PHOTORECEPTOR_STEPS, lo, n, draw // 4, normals)
        signal.add_noise(n, circuit.noise_rms, normals[draw % 4], strip)
        if circuit.causes:
            signal.see_noise(n, circuit.follower > 0.0, step.second, strip)
    else:
        signal.no_noise(n, strip)
    row, stepped = rows.INPUT1, circuit.update != EXACT
    if circuit.follower > 0.0:
        signal.second_pole(n, circuit.follower * h, stepped, step.second, strip)
        row = rows.SECOND
    if circuit.high > 0.0:
        signal.high_pass(n, circuit.high * h, stepped, step.high, row, strip)
    else:
        signal.take_signal(n, row, strip)
    if run.signal.shape[0] > 0:
        signal.add_to_signal(n, lo, count, run.signal, m, strip)


@kernel
def _level(course, m, i):
    """Factor on a threshold of pixel i at instant m."""
    if course.shape[0] == 0:
        return 1.0
    return course[m, i] if course.shape[1] > 1 else course[m, 0]


@inlined
def _levels(lo, count, m, run, strip):
    """Least factors on the rows of thresholds in a step; those of each pixel go to rows."""
    on, off = 1.0, 1.0
    if run.on.shape[1] > 1:
        events.step_thresholds(count, lo, run.on, m + 1, rows.ON, rows.ON_STEP, strip)
    elif run.on.shape[0] > 0:
        on = min(run.on[m, 0], run.on[m + 1, 0])
    if run.off.shape[1] > 1:
        events.step_thresholds(count, lo, run.off, m + 1, rows.OFF, rows.OFF_STEP, strip)
    elif run.off.shape[0] > 0:
        off = min(run.off[m, 0], run.off[m + 1, 0])
    return on, off


@inlined
def _make_alone(lo, count, n, step, above, circuit, run, strip):
    """Make a step of one pole and nothing else; returns the number of pixels that may fire."""
    m, added, factors = step.m, (0.0, 0.0), (1.0, 1.0)
    if run.signal.shape[0] > 0:
        added = run.signal[m, 0], run.signal[m + 1, 0]
    if run.gain.shape[0] > 0:
        factors = 0.5 * (run.gain[m, 0] + run.gain[m + 1, 0]), run.gain[m + 1, 0]
    on, off = _levels(lo, count, m, run, strip)
    if circuit.causes:
        signal.keep_parts(n, strip)
        for k in range(n):
            strip[rows.ADDED + k] = added[1]
    if run.drive.shape[0] == 0 and min(factors[1], 1.0) * above > 1.0:
        return one_pole.advance_bright(n, step, factors, added, on, off, circuit, strip)
    _take_light(lo, count, n, step, circuit, run, strip)
    return one_pole.advance(n, step, added, on, off, circuit, strip)


@kernel
def _step_of(j, m, draw, pace):
    """Return step j of an interval."""
    start, share = pace.start + pace.length * (j / pace.total), (j % pace.steps + 1) / pace.steps
    return TimeStep(m, draw, start, pace.h, share, pace.half, pace.second, pace.high)


@kernel
def _make_steps(lo, count, n, j, end, m, draw, pace, circuit, run, memory):
    """Make the steps j to `end` of an interval, or up to one in which pixels may fire.

    Returns the step after the last that was made, and how many pixels may fire in that.
    """
    run, memory = borrowed(run, memory)
    strip, hits = memory.strip, np.int64(0)
    while j < end and hits == 0:
        step = _step_of(j, m, draw, pace)
        if pace.alone and one_pole.is_gentle(step, pace.brightest, circuit, run):
            hits = _make_alone(lo, count, n, step, pace.above, circuit, run, strip)
        else:
            _make_step(lo, count, n, step, circuit, run, memory)
            on, off = _levels(lo, count, m, run, strip)
            hits = events.screen(n, step.start + step.h, leak_over(step.h, circuit), on, off, strip)
        j, m, draw = j + 1, m + 1, draw + 1
    return j, hits


@kernel
def _fire_gathered(c, count, lo, step, circuit, run, injected, state, memory, buffer, number):
    """Fire the events of pixels c to count of those that may fire, while there is room.

    Returns the first pixel that is not done, and the number of events so far.
    """
    run, injected, state, memory = borrowed(run, injected, state, memory)
    (buffer,) = borrowed(buffer)
    m = step.m
    while c < count and number + ROOM <= buffer.keys.shape[0]:
        k = memory.pixels[c]
        i = lo + k
        levels = (
            _level(run.on, m, i), _level(run.on, m + 1, i),
            _level(run.off, m, i), _level(run.off, m + 1, i),
        )  # fmt: skip
        number, whole = events.fire_step(
            k, i, step, levels, circuit, injected, state, memory.strip, buffer, number
        )
        c += whole
    return c, number


@inlined
def _fire_step(lo, n, step, circuit, run, injected, state, memory, buffer, number):
    """Fire the events of a step of a run."""
    c, count = np.int64(0), events.gather(n, memory.strip, memory.pixels)
    while c < count:
        buffer = with_room(buffer, number, number + ROOM)
        c, number = _fire_gathered(
            c, count, lo, step, circuit, run, injected, state, memory, buffer, number
        )
    return number, buffer


@inlined
def _strip(lo, count, schedule, circuit, run, injected, state, memory, buffer, number):
    """Advance one strip over a run."""
    schedule, run, injected, state = borrowed(schedule, run, injected, state)
    (memory,) = borrowed(memory)
    starts, last, strip = schedule.starts, schedule.last, memory.strip
    alone = one_pole.covers(circuit, run)
    n = -(-count // 16) * 16
    _open(lo, count, n, circuit, run, injected, state, strip)
    draw = np.int64(0)
    if circuit.noise_rms > 0.0:
        draw = np.int64(state[per_pixel.NOISE_DRAW, lo])
    load_x(schedule, run.first, lo, count, circuit, memory, rows.XA)
    m = np.int64(0)
    for f in range(run.first, run.last):
        length, steps = starts[f + 1] - starts[f], run.steps[f]
        total = run.pieces * steps
        load_x(schedule, f + 1, lo, count, circuit, memory, rows.XB)
        if last[f + 1]:
            load_x(schedule, f + 2, lo, count, circuit, memory, rows.AHEAD)
        _take_samples(count, schedule.begins and f == 0, last[f], last[f + 1], strip)
        h, half = length / total, 0.5 / steps
        second = signal.second_pole_weights(circuit.follower * h, circuit.update != EXACT)
        high = signal.second_pole_weights(circuit.high * h, circuit.update != EXACT)
        first = run.first_step if f == run.first else 0
        _take_piece(n, first // steps, run.pieces, strip)
        above = one_pole.above_knee(count, circuit, strip) if alone else 0.0
        pace = Pace(
            starts[f], length, total, steps, h, half, second, high, run.brightest[f], alone, above
        )
        stop = run.last_step if f == run.last - 1 else total
        j = first
        while j < stop:
            r = j % steps
            if r == 0 and j > first:
                _take_piece(n, j // steps, run.pieces, strip)
            if m == 0 or (circuit.update == EXACT and r % BLOCK == 0):
                signal.begin_block(n, r / steps, half, circuit, strip)
                if run.gain.shape[0] > 0:
                    signal.change_light(lo, count, run.gain, m, circuit, strip)
                if run.drive.shape[0] > 0:
                    signal.add_course(n, lo, count, run.drive, m, rows.DRIVEN1, strip)
            end = min(stop, j + BLOCK - r % BLOCK, j + steps - r)
            done, hits = _make_steps(lo, count, n, j, end, m, draw, pace, circuit, run, memory)
            m, draw, j = m + done - j, draw + done - j, done
            if hits > 0:
                step = _step_of(j - 1, m - 1, draw - 1, pace)
                number, buffer = _fire_step(
                    lo, n, step, circuit, run, injected, state, memory, buffer, number
                )
        for k in range(n):
            strip[rows.XA + k] = strip[rows.XB + k]
    _close(lo, count, draw, circuit, state, strip)
    return number, buffer


@kernel
def run_stepped(claimed, most, schedule, circuit, run, injected, state, memory, buffer):
    """Advance strips that nobody else works on over a run.

    The other arguments, and what is returned, are those of :func:`adv2e.kernel.exact.run_exact`.
    """
    number = np.int64(0)
    for _ in range(most):
        lo, hi = claim(claimed, state.shape[1])
        if lo == hi:
            break
        for s in range(lo, hi, rows.WIDTH):
            count = min(rows.WIDTH, hi - s)
            number, buffer = _strip(
                s, count, schedule, circuit, run, injected, state, memory, buffer, number
            )
    return number, buffer


def _parts(claimed, most, schedule, circuit, run, injected, state, memory, buffer):
    """Return parts of :func:`run_stepped`, for a second process and this one."""
    pole, levels = (0.0,) * 5, (0.0,) * 4
    step, pace = (
        TimeStep(0, 0, 0.0, 0.0, 0.0, 0.0, pole, pole),
        Pace(0.0, 0.0, 0, 0, 0.0, 0.0, pole, pole, 0.0, False, 0.0),
    )
    event = 0, 0, step, levels, circuit, injected, state, memory.strip, buffer, 0
    own = [
        (_make_steps, (0, 0, 0, 0, 0, 0, 0, pace, circuit, run, memory)),
        (load_x, (schedule, 0, 0, 0, circuit, memory, 0)),
        (_open, (0, 0, 0, circuit, run, injected, state, memory.strip)),
    ]
    return [(events.fire_step, event)], own


in_parts(run_stepped, _parts)
