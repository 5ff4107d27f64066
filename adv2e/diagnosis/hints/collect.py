"""What a look at a recording says of where fits may start."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from adv2e.diagnosis.data.evidence import Evidence
from adv2e.diagnosis.data.stream import Stream
from adv2e.diagnosis.hints.lamps import Lamp
from adv2e.diagnosis.hints.pulses import Pulse, pulse_of
from adv2e.diagnosis.hints.readouts import Readouts, readouts_of
from adv2e.diagnosis.hints.stamps import Service, service_times, tick_of


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
    too_many: tuple[float, float] = (1.0, 1.0)


def hints_of(
    evidence: Evidence, looked_at: Stream, lamps: Sequence[Lamp], pilot: Sequence[Stream] = ()
) -> Hints:
    """Return hints from a recording.

    Parameters
    ----------
    evidence : Evidence
        The whole of it, as how stamps follow one another shows in no part.
    looked_at : Stream
        Its events without those that are looked at last.
    lamps : sequence of Lamp
        That may have lit it.
    pilot : sequence of Stream
        Simulations of the declared model.
    """
    stream = evidence.stream
    return Hints(
        evidence.seconds,
        tuple(lamps),
        tick_of(stream.t),
        evidence.encoding,
        service_times(stream),
        readouts_of(looked_at, evidence.times_s),
        pulse_of(looked_at, evidence.times_s, evidence.before_s),
        (_too_many(stream, pilot, 1), _too_many(stream, pilot, 0)),
    )


def _too_many(stream: Stream, pilot: Sequence[Stream], polarity: int) -> float:
    """Return how many events of a polarity simulations have, over those of a stream."""
    if not pilot:
        return 1.0
    made = float(np.mean([np.count_nonzero(one.on == polarity) for one in pilot]))
    return (made + 1.0) / (float(np.count_nonzero(stream.on == polarity)) + 1.0)
