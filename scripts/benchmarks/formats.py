#!/usr/bin/env python
"""Measure how fast each format of events is written and read, beside the fastest library for it.

The same events go through every format, in one process and one thread, in turn; the median of
several rounds counts.  A library that is not installed has no column::

    python scripts/benchmarks/formats.py
    python scripts/benchmarks/formats.py --events 5000000 --rounds 5 --only evt3 -o formats.md

Reading is all events in columns, part by part.  Libraries: expelliarmus, faery, event_stream,
dv-processing, aedat, rosbags, pandas, h5py and NumPy.  The test extra has them.
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from statistics import median
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1]))

import click
import numpy as np

from adv2e.errors import MissingExtraError
from adv2e.events import EVENT_DTYPE, Events, sort_events
from adv2e.formats.reading import open_events
from adv2e.formats.registry import FORMATS, Format
from adv2e.formats.writing import open_sink

SIZE = WIDTH, HEIGHT = 346, 260
_CHUNK = 1 << 18

Work = Callable[[], Any]

Speeds = dict[str, dict[str, float]]
"""By program, then by what it does [million events a second]."""


def moving_edges(count: int) -> Events:
    """Return events as edges that move over the sensor make them, some 5 million a second."""
    draw = np.random.default_rng(1)
    events = np.empty(count, EVENT_DTYPE)
    events["t"] = np.sort(draw.integers(0, count // 5, count))
    place = events["t"] * 1e-6 * 120 % WIDTH
    events["x"] = (place + draw.normal(0, 3, count)).astype(np.int64) % WIDTH
    events["y"] = draw.integers(0, HEIGHT, count)
    events["p"] = draw.integers(0, 2, count)
    return sort_events(events)


def ours(found: Format, events: Events, path: Path) -> tuple[Work, Work]:
    """Return what writes and what reads `path` in a format."""
    chosen = {"format": "h5", "layout": found.name} if found.is_hdf5 else {"format": found.name}

    def write() -> None:
        with open_sink(
            path,
            **{"width": WIDTH, "height": HEIGHT, "metadata": {}, "overwrite": True, **chosen},
            threads=1,
        ) as sink:
            for begin in range(0, events.size, _CHUNK):
                sink.write_events(events[begin : begin + _CHUNK])

    def read() -> int:
        return sum(columns[0].size for columns in open_events(path).parts())

    return write, read


def _faery(events: Events, path: Path, **how: Any) -> dict[str, Work]:
    import faery  # noqa: PLC0415

    theirs = np.zeros(events.size, faery.EVENTS_DTYPE)
    for name, column in zip("txyp", ("t", "x", "y", "on"), strict=True):
        theirs[column if column in theirs.dtype.names else name] = events[name]
    out = path.with_name(f"faery{path.suffix}")
    return {
        "write": lambda: faery.events_stream_from_array(theirs, SIZE).to_file(out, **how),
        "read": lambda: faery.events_stream_from_file(path).to_array(),
    }


def _expelliarmus(events: Events, path: Path, encoding: str) -> dict[str, Work]:
    from expelliarmus import Wizard  # noqa: PLC0415

    wizard = Wizard(encoding=encoding)
    theirs = wizard.read(path)
    out = path.with_name(f"expelliarmus{path.suffix}")
    return {
        "write": lambda: wizard.save(out, theirs),
        "read": lambda: wizard.read(path),
    }


def _event_stream(events: Events, path: Path) -> dict[str, Work]:
    import event_stream  # noqa: PLC0415

    parts = list(event_stream.Decoder(str(path)))

    def write() -> None:
        out = path.with_name("event_stream.es")
        with event_stream.Encoder(str(out), "dvs", *SIZE) as encoder:
            for part in parts:
                encoder.write(part)

    return {"write": write, "read": lambda: list(event_stream.Decoder(str(path)))}


def _pandas(events: Events, path: Path, **how: Any) -> dict[str, Work]:
    import pandas as pd  # noqa: PLC0415

    table = pd.DataFrame({name: events[name] for name in "txyp"})
    out = path.with_name(f"pandas{path.suffix}")
    return {
        "write": lambda: table.to_csv(out, index=False, **how),
        "read": lambda: pd.read_csv(path, **how),
    }


def _numpy(events: Events, path: Path) -> dict[str, Work]:
    columns = {name: events[name].copy() for name in "txyp"}
    out = path.with_name("numpy.npz")

    def read() -> None:
        with np.load(path) as archive:
            for name in archive.files:
                archive[name]

    return {"write": lambda: np.savez_compressed(out, **columns), "read": read}


def _h5py(events: Events, path: Path) -> dict[str, Work]:
    import h5py  # noqa: PLC0415

    columns = {name: events[name].copy() for name in "txyp"}
    how = {"compression": "gzip", "compression_opts": 1, "shuffle": True, "chunks": (1 << 16,)}

    def write() -> None:
        with h5py.File(path.with_name("h5py.h5"), "w") as file:
            for name, column in columns.items():
                file.create_dataset(name, data=column, **how)

    def read() -> None:
        def take(name: str, found: Any) -> None:
            if isinstance(found, h5py.Dataset):
                found[()]

        with h5py.File(path) as file:
            file.visititems(take)

    return {"write": write, "read": read}


def _dv(events: Events, path: Path) -> dict[str, Work]:
    import dv_processing as dv  # noqa: PLC0415

    def read() -> None:
        recording = dv.io.MonoCameraRecording(str(path))
        while (batch := recording.getNextEventBatch()) is not None:
            batch.numpy()

    return {"read": read}


def _aedat(events: Events, path: Path) -> dict[str, Work]:
    import aedat  # noqa: PLC0415

    return {"read": lambda: list(aedat.Decoder(str(path)))}


def _rosbags(events: Events, path: Path) -> dict[str, Work]:
    from rosbags.highlevel import AnyReader  # noqa: PLC0415

    def read() -> None:
        with AnyReader([path]) as reader:
            for connection, _, data in reader.messages():
                reader.deserialize(data, connection.msgtype)

    return {"read": read}


_SPACES = {"sep": " ", "header": None}

LIBRARIES: dict[str, dict[str, Callable[[Events, Path], dict[str, Work]]]] = {
    "txt": {"pandas": lambda e, p: _pandas(e, p, **_SPACES)},
    "csv": {"pandas": _pandas, "faery": _faery},
    "npz": {"NumPy": _numpy},
    "evt3": {"faery": lambda e, p: _faery(e, p, version="evt3")},
    "evt2": {
        "faery": lambda e, p: _faery(e, p, version="evt2"),
        "expelliarmus": lambda e, p: _expelliarmus(e, p, "evt2"),
    },
    "dat": {
        "faery": _faery,
        "expelliarmus": lambda e, p: _expelliarmus(e, p, "dat"),
    },
    "es": {"faery": _faery, "event_stream": _event_stream},
    "aedat4": {
        "faery": _faery,
        "dv-processing": _dv,
        "aedat": _aedat,
    },
    "bag": {"rosbags": _rosbags},
    **{f.name: {"h5py": _h5py} for f in FORMATS if f.is_hdf5},
}
"""What else reads and writes a format."""


def measure(
    found: Format, events: Events, folder: Path, rounds: int
) -> dict[str, dict[str, float]]:
    """Return the speeds [million events a second] of each program, writing and reading."""
    suffix = found.suffixes[0]
    path = folder / f"{found.name}{suffix}"
    write, read = ours(found, events, path)
    write()
    assert read() == events.size, found.name
    works: dict[str, dict[str, Work]] = {"adv2e": {"write": write, "read": read}}
    for name, library in LIBRARIES.get(found.name, {}).items():
        with suppress(ImportError):
            works[name] = library(events, path)
    times: dict[tuple[str, str], list[float]] = defaultdict(list)
    for _ in range(rounds):
        for name, work in works.items():
            for what, run in work.items():
                began = time.perf_counter()
                try:
                    run()
                except Exception as error:
                    click.echo(f"{found.name}: {name} cannot {what}: {error}", err=True)
                    continue
                times[name, what].append(time.perf_counter() - began)
    speeds: Speeds = defaultdict(dict)
    for (name, what), taken in times.items():
        speeds[name][what] = events.size / median(taken) / 1e6
    return speeds


def row(found: Format, speeds: Speeds) -> str:
    """Return a line of the table."""
    cells = [found.name]
    for what in ("write", "read"):
        mine = speeds["adv2e"][what]
        others = {n: s[what] for n, s in speeds.items() if n != "adv2e" and what in s}
        cells.append(f"{mine:.1f}")
        if others:
            best = max(others, key=lambda name: others[name])
            cells += [f"{others[best]:.1f} ({best})", f"{mine / others[best]:.2f}"]
        else:
            cells += ["", ""]
    return f"| {' | '.join(cells)} |"


@click.command()
@click.option("--events", "count", type=click.IntRange(1), default=2_000_000, show_default=True)
@click.option("--rounds", type=click.IntRange(1), default=5, show_default=True)
@click.option("--only", multiple=True, help="Formats with this name.")
@click.option("-o", "--output", type=click.Path(path_type=Path), help="Write the table here, too.")
def main(count: int, rounds: int, only: tuple[str, ...], output: Path | None) -> None:
    """Measure writers and readers of all formats."""
    events = moving_edges(count)
    lines = [
        "| format | writes [Mev/s] | fastest library | ratio | reads [Mev/s] | fastest library |"
        " ratio |",
        "|---|---|---|---|---|---|---|",
    ]
    for line in lines:
        click.echo(line)
    with tempfile.TemporaryDirectory() as scratch:
        for found in FORMATS:
            if not (found.reader and found.writer) or (only and found.name not in only):
                continue
            try:
                speeds = measure(found, events, Path(scratch), rounds)
            except MissingExtraError as error:
                click.echo(f"{found.name}: {error}", err=True)
                continue
            lines.append(row(found, speeds))
            click.echo(lines[-1])
    if output is not None:
        output.write_text("\n".join(lines) + "\n", "utf-8")


if __name__ == "__main__":
    main()
