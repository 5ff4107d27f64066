#!/usr/bin/env python
"""Bursts of events at the readout of frames, in each half of recordings.

Where the readout disturbs the event pixels, bursts of ON and of OFF events follow one another in
the rhythm of the frames, equally long apart in every recording of a camera::

    python scripts/real/readout_bursts.py slider_depth sequence1/events.npz --interval-ms 51.3

The interval is that of the frames, or near it, for recordings of events alone.
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

import click
import numpy as np
from writing import one_line_errors, table

from adv2e.diagnosis.data.stream import Stream
from adv2e.diagnosis.hints.readouts import Pulse, pulse_of
from adv2e.errors import DataError
from adv2e.formats.reading import read_events

COLUMNS = (
    "recording", "events", "frames apart [ms]", "ON in bursts", "OFF in bursts",
    "from ON to OFF [ms]",
)  # fmt: skip


@click.command()
@click.argument("paths", metavar="RECORDING...", nargs=-1, required=True)
@click.option("--interval-ms", type=click.FloatRange(min=0, min_open=True), help="Between frames.")
@one_line_errors()
def main(paths: tuple[str, ...], interval_ms: float | None) -> None:
    """Tell of bursts of events in the rhythm of the frames."""
    rows = [row for path in paths for row in rows_of(path, interval_ms)]
    print(table(COLUMNS, rows))


def rows_of(path: str, interval_ms: float | None) -> list[list[str]]:
    """Return a row for each half of a recording.

    Raises
    ------
    DataError
        It has no frames, and nobody says how far they would be apart.
    """
    recording = read_events(path)
    events, times_ns = recording.events, recording.frame_times_ns
    if times_ns is not None and len(times_ns) > 1:
        times_s = 1e-9 * times_ns
    elif interval_ms is None:
        raise DataError(f"{path}: has no frames; --interval-ms must say how far they are apart")
    elif not len(events):
        raise DataError(f"{path}: has neither frames nor events")
    else:
        times_s = np.arange(events["t"][0] * 1e-6, events["t"][-1] * 1e-6, interval_ms * 1e-3)
    name, middle_us = _name(Path(path).resolve()), 5e5 * (times_s[0] + times_s[-1])
    rows = []
    for which, start_us, stop_us in (
        ("first half", times_s[0] * 1e6, middle_us),
        ("second half", middle_us, times_s[-1] * 1e6),
    ):
        chosen = events[(events["t"] >= start_us) & (events["t"] < stop_us)]
        inside = (times_s * 1e6 >= start_us) & (times_s * 1e6 <= stop_us)
        pulse = pulse_of(Stream.of(chosen, recording.width, recording.height), times_s[inside])
        rows.append([f"{name}, {which}", f"{len(chosen):,}", *_cells(pulse)])
    return rows


def _name(path: Path) -> str:
    return path.name if path.is_dir() else f"{path.parent.name}/{path.name}"


def _cells(pulse: Pulse | None) -> list[str]:
    if pulse is None:
        return ["none", "", "", ""]
    apart = (pulse.off.begins_us - pulse.on.begins_us) % pulse.interval_us
    return [
        f"{pulse.interval_us / 1e3:.2f}",
        f"{pulse.on.share:.0%}",
        f"{pulse.off.share:.0%}",
        f"{apart / 1e3:.2f}",
    ]


if __name__ == "__main__":
    main()
