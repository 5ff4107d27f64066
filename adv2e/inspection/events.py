"""Inspection of a stream of events: numbers, rates, and problems."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.causes import CAUSES, has_causes
from adv2e.events import Events, pixels_of
from adv2e.sources.times.rates import seconds

GAP_STEPS = 100
"""A gap is longer than this many median steps between events, ..."""
GAP_US = 10_000
"""... and than this [us]: shorter pauses are ordinary, since events come in bursts."""
HOT_FACTOR = 10
"""A hot pixel fires more often than this many times the 99.9 % quantile of all pixels."""
HOT_LISTED = 5
"""Hot pixels listed by position."""


def describe_events(events: Events, width: int, height: int) -> dict[str, Any]:
    """Return counts, span, rates and tick of `events`; None for what a few events cannot tell."""
    count, on = len(events), int(np.count_nonzero(events["p"]))
    first = int(events["t"].min()) if count else None
    last = int(events["t"].max()) if count else None
    duration_s = (last - first) / 1e6 if first is not None and last is not None else None
    rate_hz = count / duration_s if duration_s else None
    return {
        "count": count,
        "on": on,
        "off": count - on,
        "on_share": on / count if count else None,
        "first_us": first,
        "last_us": last,
        "duration_s": duration_s,
        "rate_hz": rate_hz,
        "rate_per_pixel_hz": rate_hz / (width * height) if rate_hz else None,
        "tick_us": tick_us(events),
        "causes": causes_of(events),
    }


def causes_of(events: Events) -> dict[str, int] | None:
    """Return the number of events of each cause, by its name; None: causes are not recorded."""
    if not has_causes(events):
        return None
    counts = np.bincount(events["cause"], minlength=len(CAUSES)).tolist()
    return dict(zip(CAUSES, counts, strict=True))


def tick_us(events: Events) -> int | None:
    """Return the greatest common divisor of all time differences [us], None if there are none."""
    if not len(events):
        return None
    return int(np.gcd.reduce(events["t"] - events["t"][0])) or None


def oddities_of(events: Events, width: int, height: int) -> list[str]:
    """Return gaps in time and hot pixels of sorted `events`, a line each."""
    if not len(events):
        return []
    return [line for line in (_gaps(events), _hot(events, width, height)) if line]


def _gaps(events: Events) -> str:
    steps = np.diff(events["t"])
    moving = steps[steps > 0]
    if not len(moving):
        return ""
    limit = max(GAP_US, GAP_STEPS * float(np.median(moving)))
    gaps = np.flatnonzero(steps > limit)
    if not len(gaps):
        return ""
    longest = int(np.argmax(steps))
    return (
        f"{_number_of(len(gaps), 'gap')} over {limit / 1000:g} ms, the longest of"
        f" {steps[longest] / 1000:g} ms after {seconds(int(events['t'][longest]) * 1000)} s"
    )


def _hot(events: Events, width: int, height: int) -> str:
    # of the pixels that fired, as a sensor may be stated to be of any size
    pixels, counts = np.unique(pixels_of(events, width), return_counts=True)
    hot = np.flatnonzero(counts > HOT_FACTOR * max(_quantile(counts, width * height, 0.999), 1.0))
    if not len(hot):
        return ""
    top = hot[np.argsort(-counts[hot], kind="stable")][:HOT_LISTED]
    listed = ", ".join(
        f"({pixels[i] % width}, {pixels[i] // width}): {counts[i]:,} events" for i in top
    )
    more = f" and {len(hot) - len(top):,} more" if len(hot) > len(top) else ""
    return f"{_number_of(len(hot), 'hot pixel')} (x, y): {listed}{more}"


def _quantile(counts: NDArray[np.int64], pixels: int, share: float) -> float:
    """Return a quantile of the counts of so many pixels, of which all others have none."""
    ordered = np.sort(counts)
    place = share * (pixels - 1)
    below = int(place)
    ranks = np.array([below, min(below + 1, pixels - 1)]) - (pixels - len(counts))
    low, high = np.where(ranks >= 0, ordered[np.maximum(ranks, 0)], 0)
    return float(low + (high - low) * (place - below))


def _number_of(count: int, what: str) -> str:
    return f"{count:,} {what}" + "s" * (count != 1)
