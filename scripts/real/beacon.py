#!/usr/bin/env python
"""What events of a blinking LED tell where neither their pixels nor the light are known.

Files are ``.npz`` with ``t_us`` and ``p``, such as those of LED beacons (Wang et al., "Asynchronous
Optical Communication with Event Cameras", IROS 2022; github.com/ziweiWWANG/Event-Beacon-
Communication).  When the LED switched, the bursts themselves say: one begins where no event of its
polarity came for a while.  Without pixels there are no thresholds, no dead times and no rates of
noise; without the light, no corner.  What is left are delays, and how many events come at a time.
Prints a Markdown table::

    python scripts/real/beacon.py led-beacon/504hz_30m.npz
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1]))

import click
import numpy as np
from numpy.typing import NDArray
from writing import one_line_errors, table

from adv2e.errors import DataError

_PER_US = 100
_LEAST = 0.2
"""Of the events of a usual burst; what is smaller is no switching of the LED."""


@click.command()
@click.argument("files", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option("--quiet-us", type=click.IntRange(min=1), default=400, show_default=True,
              help="A burst begins after so long without an event of its polarity.")  # fmt: skip
@one_line_errors()
def main(files: tuple[Path, ...], quiet_us: int) -> None:
    """Tell the bursts of a blinking LED."""
    head = (
        "file", "polarity", "bursts", "events a burst",
        "10, 50, 90 % of them come within [us]", f"most events in {_PER_US} us",
    )  # fmt: skip
    rows = []
    for path in files:
        t, on = read(path)
        for name, which in (("ON", on), ("OFF", ~on)):
            number, size, delays = bursts(t[which], quiet_us)
            within = ", ".join(f"{one:,.0f}" for one in delays)
            rows.append((path.stem, name, f"{number:,}", f"{size:,.0f}", within, f"{most(t):,}"))
    print(table(head, rows))


def read(path: Path) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Return times [us], sorted, and whether each event is ON."""
    try:
        with np.load(path) as held:
            t, on = held["t_us"].astype(np.int64), held["p"] > 0
    except (OSError, KeyError, ValueError) as error:
        raise DataError(f"{path}: must be an .npz with t_us and p: {error}") from None
    order = np.argsort(t, kind="stable")
    return t[order], on[order]


def bursts(t: NDArray[np.int64], quiet_us: int) -> tuple[int, float, NDArray[Any]]:
    """Return how many bursts there are, the events of a usual one, and quantiles of their delays.

    Delays of all events since the first of their burst, those of 10, 50 and 90 % of them [us].
    """
    begins = np.flatnonzero(np.diff(t, prepend=-(10**12)) > quiet_us)
    size = np.diff(np.append(begins, len(t)))
    usual = float(np.median(np.repeat(size, size)))  # of the burst that a usual event is in
    kept = size >= _LEAST * usual
    delay = t - np.repeat(t[begins], size)
    delays = np.quantile(delay[np.repeat(kept, size)], [0.1, 0.5, 0.9])
    return int(kept.sum()), float(np.median(size[kept])), delays


def most(t: NDArray[np.int64]) -> int:
    """Return the most events that come within 100 us."""
    return int((np.arange(len(t)) - np.searchsorted(t, t - _PER_US, "right") + 1).max())


if __name__ == "__main__":
    main()
