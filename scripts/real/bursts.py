"""Bursts of events at the readout of frames: as measured, and as simulated."""

from __future__ import annotations

import numpy as np
from writing import table

from adv2e.comparison.windows import Windows
from adv2e.config import Config
from adv2e.diagnosis.configurations import without_coupling
from adv2e.diagnosis.hints.readouts import Pulse
from adv2e.events import Events, cut
from real.model import Bench

_LASTS_US = 1000.0
"""From the beginning of a burst on, events are counted for so long."""


def bursts(bench: Bench, found: Config, windows: Windows, seed: int) -> str:
    """Return how many of the events come in bursts, as Markdown; nothing where there are none.

    Parameters
    ----------
    bench : Bench
    found : Config
    windows : Windows
        Of these.
    seed : int
    """
    pulse = bench.pulse
    if pulse is None:
        return ""
    measured = cut(bench.real.events, windows.start, windows.stop)
    streams = [("measured", measured)]
    bare = without_coupling(found)
    if bare != found:
        streams.append(("as found, without frame coupling", bench.quick(bare, windows, seed)))
    streams.append(("as found", bench.quick(found, windows, seed)))
    start_us = float(bench.real.times_us[0])
    rows = [[name, *_shares(pulse, events, start_us)] for name, events in streams]
    names = ["events", *(f"{name} within 1 ms from there" for name in ("ON", "OFF"))]
    return f"Up to the end of the first half, {pulse.text()}.\n\n" + table(names, rows)


def _shares(pulse: Pulse, events: Events, start_us: float) -> list[str]:
    """Return which shares of the ON and OFF events come in the bursts, for people."""
    cells = []
    for burst, on in ((pulse.on, 1), (pulse.off, 0)):
        since = events["t"][events["p"] == on] - start_us - burst.begins_us
        there = np.count_nonzero(since % pulse.interval_us < _LASTS_US)
        cells.append(f"{there / max(len(since), 1):.1%}")
    return cells
