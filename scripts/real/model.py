"""A model of a recording under search: configurations simulated, thresholds matched, scored."""

from __future__ import annotations

import itertools
from bisect import bisect_right
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from adv2e.comparison.distances import distances, pooled
from adv2e.comparison.floor import Floor
from adv2e.comparison.windows import Windows
from adv2e.config import Config
from adv2e.diagnosis.data.stream import Stream
from adv2e.diagnosis.fitting.nuisances import fit_thresholds
from adv2e.diagnosis.hints.readouts import Pulse, has_pulse, pulse_of
from adv2e.diagnosis.simulation.frames import FrameCache, Instants, events_of, is_made_once
from adv2e.events import Events, cut
from adv2e.light.decoding import decoder_for
from adv2e.pixel.steps import Coarseness
from real.recording import Real, halves, still_rate

SCORE = "relative_5_bins_smoothed"
"""What the tables judge by."""
SOUGHT = (SCORE, "relative_1_bin_smoothed")
"""What the search goes by, their mean: by one alone, on few windows, it would fit chance."""
NEAR = 0.03
"""Totals match to this while candidates are compared, relative."""
COARSE = Coarseness(solved=4.0)
"""Steps of time where the pixels are solved in steps: the scores see hundreds of microseconds."""
BEYOND_US = 100_000
"""Frames are simulated to this long after the windows, as a clock offset may need them [us]."""


def totals(events: Events) -> tuple[int, int]:
    """Return the counts of ON and OFF events."""
    on = int(np.count_nonzero(events["p"]))
    return on, len(events) - on


@dataclass(frozen=True)
class Counts:
    """What is told of streams by themselves, means: None where it is not defined."""

    events: float
    on_share: float | None
    still_hz: float | None

    @classmethod
    def of(cls, streams: Sequence[Events], real: Real, windows: Windows) -> Counts:
        """Return counts, shares and rates of streams that are cut to the windows."""
        shares = [totals(one)[0] / len(one) if len(one) else None for one in streams]
        rates = [still_rate(one, real.still, windows.duration_s) for one in streams]
        count = float(np.mean([len(one) for one in streams]))
        return cls(count, pooled(shares, "mean"), pooled(rates, "mean"))


@dataclass(frozen=True)
class Judged:
    """A configuration against the measured events: means over seeds."""

    values: Floor
    floor: Floor
    made: Counts
    measured: Counts

    @property
    def events_ratio(self) -> float | None:
        """Events over those measured."""
        return self.made.events / self.measured.events if self.measured.events else None

    def without_chance(self, name: str) -> float | None:
        """Return how far the mean of many simulations would be: theirs apart is twice their chance.

        Squared distances relative to one measured grid add up: of the mean, and of one simulation
        about it.  Of the recording's own chance nothing is taken off.
        """
        value, apart = self.values[name], self.floor[name]
        if value is None or apart is None:
            return None
        return float(np.sqrt(max(value**2 - 0.5 * apart**2, 0.0)))


class Bench:
    """Simulates a recording with configurations.

    In-between frames along the motion take longer than all else, so they are made once for what
    they depend on (:mod:`adv2e.diagnosis.simulation.frames`).

    Parameters
    ----------
    real : Real
    threads : int, optional
        Default: all cores.
    declared : Config, optional
        A pulse that is declared stays where it is.

    Attributes
    ----------
    simulations : int
        Made so far.
    """

    def __init__(self, real: Real, threads: int | None, declared: Config | None = None) -> None:
        self.real, self.threads = real, threads
        self._stays = declared is not None and has_pulse(declared)
        self._frames = FrameCache()
        self.simulations = 0

    @cached_property
    def pulse(self) -> Pulse | None:
        """The pulse that follows each frame, as far as bursts up to the end of the first half tell.

        The second half is for judging alone.
        """
        real, until = self.real, halves(self.real.windows)[0].stop
        seen = Stream.of(real.events[real.events["t"] < until], *real.size)
        return pulse_of(seen, real.times_us[real.times_us <= until] * 1e-6)

    def quick(self, config: Config, windows: Windows, seed: int) -> Events:
        """Return the events in the windows, from in-between frames made once."""
        self.simulations += 1
        if not is_made_once(config):
            whole = self.real.simulator(config, windows.stop + BEYOND_US, self.threads)(seed)
            return cut(whole, windows.start, windows.stop)
        times_ns, light = self._frames.of(config, lambda: self._read(config))
        used = bisect_right(times_ns, (windows.stop + BEYOND_US) * 1000)
        events = events_of(
            (times_ns[:used], light[:used]), replace(config, seed=seed),
            threads=self.threads, coarseness=COARSE,
        )  # fmt: skip
        return cut(events, windows.start, windows.stop)

    def _read(self, config: Config) -> Instants:
        """Return the light of the frames, without what is laid over it."""
        source = self.real.source
        decoder = decoder_for(
            config.frames, source.dtype, source.colour, auto=source.encoding,
            white=source.full_scale,
        )  # fmt: skip
        frames = list(self.real.frames())
        return [one.t_ns for one in frames], np.array([decoder.decode(one.image) for one in frames])

    def matched(self, config: Config, windows: Windows, tolerance: float = NEAR) -> Config:
        """Return `config` with thresholds that match the totals in the windows.

        And with a pulse, if it has one that was not declared, where the bursts are.
        """
        if self.pulse is not None and not self._stays:
            config = self.pulse.placed(config)
        goal = totals(cut(self.real.events, windows.start, windows.stop))

        def made(tried: Config) -> tuple[int, int]:
            return totals(self.quick(tried, windows, tried.seed))

        return fit_thresholds(made, config, goal, tolerance=tolerance, rounds=5)[0]

    def missed(self, config: Config, windows: Windows) -> float:
        """Return by how much the worse of the two totals misses in the windows, relative."""
        goal = np.array(totals(cut(self.real.events, windows.start, windows.stop)))
        made = np.array(totals(self.quick(config, windows, config.seed)))
        return float(np.max(np.abs(made - goal) / np.maximum(goal, 1)))

    def score(
        self, config: Config, windows: Windows, seeds: Sequence[int]
    ) -> tuple[float, float | None]:
        """Return score and rate of the still pixels [Hz], means over seeds.

        The score is the mean over the windows of what is in `SOUGHT`, not their median as in the
        tables: a search that went by the median would fit the two windows in the middle.  It is
        infinite where there is nothing to score.
        """
        scores, rates = [], []
        for seed in seeds:
            events = self.quick(config, windows, seed)
            found = distances(self.real.events, events, windows, *self.real.size)
            scores += [pooled(found.per_window[name], "mean") for name in SOUGHT]
            rates.append(still_rate(events, self.real.still, windows.duration_s))
        mean = pooled(scores, "mean")
        return np.inf if mean is None else mean, pooled(rates, "mean")

    def still_hz(self, windows: Windows) -> float | None:
        """Return the measured rate of the still pixels [Hz]."""
        measured = cut(self.real.events, windows.start, windows.stop)
        return still_rate(measured, self.real.still, windows.duration_s)

    def judge(
        self,
        config: Config,
        windows: Windows,
        seeds: Sequence[int],
        *,
        of: Callable[[Events], Events] | None = None,
    ) -> Judged:
        """Return how far a configuration is on the windows; `of`: see :meth:`against`."""
        return self.against(self.made(config, windows, seeds), windows, of=of)

    def made(
        self, config: Config, windows: Windows, seeds: Sequence[int], *, in_full: bool = False
    ) -> list[Events]:
        """Return the events in the windows, a seed each; `in_full`: as ``adv2e convert`` does."""
        if not in_full:
            return [self.quick(config, windows, seed) for seed in seeds]
        simulate = self.real.simulator(config, windows.stop + BEYOND_US, self.threads)
        return [cut(simulate(seed), windows.start, windows.stop) for seed in seeds]

    def against(
        self,
        made: Sequence[Events],
        windows: Windows,
        *,
        of: Callable[[Events], Events] | None = None,
    ) -> Judged:
        """Return how far simulations of one configuration are on the windows, as means.

        `of` picks the events to judge by.
        """
        real, of = self.real, of or (lambda events: events)
        streams = [of(one) for one in made]
        measured = of(cut(real.events, windows.start, windows.stop))
        found = [distances(measured, one, windows, *real.size).values for one in streams]
        apart = [
            distances(*pair, windows, *real.size, whole=measured).values
            for pair in itertools.combinations(streams, 2)
        ]
        made_of, measured_of = (Counts.of(one, real, windows) for one in (streams, [measured]))
        return Judged(means(found), means(apart), made_of, measured_of)


def means(found: Sequence[Floor]) -> Floor:
    """Return the mean of each measure."""
    return {name: pooled([one[name] for one in found], "mean") for name in found[0]}
