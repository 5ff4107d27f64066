"""A step of a circuit with one pole and nothing else behind the light, in one loop over the strip.

It is what :mod:`adv2e.kernel.stepped.signal` and :mod:`adv2e.kernel.stepped.events` do in ten loops
with the same equations; what one would hand to the next stays in registers.  Times differ by what
is rounded elsewhere, some 1e-9 us.  Factors and additions must be those of all pixels, and the pole
must move so little in a step that a polynomial is enough (:func:`adv2e.kernel.special.settling`).
"""

from __future__ import annotations

import math

from adv2e.compiled import inlined, kernel
from adv2e.kernel import special
from adv2e.kernel.inputs import EXACT
from adv2e.kernel.leak import leak_over
from adv2e.kernel.stepped import rows
from adv2e.kernel.stepped.events import may_fire

_THIRD = 1.0 / 3.0
_MOST = 0.999
"""Most that the pole may move within a step, as a share of its time constant."""


@inlined
def covers(circuit, run):
    """Tell whether steps of a run may be made here, as far as the circuit decides it."""
    stages = max(circuit.slew, circuit.follower, circuit.high, circuit.noise_rms)
    wide = max(run.gain.shape[1], run.signal.shape[1]) > 1
    is_solved = circuit.update == EXACT and circuit.filtered and not circuit.printed
    return is_solved and stages == 0.0 and not wide


@inlined
def is_gentle(step, brightest, circuit, run):
    """Tell whether the pole moves little enough in a step, `brightest` [DN] the light of frames."""
    if run.gain.shape[0] > 0:
        brightest *= max(run.gain[step.m, 0], run.gain[step.m + 1, 0])
    return step.h * (circuit.dark + circuit.per_dn * brightest) < _MOST


@kernel
def above_knee(count, circuit, strip):
    """Return the least light of a strip over a piece, as a multiple of that at the knee."""
    least = strip[rows.PIECE]
    for k in range(count):
        least = min(least, strip[rows.PIECE + k], strip[rows.UNTIL + k])
    return math.exp(least - circuit.knee)


@inlined
def _constants(step, added, on, off, circuit):
    """Return what all pixels share in a step; `added`: to the signal at both ends."""
    h, end = step.h, step.start + step.h
    dark, per_dn, (leak, leak_per_dn) = circuit.dark * h, circuit.per_dn * h, leak_over(h, circuit)
    pole = dark, per_dn, per_dn / 6.0, per_dn / 12.0
    return pole, (leak, leak_per_dn, leak_per_dn / 6.0), added, (on, off, end)


@inlined
def _advance_pixel(k, lights, x0, x1, constants, strip):
    """Pole, signal and screen of a pixel over a step; tells whether it may fire."""
    (i0, im, i1), (pole, leaks, (before, after), (on, off, end)) = lights, constants
    (dark, per_dn, sixth, twelfth), (leak, leak_per_dn, leak_sixth) = pole, leaks
    first, light, added = strip[rows.FIRST + k], i0 + 4.0 * im + i1, after - before
    a = dark + sixth * light
    q = special.settling(a)
    u0 = first - x0
    u1 = u0 - a * q * u0 - (x1 - x0) * q * (1.0 - twelfth * (i1 - i0))
    now = x1 + u1
    slope0 = added - (dark + per_dn * i0) * u0
    slope1 = added - (dark + per_dn * i1) * u1
    strip[rows.FIRST + k] = now
    strip[rows.SLOPE0 + k] = slope0
    strip[rows.SLOPE1 + k] = slope1
    v0, v1 = first + before, now + after
    strip[rows.SIGNAL0 + k] = v0
    strip[rows.SIGNAL1 + k] = v1
    level, reference = strip[rows.LEAK_ON + k], strip[rows.REFERENCE + k]
    lowered = reference - level * (leak + leak_sixth * light)
    d0, d3 = v0 - reference, v1 - lowered
    d1 = d0 + (slope0 + level * (leak + leak_per_dn * i0)) * _THIRD
    d2 = d3 - (slope1 + level * (leak + leak_per_dn * i1)) * _THIRD
    hit = may_fire(k, d1, d2, d3, on, off, end, strip)
    strip[rows.REFERENCE + k] = lowered
    strip[rows.HIT + k] = 1.0 if hit else 0.0
    return hit


@kernel
def advance(n, step, added, on, off, circuit, strip):
    """Return the number of pixels that may fire in a step, whose light is in the rows.

    added : what is added to the signal at both ends
    on, off : factors on the rows of thresholds
    """
    constants, hits = _constants(step, added, on, off, circuit), 0
    for k in range(n):
        lights = strip[rows.LIGHT0 + k], strip[rows.LIGHTM + k], strip[rows.LIGHT1 + k]
        x0, x1 = strip[rows.DRIVEN0 + k], strip[rows.DRIVEN1 + k]
        hits += int(_advance_pixel(k, lights, x0, x1, constants, strip))
    return hits


@kernel
def advance_bright(n, step, factors, added, on, off, circuit, strip):
    """Do as `advance`, and the light too, where no pixel is below the knee.

    factors : on the light, in the middle and at the end of the step
    """
    constants, hits = _constants(step, added, on, off, circuit), 0
    share, (middle, last), rise = step.share, factors, math.log(factors[1])
    for k in range(n):
        x = strip[rows.PIECE + k] + strip[rows.MOVE + k] * share
        ratio, x0, i0 = strip[rows.RATIO + k], strip[rows.DRIVEN1 + k], strip[rows.LIGHT1 + k]
        grown = strip[rows.GROWN + k] * ratio
        im, x1 = grown * middle, x + rise
        grown *= ratio
        i1 = grown * last
        strip[rows.GROWN + k] = grown
        strip[rows.LIGHT0 + k] = i0
        strip[rows.LIGHTM + k] = im
        strip[rows.LIGHT1 + k] = i1
        strip[rows.X1 + k] = x
        strip[rows.DRIVEN1 + k] = x1
        hits += int(_advance_pixel(k, (i0, im, i1), x0, x1, constants, strip))
    return hits
