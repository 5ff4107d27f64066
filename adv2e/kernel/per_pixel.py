"""State of each pixel from interval to interval: its rows, one column a pixel."""

from __future__ import annotations

NEVER = 1e300
"""Time of an event that does not happen [us]."""

ROWS = 22

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
    SEEN,  # the same as the comparator sees it
    NOISE_DRAW,
    FIRST,  # signal behind the first pole, as the stepped solver keeps it
    SECOND,  # the same behind the second pole
    BEYOND,  # where the reference goes beyond the signal at the end of the dead time
    # for the causes of events alone: see adv2e.kernel.causes
    RESET,  # the reference as it was at its reset, NEVER in the dead time
    RESET_LIGHT,  # and what it was made of: signal by the light alone,
    RESET_NOISE,  # photoreceptor noise,
    RESET_ADDED,  # what is added to the signal
) = range(ROWS)
