"""A measured recording with frames, and simulators run on its frames."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import click
import numpy as np
from real.model import BEYOND_US, totals
from real.recording import Real, decoder_of

from adv2e.comparison.windows import Windows
from adv2e.diagnosis.fitting.nuisances import TOLERANCE, match_totals
from adv2e.events import Events, Window, cut
from experiments.simulators.clip import Clip, Simulator

SILENCE = 1000
"""A stretch without one event was not recorded where, at the mean rate, it would have so many."""
WIDEST = 25.0
"""Thresholds are sought from 1/25 to 25 times those of the simulator."""


def trial_options(command: Callable[..., None]) -> Callable[..., None]:
    """Add recordings, and how simulators are tried on them."""
    for one in (
        click.option(
            "--match-totals", "matching", is_flag=True,
            help="Add a table: thresholds set so that the totals of the first half of the frame"
            " intervals match, judged on the second.",
        ),
        click.option(
            "--seeds", type=click.IntRange(min=2), default=2, show_default=True,
            help="Simulations of each; values are their means, floors the means over their pairs.",
        ),
        click.argument("recordings", metavar="RECORDING...", nargs=-1, required=True),
    ):  # fmt: skip
        command = one(command)
    return command


@dataclass(frozen=True)
class Measured:
    """A recording with frames and events."""

    real: Real

    @cached_property
    def clip(self) -> Clip:
        """Its frames, in linear light."""
        source = self.real.source
        decoder = decoder_of(source)
        plain = source.dtype == np.uint8 and not source.colour and source.encoding == "linear"
        frames = list(self.real.frames())
        light = [one.image if plain else decoder.decode(one.image) for one in frames]
        return Clip(np.stack(light), np.array([one.t_ns for one in frames], np.int64))

    @cached_property
    def silences(self) -> list[Window]:
        """Stretches in which the camera recorded nothing [us], both ends excluded."""
        t = self.real.events["t"]
        at = np.flatnonzero(np.diff(t) * float(len(t)) >= SILENCE * float(t[-1] - t[0]))
        return [(int(t[i]), int(t[i + 1])) for i in at]

    def seen(self, events: Events, windows: Windows) -> Events:
        """Return the events in the windows, without those that the camera could not record."""
        events = cut(events, windows.start, windows.stop)
        kept = np.ones(len(events), np.bool_)
        for start, stop in self.silences:
            kept &= (events["t"] <= start) | (events["t"] >= stop)
        return events[kept]

    def made(self, simulator: Simulator, windows: Windows, seeds: Sequence[int]) -> list[Events]:
        """Return what a simulator makes of the frames, in the windows, a seed each."""
        clip = self.clip.until(windows.stop + BEYOND_US)
        return [self.seen(simulator.events(clip, seed), windows) for seed in seeds]

    def matched(self, simulator: Simulator, windows: Windows) -> tuple[Simulator, float]:
        """Return it with thresholds that match the totals in the windows, and what they miss by.

        A simulator that cannot be run anew is returned as it is.
        """
        goal = totals(cut(self.real.events, windows.start, windows.stop))
        levels = simulator.levels
        if levels is None:
            made = np.array(totals(self.made(simulator, windows, [0])[0]))
            return simulator, float(np.max(np.abs(made - goal) / np.maximum(goal, 1)))

        def counts(on: float, off: float) -> tuple[int, int]:
            return totals(self.made(simulator.with_levels(on, off), windows, [0])[0])

        within = min(levels) / WIDEST, max(levels) * WIDEST
        found, miss = match_totals(counts, levels, goal, within=within)
        return simulator.with_levels(*found), miss

    def all_matched(
        self, simulators: Sequence[Simulator], windows: Windows
    ) -> dict[str, Simulator]:
        """Return them so, by what tables call them: with thresholds, marked where they miss."""
        found = {}
        for one in simulators:
            simulator, miss = self.matched(one, windows)
            label = one.name
            if simulator.levels is not None:
                label += ", ON {:.3f} OFF {:.3f}".format(*simulator.levels)
            label += " (!)" if miss > TOLERANCE else ""
            click.echo(f"{self.real.name}: {label}: totals miss by {miss:.1%}", err=True)
            found[label] = simulator
        return found
