"""State of each pixel: its rows, one column a pixel, and how it begins."""

from __future__ import annotations

from adv2e.compiled import kernel
from adv2e.kernel import rng

NEVER = 1e300
"""Time of an event that does not happen [us]."""

ROWS = 23

(
    X,  # log intensity at the last frame
    LAG,  # filtered signal minus x
    REFERENCE,
    HOLD,  # end of the dead time [us], -1: not in it
    ON,  # thresholds
    OFF,
    SHOT_TIME,  # next candidate [us]
    SHOT_DRAW,
    HOT_TIME,
    HOT_DRAW,
    LEAK_FACTOR,  # leak speed of this cycle
    LEAK_DRAW,
    NOISE,  # of the photoreceptor
    SEEN,  # the same behind the second pole, if there is one
    NOISE_DRAW,
    FIRST,  # signal behind the first pole, as the stepped solver keeps it
    SECOND,  # the same behind the second pole
    SLOW,  # what the high-pass behind that subtracts
    BEYOND,  # where the reference goes beyond the signal at the end of the dead time
    # for the causes of events alone: see adv2e.kernel.comparator
    RESET,  # the reference as it was at its reset, NEVER in the dead time
    RESET_LIGHT,  # and what it was made of: signal by the light alone,
    RESET_NOISE,  # photoreceptor noise,
    RESET_ADDED,  # what is added to the signal
) = range(ROWS)


# ---- Per-pixel initial state: thresholds (mismatch) and reference.
#
# The equations are those of :mod:`adv2e.effects.pixel.thresholds` and
# :mod:`adv2e.effects.pixel.initial_reference`.


@kernel
def _fill_normal_levels(seed, stream, first, mean, mismatch, floor, levels, spare):
    rng.uniforms_of_pixels(seed, stream, first, levels, spare)
    for k in range(levels.shape[0]):
        level = mean + mismatch * rng.normal_of(levels[k], spare[k])
        levels[k] = level if level > floor else floor


@kernel
def fill_levels(lo, hi, seed, mean_on, mean_off, mismatch, floor, on, off, spare):
    """Draw the thresholds of the pixels lo..hi into `on` and `off`; `spare` is overwritten."""
    if mismatch > 0.0:
        v = spare[lo:hi]
        _fill_normal_levels(seed, rng.ON_THRESHOLD, lo, mean_on, mismatch, floor, on[lo:hi], v)
        _fill_normal_levels(seed, rng.OFF_THRESHOLD, lo, mean_off, mismatch, floor, off[lo:hi], v)
    else:
        for i in range(lo, hi):
            on[i] = max(mean_on, floor)
            off[i] = max(mean_off, floor)


@kernel
def fill_random_reference(seed, on, off, x, reference):
    """Draw references so that x lies uniformly between the thresholds of each pixel."""
    for i in range(x.shape[0]):
        u = rng.uniforms(seed, rng.INITIAL_REFERENCE, i, 0)[0]
        reference[i] = x[i] - (u * (on[i] + off[i]) - off[i])
