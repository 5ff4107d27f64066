"""Lamps that a recording may have been lit by: lines in its rate, and the phase each would have."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from adv2e.config import Config
from adv2e.diagnosis.keys import with_keys
from adv2e.diagnosis.stream import Stream

_DEPTHS = (0.05, 0.1, 0.2, 0.3, 0.45)
_NEAR = 0.005


@dataclass(frozen=True)
class Lamp:
    """A line in the rate that a lamp may make: its frequency, and the phase that it would have."""

    hz: float
    phase_rad: float = 0.0


def lamps_of(
    lines_hz: Sequence[float],
    measured: Stream,
    declared: Config,
    simulate: Callable[[Config], Stream],
) -> list[Lamp]:
    """Return a lamp for each line that is no multiple of a stronger one.

    A lamp's swing comes back in the difference of ON and OFF events, later by what the pixel's
    poles make of it.  A simulation with a lamp of phase zero, about as deep, tells how much it is,
    so that the phase can be read off the measured events.  What swings without a lamp is taken off:
    motion may, and what is made up between frames does so at multiples of their rate.

    Parameters
    ----------
    lines_hz : sequence of float
        The strongest first.
    measured : Stream
    declared : Config
    simulate : callable
        Makes the stream of a configuration.
    """
    lamps: list[Lamp] = []
    unlit = simulate(declared) if lines_hz else measured
    for hz in lines_hz:
        if any(_is_multiple(hz, lamp.hz) for lamp in lamps):
            continue
        idle = swing(unlit, hz)
        seen = swing(measured, hz) - idle
        lit = [swing(simulate(_lit(declared, hz, depth)), hz) - idle for depth in _DEPTHS]
        alike = min(lit, key=lambda one: abs(abs(one) - abs(seen)))
        lamps.append(Lamp(hz, float(np.angle(seen * np.conj(alike)))))
    return lamps


def _lit(declared: Config, hz: float, depth: float) -> Config:
    lamp = {"depth": depth, "frequency_hz": hz, "phase_rad": 0.0}
    return with_keys(declared, {f"frames.flicker.{key}": value for key, value in lamp.items()})


def swing(stream: Stream, hz: float) -> complex:
    """Return how much more ON than OFF events swing with a frequency, and with which phase."""
    sign = 2.0 * stream.on - 1.0
    return complex(np.sum(sign * np.exp(-2j * np.pi * np.remainder(stream.t * 1e-6 * hz, 1.0))))


def _is_multiple(hz: float, of_hz: float) -> bool:
    ratio = hz / of_hz
    return bool(round(ratio) >= 1 and abs(ratio - round(ratio)) < _NEAR * ratio)
