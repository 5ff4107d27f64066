"""Leak of the reference of a strip over an interval, or a piece of one."""

from __future__ import annotations

import numpy as np

from adv2e.compiled import kernel
from adv2e.kernel import per_pixel, screen, special
from adv2e.kernel.leak import fill_falls
from adv2e.kernel.work_queue import STRIP

_f = np.float32


@kernel
def leaks(circuit):
    """Tell whether there is any leak."""
    return circuit.leak > 0.0 or circuit.photo_leak > 0.0


@kernel
def _mean_lights(strip, knee_dn, means):
    """Mean light of each pixel over the interval [DN]."""
    for k in range(STRIP):
        i0, i1 = strip[screen.LIGHT_0 + k], strip[screen.LIGHT_1 + k]
        dx = special.log_ratio32((i1 - i0) / (i1 + i0 + _f(1e-30)))
        grown = i1 * (_f(1.0) - dx * special.psi32(-dx))
        means[k] = grown if min(i0, i1) >= knee_dn else _f(0.5) * (i0 + i1)


@kernel
def leak_strip(lo, count, length, circuit, state, strip, falls, means):
    """Fall of the reference of a strip over the interval."""
    if circuit.photo_leak > 0.0:
        _mean_lights(strip, _f(circuit.slope * circuit.knee), means)
    fill_falls(lo, count, length, means, circuit, state, falls)
    for k in range(count):
        strip[screen.FALL + k] = falls[k]


@kernel
def lower_references(lo, count, state, strip, falls):
    """Take the fall from the references of the pixels that are done."""
    reference = state[per_pixel.REFERENCE, lo : lo + count]
    for k in range(count):
        fall = falls[k] if strip[screen.HIT + k] == 0.0 else 0.0
        reference[k] -= fall
