"""How far models are where a simulation hangs little on what was made up between the frames."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np
from writing import table

from adv2e.comparison.floor import half_split
from adv2e.comparison.windows import Windows
from adv2e.config import Config
from adv2e.diagnosis.configurations import without_coupling
from adv2e.events import Events, cut
from real.model import SCORE, Bench
from real.stability import LINES, MOST, Stability, compare_halved
from real.table import JUDGED, SHORT, Step, judged_cells, number, steps_table


def where_stable(
    bench: Bench,
    steps: Sequence[Step],
    windows: Windows,
    seeds: tuple[int, int],
    converted: Sequence[Events],
) -> str:
    """Return what dropping every second frame changes, and the tables of where that is little.

    Parameters
    ----------
    bench : Bench
    steps : sequence of Step
        All models, the last as found.
    windows : Windows
    seeds : (int, int)
    converted : sequence of Events
        Of the last model, a seed each, as ``adv2e convert`` makes them.
    """
    real, found = bench.real, steps[-1].added.config
    stability = _stability(bench, found, windows, seeds)
    within = partial(stability.alone, most=MOST)
    measured = within(real.events)
    everything = cut(real.events, windows.start, windows.stop)
    parts = [
        f"Dropping every second frame changes the simulation by {stability.change:.2f} of its norm"
        f" (chance taken off). Tiles where that is below {MOST:.0%} hold"
        f" {len(measured) / len(everything):.0%}"
        " of the measured events. The rest hangs on what was made up between frames and tells"
        " little of the camera."
    ]
    if len(measured):
        alone = [
            Step(one.added, bench.judge(one.added.config, windows, seeds, of=within))
            for one in steps[:-1]
        ]
        alone.append(Step(steps[-1].added, bench.against(converted, windows, of=within)))
        parts[-1] += " The same of those tiles alone:"
        parts.append(steps_table(real.size, measured, alone, windows))
    by_line = _by_line(bench, stability, converted)
    return "\n\n".join([*parts, "The model found, by where that line is drawn:", by_line])


def _by_line(bench: Bench, stability: Stability, converted: Sequence[Events]) -> str:
    """Return how far a model is in the tiles that change by no more than each of `LINES`."""
    real, windows = bench.real, stability.windows
    everything = len(cut(real.events, windows.start, windows.stop))
    rows = []
    for line in LINES:
        within = partial(stability.alone, most=line)
        measured = within(real.events)
        if not len(measured):
            continue
        rows.append(
            [
                "any" if np.isinf(line) else f"{line:.0%}",
                f"{len(measured) / everything:.0%}",
                *judged_cells(bench.against(converted, windows, of=within)),
                number(half_split(measured, windows, *real.size)[SCORE]),
            ]
        )
    last = f"half split, {SHORT[SCORE]}"
    return table(["change below", "measured events", *JUDGED, last], rows)


def _stability(bench: Bench, found: Config, windows: Windows, seeds: tuple[int, int]) -> Stability:
    """Return what dropping every second frame changes."""
    half = Bench(bench.real.thinned(), bench.threads)
    # frames that are dropped were read out all the same
    config = without_coupling(found)

    def pair(one: Bench) -> tuple[Events, Events]:
        first, second = seeds
        return one.quick(config, windows, first), one.quick(config, windows, second)

    return compare_halved(pair(bench), pair(half), windows, *bench.real.size)
