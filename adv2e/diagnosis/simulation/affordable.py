"""Crop of a long recording to the part that can be simulated often enough.

The cost of a simulation is counted, not measured, so that the crop is the same on every machine.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import numpy as np

from adv2e.config import Config
from adv2e.config.active_effects import active_hooks
from adv2e.diagnosis.data.evidence import Evidence, check_events
from adv2e.effects.composition import begin, inside_pixel, longest_step_us
from adv2e.kernel.inputs import EXACT
from adv2e.light.interpolation.linear import instant_ns
from adv2e.pixel.state import driver_of, make_circuit
from adv2e.pixel.steps import Coarseness, steps_of

FINE = Coarseness(5.0)
"""Steps of time of simulations: some us off, which no statistic shows."""

AFFORDABLE_S = 0.2
"""Longest mean time of a simulation in one thread [s]; a diagnosis takes some thousands."""

# in one thread, with the statistics of the events [s]
INSTANT_S = 20e-9
"""Of one pixel and each frame that is made."""
EVENT_S = 400e-9
SECOND_S = 13e-6
"""Of one pixel and a second: what effects that are solved in steps of time add, over all that a
diagnosis tries."""
STEP_S = 3e-9
"""Of one pixel and each step of time that the declared model takes by itself."""

_BLOCK = 8
_SMALLEST = 48
_FEWEST = 12  # frame intervals
_FEWEST_PIXELS = 256
"""Of known light; its time is worth more than more of them."""


def affordable(evidence: Evidence, declared: Config) -> Evidence:
    """Return the recording, cropped where simulating all of it many times would take too long.

    A rectangle of the sensor's proportions is kept that holds as many events as any.  A pixel does
    not depend on its neighbours, so that the crop sees what it saw in the whole, but for load of
    the readout and for interpolation along motion at its border.  Where the smallest rectangle is
    too much, the stretch of time that holds the most events is kept of it.  Of known light, which
    many pixels see alike, every n-th pixel of every n-th row is kept in place of a rectangle.

    Raises
    ------
    DataError
        Too few events are left.
    """
    of_frame = INSTANT_S * declared.sampling.L
    of_second = SECOND_S + STEP_S * steps_of_time(evidence, declared) / evidence.simulated.seconds

    def cost_s(part: Evidence) -> float:
        shown = part.simulated
        instants = len(shown.frames) - 1
        if part.stimulus is not None:
            instants = max(instants, part.stimulus.instants(shown.times_ns))
        of_pixel = of_frame * instants + of_second * shown.seconds
        return of_pixel * part.width * part.height + EVENT_S * len(part.stream)

    kept, share = evidence, 1.0
    if evidence.stimulus is not None:
        kept = _thinned(evidence, lambda part: cost_s(part) <= AFFORDABLE_S)
    while evidence.stimulus is None and cost_s(kept) > AFFORDABLE_S:
        # where events crowd, a part of the pixels costs more than its share
        share *= 0.98 * AFFORDABLE_S / cost_s(kept)
        width, height = (
            min(length, max(_SMALLEST, round(length * share**0.5 / _BLOCK) * _BLOCK))
            for length in (evidence.width, evidence.height)
        )
        if (width, height) == (kept.width, kept.height):
            break
        kept = _cropped(evidence, *_busiest(evidence, width, height), width, height)
    whole = kept
    while cost_s(kept) > AFFORDABLE_S:
        intervals = int((len(kept.frames) - 1) * 0.98 * AFFORDABLE_S / cost_s(kept))
        if intervals < _FEWEST:
            break
        kept = _shortened(whole, intervals)
    if kept is not evidence:
        size, length = f"{kept.width}x{kept.height} pixels", f"{kept.seconds:.3g} s"
        where = f"in the {size} and {length} that can be simulated often enough"
        check_events(len(kept.stream), evidence.name, where)
    return kept


def steps_of_time(evidence: Evidence, declared: Config) -> int:
    """Return the number of time steps of a pixel through a recording; 0: it is solved exactly."""
    shown, hooks = evidence.simulated, active_hooks(declared)
    inside, circuit = inside_pixel(hooks), make_circuit(declared.pixel, declared.sampling, 0)
    if driver_of(declared.pixel, circuit, inside, "auto") == "run_exact":
        return 0
    frames = zip(shown.times_ns, shown.lights(declared), strict=True)
    # one at a time: all of them may be many
    seen = [(t_ns, float(light.max())) for t_ns, light in begin(hooks, frames, declared.seed)]
    is_exact, count = circuit.update == EXACT, declared.sampling.L
    pieces = 1 if is_exact and not circuit.printed else circuit.steps
    total = 0
    for (begin_ns, dim), (end_ns, lit) in pairwise(seen):
        instants = (instant_ns(begin_ns, end_ns, k, count) for k in range(count + 1))
        for start_ns, stop_ns in pairwise(instants):
            length_us, steps = 1e-3 * (stop_ns - start_ns), 1
            if is_exact:
                limit = longest_step_us(inside, start_ns * 1e-9, stop_ns * 1e-9)
                steps = steps_of(length_us / pieces, circuit, limit, max(dim, lit), FINE)
            total += pieces * steps
    return total


def _busiest(evidence: Evidence, width: int, height: int) -> tuple[int, int]:
    """Return column and row, multiples of a block, at which a crop holds the most events."""
    counts = np.bincount(evidence.stream.pixel, minlength=evidence.width * evidence.height)
    sums = np.zeros((evidence.height + 1, evidence.width + 1), np.int64)
    sums[1:, 1:] = counts.reshape(evidence.height, -1).cumsum(axis=0).cumsum(axis=1)
    rows = np.arange(0, evidence.height - height + 1, _BLOCK)[:, None]
    columns = np.arange(0, evidence.width - width + 1, _BLOCK)[None, :]
    inside = sums[rows + height, columns + width] - sums[rows, columns + width]
    inside += sums[rows, columns] - sums[rows + height, columns]
    row, column = np.unravel_index(int(inside.argmax()), inside.shape)
    return int(columns[0, column]), int(rows[row, 0])


def _cropped(evidence: Evidence, left: int, top: int, width: int, height: int) -> Evidence:
    return _partial(
        evidence.cut(slice(top, top + height), slice(left, left + width)),
        evidence,
        f"pixels outside the {width}x{height} at column {left}, row {top}",
        f"cropped from {evidence.width}x{evidence.height} pixels",
    )


def _thinned(evidence: Evidence, is_enough: Callable[[Evidence], bool]) -> Evidence:
    """Return every n-th pixel of every n-th row: where all see the same, any are as good.

    Unlike the busiest ones, they have their share of hot pixels.
    """
    kept, step = evidence, 1
    while not is_enough(kept):
        step += 1
        some = slice(step // 2, None, step)
        part = evidence.cut(some, some)
        if part.width * part.height < _FEWEST_PIXELS:
            break
        what = f"one pixel of each {step}x{step}"
        kept = _partial(part, evidence, f"all but {what}", f"{what} was looked at")
    return kept


def _shortened(evidence: Evidence, intervals: int) -> Evidence:
    """Return the stretch of so many frame intervals that holds the most events."""
    times_s = evidence.times_s
    before = np.searchsorted(evidence.stream.t, times_s * 1e6)
    first = int(np.argmax(before[intervals:] - before[:-intervals]))
    part = evidence.during(first, first + intervals)
    return _partial(
        part,
        evidence,
        f"time outside {part.times_s[0]:.3f} to {part.times_s[-1]:.3f} s",
        f"{part.seconds:.3g} of {evidence.seconds:.3g} s were looked at",
    )


def _partial(part: Evidence, whole: Evidence, what: str, note: str) -> Evidence:
    """Return a part of a recording, which tells what of the whole was left out."""
    note += (
        ", as all of them would take too long to simulate often enough: what is said holds there"
    )
    told = replace(part, masked=whole.masked, notes=[*whole.notes, note])
    return told.without(what, of=len(whole.stream))
