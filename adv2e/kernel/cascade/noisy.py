"""The events of one pixel within a substep, with photoreceptor noise: where that may matter."""

from __future__ import annotations

import numpy as np

from adv2e.compiled import kernel
from adv2e.kernel import per_pixel
from adv2e.kernel.cascade.substep import DONE, Cubic, fire_until, may_fire
from adv2e.kernel.noise import next_noise
from adv2e.kernel.photoreceptor import path as noise

_THIRD = 1.0 / 3.0


@kernel
def _is_clear(hold, due, until, high, low, step, reference, factor):
    """Tell whether nothing happens to a pixel in a part of a substep that ends `until` [us].

    hold : end of the dead time [us], -1: not in it
    due : when something happens by itself [us]
    high, low : bounds of its signal
    """
    if hold >= 0.0:
        return hold >= until
    leaked = step.fallen + step.leak1 + step.leak2 + step.leak3
    return due >= until and not may_fire(
        high - reference, low - reference, factor * step.fallen, factor * leaked,
        min(step.on0, step.on1), min(step.off0, step.off1),
    )  # fmt: skip


@kernel
def fire_in_cells(
    i, c, place, s0, span, hull, samples, levels, step, signal, reference, factor, t_base, circuit,
    state, path, keys, times, n,
):  # fmt: skip
    """Fire the events of pixel i, which is in lane c, in a substep from `place` on.

    Parameters
    ----------
    s0, span : float
        Where the substep is in its piece.
    hull : (2,) float
        Bounds of the signal without noise, less x at the start of the substep.
    samples, levels : int
        Of the noise: between two samples are 2^levels cells.
    path : Path
        Of the noise.

    The others, and what is returned, are those of
    :func:`adv2e.kernel.cascade.substep.fire_until`.
    """
    rows, seen, cells = path.rows, noise.seen_from(circuit), samples << levels
    width = 1.0 / (cells * span)  # of a cell, as a part of the substep
    corner = circuit.follower * step.h * width
    least, most = step.x + hull[1], step.x + hull[0]
    hold, due = state[per_pixel.HOLD, i], next_noise(i, circuit, state)[1]
    r, fired = np.int64(min((s0 + place * span) * cells, cells - 1.0)), False
    begin = (r / cells - s0) / span
    while r < cells and begin < 1.0:
        if fired:
            high, low = most + rows[noise.HIGH + c], least + rows[noise.LOW + c]
            if _is_clear(hold, due, step.t0 + step.h, high, low, step, reference, factor):
                break
        fired, j, after = False, r >> levels, r + 1
        if noise.is_known(j, c, rows):
            high, low = noise.bounds_of_cell(r, c, np.float32(corner * _THIRD), seen, rows)
        else:
            after = (j + 1) << levels
            high, low = noise.bounds_of_stretch(j, c, levels, seen, rows)
        end = min((after / cells - s0) / span, 1.0)
        until = step.t0 + end * step.h
        if not _is_clear(hold, due, until, most + high, least + low, step, reference, factor):
            if not noise.is_known(j, c, rows):
                noise.wait(0, c, j, path)
                noise.draw_stretches(1, levels, circuit, path)
                continue
            c0, c1, c2, c3 = noise.cubic_of(r, c, begin, width, corner, seen, rows)
            n, stopped, reference, factor = fire_until(
                i, max(begin, place), end, step, signal, Cubic(c0, c1, c2, c3), reference, factor,
                t_base, circuit, state, keys, times, n,
            )  # fmt: skip
            if stopped != DONE:
                return n, stopped, reference, factor
            hold, due = state[per_pixel.HOLD, i], next_noise(i, circuit, state)[1]
            fired = True
        r, begin = after, end
    return n, DONE, reference, factor
