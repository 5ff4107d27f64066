"""Cause of an event: the part that moved signal or reference most since the last reset.

At a reset the reference becomes the signal, which is the sum of three parts: light, photoreceptor
noise, and additions by effects.  From there on each part moves by itself, and leak lowers the
reference.  ``adv2e/effects/README.md`` has the rule in full.
"""

from __future__ import annotations

from adv2e.causes import LEAK, PHOTORECEPTOR_NOISE, SIGNAL
from adv2e.compiled import kernel
from adv2e.kernel import per_pixel


@kernel
def cause_by_leak(i, polarity, reference, circuit, state):
    """Return SIGNAL or LEAK for a crossing of pixel i where there is no other cause.

    reference : before the event
    """
    if not circuit.causes or polarity < 0.0:
        return SIGNAL
    leak = state[per_pixel.RESET, i] - reference
    return LEAK if leak > state[per_pixel.ON, i] - leak else SIGNAL


@kernel
def note_reset(i, reference, circuit, state):
    """Keep the reference that pixel i has after an event; in the dead time there is none."""
    if circuit.causes:
        state[per_pixel.RESET, i] = reference if circuit.dead_time == 0.0 else per_pixel.NEVER


@kernel
def cause_by_most(i, polarity, reference, light, noise, added, circuit, state):
    """Return the cause of a crossing of pixel i: the part that moved most in its direction.

    reference : before the event
    light, noise, added : the parts of the signal there
    """
    cause, most = SIGNAL, polarity * (light - state[per_pixel.RESET_LIGHT, i])
    leak = polarity * (state[per_pixel.RESET, i] - reference)
    if leak > most:
        cause, most = LEAK, leak
    by_noise = polarity * (noise - state[per_pixel.RESET_NOISE, i])
    if by_noise > most:
        cause, most = PHOTORECEPTOR_NOISE, by_noise
    by_added = polarity * (added - state[per_pixel.RESET_ADDED, i])
    if by_added > most:
        cause = circuit.added
    return cause


@kernel
def note_parts(i, reference, light, noise, added, state):
    """Keep the reference that pixel i takes, and the parts of the signal there."""
    state[per_pixel.RESET, i] = reference
    state[per_pixel.RESET_LIGHT, i] = light
    state[per_pixel.RESET_NOISE, i] = noise
    state[per_pixel.RESET_ADDED, i] = added
