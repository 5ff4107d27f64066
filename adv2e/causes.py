"""Causes of events: their numbers and names, and events with a cause each.

====== ==================== ====================================================================
number name                 cause of the event
====== ==================== ====================================================================
0      signal               the light
1      leak                 leak of the reference
2      shot_noise           shot noise
3      photoreceptor_noise  noise of the photoreceptor
4      hot_pixel            a hot pixel, by itself
5      frame_coupling       the disturbance by the readout of a frame
6      own_effect           an effect of the user's own, which injected the event or added to
                            the signal
====== ==================== ====================================================================

A threshold that is crossed may have several causes.  ``docs/own_effects.md`` says which one
counts.  The numbers are in files: they never change.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.events import EVENT_DTYPE, Events, empty_events

CAUSES = (
    "signal",
    "leak",
    "shot_noise",
    "photoreceptor_noise",
    "hot_pixel",
    "frame_coupling",
    "own_effect",
)
"""The names of the causes; the place of each is its number."""

(
    SIGNAL,
    LEAK,
    SHOT_NOISE,
    PHOTORECEPTOR_NOISE,
    HOT_PIXEL,
    FRAME_COUPLING,
    OWN_EFFECT,
) = range(len(CAUSES))

CAUSE_BITS = 3
"""Bits of the largest number of a cause."""

CAUSED_DTYPE = np.dtype([*EVENT_DTYPE.descr, ("cause", "u1")])
"""The record of an event with its cause."""


def has_causes(events: Events) -> bool:
    """Tell whether these events know their causes."""
    return "cause" in (events.dtype.names or ())


def label(events: Events, cause: int) -> None:
    """Give all of `events` this cause, in place; nothing happens to events without causes."""
    if has_causes(events):
        events["cause"] = cause


def with_cause(events: Events, cause: int | NDArray[Any]) -> Events:
    """Return plain events as events that have this cause, or each its own."""
    caused = np.empty(events.size, CAUSED_DTYPE)
    _copy_fields(events, caused)
    caused["cause"] = cause
    return caused


def without_causes(events: Events) -> Events:
    """Return the events as plain ones; those without causes as they are."""
    if not has_causes(events):
        return events
    plain = empty_events(events.size)
    _copy_fields(events, plain)
    return plain


def _copy_fields(source: Events, target: Events) -> None:
    for name in EVENT_DTYPE.names or ():
        target[name] = source[name]
