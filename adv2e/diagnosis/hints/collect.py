"""Starting values of fits, collected from a recording and from simulations of the model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from adv2e.config import Config
from adv2e.diagnosis.data import splits
from adv2e.diagnosis.data.evidence import Evidence
from adv2e.diagnosis.data.scene import Scene
from adv2e.diagnosis.data.splits import Stream
from adv2e.diagnosis.hints.lamps import Lamp, lamps_of, strongest_lines
from adv2e.diagnosis.hints.own_period import OwnPeriod
from adv2e.diagnosis.hints.readouts import Pulse, Readouts, pulse_of, readouts_of
from adv2e.diagnosis.hints.stamps import Service, double_reads, service_times, tick_of
from adv2e.diagnosis.simulation.simulator import Simulator
from adv2e.effects.readout.double_read import DoubleRead

_LAMP_SEED = 9_998
_HARDLY_ANY = 0.01


@dataclass(frozen=True)
class Hints:
    """Starting values of fits, read off the recording.

    Attributes
    ----------
    seconds : float
        Length of the recording.
    lamps : tuple of Lamp
        Of the strongest lines in the rate.
    tick_us : int
        Largest time of which nearly all stamps are multiples.
    encoding : str
        What ``frames.encoding: auto`` means for the frames.
    service : Service, optional
        Times that an event and a row take, where stamps look as if they had waited for a channel.
    readouts : Readouts, optional
        Of frames, where all pixels fire at once after each.
    pulse : Pulse, optional
        Where they fire twice: as the signal leaps, and as it leaps back.
    own_period : OwnPeriod, optional
        Where all pixels fire at once, but not with the frames.
    too_many : (float, float)
        ON and OFF events that the declared model makes, over those measured.
    """

    seconds: float
    lamps: tuple[Lamp, ...]
    tick_us: int
    encoding: str = "linear"
    service: Service | None = None
    readouts: Readouts | None = None
    pulse: Pulse | None = None
    own_period: OwnPeriod | None = None
    too_many: tuple[float, float] = (1.0, 1.0)
    double_read: DoubleRead | None = None
    """Shares of events that were read twice, where some were."""
    shortest_us: float | None = None
    """Interval between events of a pixel, 1 % quantile [us], under known light.  All pixels then do
    the same at the same time, so that fits find a refractory period only from near it."""


def hints_of(
    evidence: Evidence,
    declared: Config,
    scene: Scene,
    pilot: Sequence[Stream],
    simulator: Simulator,
    own_period: OwnPeriod | None = None,
) -> Hints:
    """Return starting values of fits from a recording.

    Lamps are read off the training data, the readout of frames off the data for training and
    validation, times of the arbiter off all timestamps.  The `pilot` is simulations of the declared
    model; `own_period` was found before.
    """

    def train(stream: Stream) -> Stream:
        return scene.split.chosen(stream, splits.TRAIN)

    stream = evidence.stream
    hints = Hints(
        evidence.seconds,
        (),
        tick_of(stream.t),
        service=service_times(stream),
        double_read=double_reads(stream),
        too_many=(_too_many(stream, pilot, 1), _too_many(stream, pilot, 0)),
    )
    if evidence.stimulus is not None:  # no lamp that it does not tell, no frame that is read out
        apart = stream.since[stream.since >= 0]
        shortest_us = float(np.quantile(apart, _HARDLY_ANY)) if len(apart) else None
        return replace(hints, shortest_us=shortest_us)
    looked_at = train_and_validation_events(evidence, scene)
    lines = strongest_lines(train(stream), list(map(train, pilot)), scene)
    lamps = lamps_of(
        lines, train(stream), declared, lambda lit: train(simulator.stream(lit, _LAMP_SEED))
    )
    pulse = None if own_period else pulse_of(looked_at, evidence.times_s, evidence.before_s)
    return replace(
        hints,
        lamps=tuple(lamps),
        encoding=evidence.encoding,
        readouts=readouts_of(looked_at, evidence.times_s),
        pulse=pulse,
        own_period=own_period,
    )


def train_and_validation_events(evidence: Evidence, scene: Scene) -> Stream:
    """Return the events for training and validation, off which the frame readout is read."""
    return scene.split.chosen(evidence.stream, splits.TRAIN, splits.VALIDATION)


def _too_many(stream: Stream, pilot: Sequence[Stream], polarity: int) -> float:
    """Return the ratio of simulated to measured numbers of events of a polarity, each plus 1."""
    made = float(np.mean([np.count_nonzero(one.on == polarity) for one in pilot]))
    return (made + 1.0) / (float(np.count_nonzero(stream.on == polarity)) + 1.0)
