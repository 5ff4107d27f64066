"""What a look at a recording says of where fits may start."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from adv2e.config import Config
from adv2e.diagnosis.data import splits
from adv2e.diagnosis.data.evidence import Evidence
from adv2e.diagnosis.data.scene import Scene
from adv2e.diagnosis.data.stream import Stream
from adv2e.diagnosis.hints.lamps import Lamp, lamps_of, strongest_lines
from adv2e.diagnosis.hints.own_period import OwnPeriod
from adv2e.diagnosis.hints.readouts import Pulse, Readouts, pulse_of, readouts_of
from adv2e.diagnosis.hints.stamps import Service, service_times, tick_of
from adv2e.diagnosis.simulation.simulator import Simulator

_LAMP_SEED = 9_998
_HARDLY_ANY = 0.01


@dataclass(frozen=True)
class Hints:
    """What a look at the recording says of where fits may start.

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
    shortest_us: float | None = None
    """Time between events of a pixel that hardly any two are nearer than, under known light: where
    all pixels do the same at the same time, fits find a dead time from near alone."""


def hints_of(
    evidence: Evidence,
    declared: Config,
    scene: Scene,
    pilot: Sequence[Stream],
    simulator: Simulator,
    own_period: OwnPeriod | None = None,
) -> Hints:
    """Return hints from a recording.

    Lamps are told by the data that effects are fitted to, and what happens at each frame by all but
    those that are looked at once; but how stamps follow one another shows in no part.  The `pilot`
    is simulations of the declared model; `own_period` was found before.
    """

    def train(stream: Stream) -> Stream:
        return scene.split.chosen(stream, splits.TRAIN)

    stream = evidence.stream
    too_many = _too_many(stream, pilot, 1), _too_many(stream, pilot, 0)
    if evidence.stimulus is not None:  # no lamp that it does not tell, no frame that is read out
        apart = stream.since[stream.since >= 0]
        return Hints(
            evidence.seconds,
            (),
            tick_of(stream.t),
            service=service_times(stream),
            too_many=too_many,
            shortest_us=float(np.quantile(apart, _HARDLY_ANY)) if len(apart) else None,
        )
    looked_at = looked_at_by(evidence, scene)
    lines = strongest_lines(train(stream), list(map(train, pilot)), scene)
    lamps = lamps_of(
        lines, train(stream), declared, lambda lit: train(simulator.stream(lit, _LAMP_SEED))
    )
    return Hints(
        evidence.seconds,
        tuple(lamps),
        tick_of(stream.t),
        evidence.encoding,
        service_times(stream),
        readouts_of(looked_at, evidence.times_s),
        None if own_period else pulse_of(looked_at, evidence.times_s, evidence.before_s),
        own_period,
        too_many,
    )


def looked_at_by(evidence: Evidence, scene: Scene) -> Stream:
    """Return the events that tell what happens at each frame: all but those looked at once."""
    return scene.split.chosen(evidence.stream, splits.TRAIN, splits.VALIDATION)


def _too_many(stream: Stream, pilot: Sequence[Stream], polarity: int) -> float:
    """Return how many events of a polarity simulations have, over those of a stream."""
    made = float(np.mean([np.count_nonzero(one.on == polarity) for one in pilot]))
    return (made + 1.0) / (float(np.count_nonzero(stream.on == polarity)) + 1.0)
