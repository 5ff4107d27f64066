#!/usr/bin/env python
"""What hours of recordings cost to convert: hours of a core, and bytes.

Converts clips of its own in one thread, as a batch does that has as many jobs as cores::

    python scripts/benchmarks/batch_costs.py --quick
    python scripts/benchmarks/batch_costs.py --hours 12 --hours 10000

Prints the rates and the hours that they come to as Markdown.  All pixels of the clips see motion
all the time, so that other recordings make fewer events; ``adv2e batch --dry-run`` looks at yours.
"""

from __future__ import annotations

import statistics
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

import click
from writing import one_line_errors, output_option, table, write_report

from adv2e import convert, load_config
from benchmarks.clips import Clip, as_srgb, default_folder, encoded, stored
from benchmarks.machine import machine_line
from benchmarks.measuring import measured


@dataclass(frozen=True)
class Case:
    """One kind of recording.

    Attributes
    ----------
    name : str
    width, height : int
        Of its frames.
    fps, speed : float
        Frames a second; speed of all motion, relative to 80 px/s.
    """

    name: str
    width: int
    height: int
    fps: float
    speed: float = 1.0


CASES = (
    Case("346x260, 10 fps", 346, 260, 10.0),
    Case("346x260, 25 fps", 346, 260, 25.0),
    Case("346x260, 25 fps, a quarter as fast", 346, 260, 25.0, speed=0.25),
    Case("1280x720, 30 fps, to 346x260", 1280, 720, 30.0, speed=2.5),
)


@dataclass(frozen=True)
class Cost:
    """What one kind of recording costs.

    Attributes
    ----------
    core_ns : float
        Time of a core for each pixel of the sensor and frame [ns].
    rate_hz : float
        Events of a pixel a second.
    event_bytes : float
        Of the file, for each event.
    core_hours, gigabytes, gigaevents : float
        For each hour of recording.
    """

    core_ns: float
    rate_hz: float
    event_bytes: float
    core_hours: float
    gigabytes: float
    gigaevents: float


def cost(case: Case, seconds: float, rounds: int, folder: Path) -> Cost:
    """Return what a recording of one kind costs, from a clip of so many seconds."""
    frames = round(seconds * case.fps) + 1
    clip = Clip(width=case.width, height=case.height, frames=frames, fps=case.fps, speed=case.speed)
    video = encoded(as_srgb(stored(clip, folder)), case.fps)
    config = load_config("davis346")
    with tempfile.TemporaryDirectory() as scratch:
        output = Path(scratch) / "events.h5"

        def once() -> float:
            made, took = measured(lambda: convert(video, output, config, threads=1, overwrite=True))
            sizes.append((made.events, made.width * made.height, made.duration_s))
            return took.cpu_s

        sizes: list[tuple[int, int, float]] = []
        once()  # loads what is compiled
        cpu_s = statistics.median(once() for _ in range(rounds))
        size = output.stat().st_size
    events, pixels, duration_s = sizes[-1]
    hours = duration_s / 3600.0
    return Cost(
        1e9 * cpu_s / (pixels * frames),
        events / pixels / duration_s,
        size / events,
        cpu_s / 3600.0 / hours,
        size / 1e9 / hours,
        events / 1e9 / hours,
    )


def report(costs: dict[str, Cost], hours: list[float]) -> str:
    """Return the rates, and what hours of each kind come to."""
    head = ["", "ns a pixel and frame", "events a pixel and second", "bytes an event"]
    head += [
        f"{count:,g} h: {what}" for count in hours for what in ("core hours", "GB", "10^9 events")
    ]
    rows = [
        [
            name,
            f"{one.core_ns:.0f}",
            f"{one.rate_hz:.1f}",
            f"{one.event_bytes:.1f}",
            *(
                f"{count * each:,.3g}" if count * each < 1000 else f"{count * each:,.0f}"
                for count in hours
                for each in (one.core_hours, one.gigabytes, one.gigaevents)
            ),
        ]
        for name, one in costs.items()
    ]
    return f"{table(head, rows)}\n\n{machine_line()}; `davis346`, HDF5, one thread."


@click.command()
@click.option("--quick", is_flag=True, help="Clips of 2 s, one round; rough.")
@click.option("--hours", type=float, multiple=True, default=(12.0, 10_000.0), show_default=True)
@output_option
@one_line_errors()
def main(quick: bool, hours: tuple[float, ...], output: Path | None) -> None:
    """Measure what hours of recordings cost to convert."""
    seconds, rounds = (2.0, 1) if quick else (4.0, 3)
    costs = {case.name: cost(case, seconds, rounds, default_folder()) for case in CASES}
    write_report(report(costs, list(hours)), output, {k: vars(v) for k, v in costs.items()})


if __name__ == "__main__":
    main()
