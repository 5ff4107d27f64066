"""Counts, rates and ON share of a stream."""

from __future__ import annotations

import numpy as np

from adv2e.events import Events


def count_statistics(
    events: Events, duration_s: float, width: int, height: int
) -> dict[str, float | None]:
    """Return counts, rates [events a pixel a second] and the ON share (None without events).

    Parameters
    ----------
    events : Events
        All events of the time compared.
    duration_s : float
        That time [s].
    width, height : int
        Columns and rows of the sensor.
    """
    on = int(np.count_nonzero(events["p"]))
    exposure = duration_s * width * height
    return {
        "events": len(events),
        "on_events": on,
        "off_events": len(events) - on,
        "rate": len(events) / exposure,
        "on_rate": on / exposure,
        "off_rate": (len(events) - on) / exposure,
        "on_share": on / len(events) if len(events) else None,
    }
