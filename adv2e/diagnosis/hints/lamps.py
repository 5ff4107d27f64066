"""Lamps that a recording may have been lit by: lines in its rate, and the phase each would have."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from adv2e.config import Config
from adv2e.diagnosis.data.stream import Stream
from adv2e.diagnosis.fitting.keys import with_keys

Array = NDArray[np.float64]
Swing = NDArray[np.complex128]

_DEPTHS = (0.05, 0.1, 0.2, 0.3, 0.45)
_NEAR = 0.005

_PARTS = 32
_TRIED = 129
_TURNS = 0.5
"""Most by which a line may be off, in turns over the recording: more than the peak's grid is."""


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
    so that the phase can be read off the measured events; and the frequency, to a small part of a
    turn over the recording, as the one that both keep time with from end to end.  What swings
    without a lamp is taken off: motion may, and what is made up between frames does so at multiples
    of their rate.

    Parameters
    ----------
    lines_hz : sequence of float
        The strongest first.
    measured : Stream
    declared : Config
    simulate : callable
        Makes the stream of a configuration.
    """
    if not lines_hz:
        return []
    unlit = simulate(declared)
    clock = _Clock.of(measured)
    lamps: list[Lamp] = []
    for hz in lines_hz:
        if any(_is_multiple(hz, lamp.hz) for lamp in lamps):
            continue
        far = Lamp(hz)
        idle = clock.swing(unlit, far.hz)
        seen = clock.swing(measured, far.hz) - idle
        streams = [simulate(_lit(declared, far, depth)) for depth in _DEPTHS]
        lit = np.array([clock.swing(stream, far.hz) - idle for stream in streams])
        size, sizes = abs(seen.sum()), np.abs(lit.sum(axis=1))
        depth = float(np.interp(size, np.maximum.accumulate(sizes), _DEPTHS))
        near = clock.ahead(far, seen * np.conj(lit[np.argmin(np.abs(sizes - size))]))
        # how much comes back, and when, hangs on depth and phase: once more, from nearby
        idle = clock.swing(unlit, near.hz)
        seen = clock.swing(measured, near.hz) - idle
        lit_near = clock.swing(simulate(_lit(declared, near, depth)), near.hz) - idle
        lamps.append(clock.ahead(near, seen * np.conj(lit_near)))
    return lamps


@dataclass(frozen=True)
class _Clock:
    """Parts of the time, of which each tells a phase.

    Attributes
    ----------
    edges_us : (parts + 1,)
    """

    edges_us: Array

    @classmethod
    def of(cls, stream: Stream) -> _Clock:
        """Return as many parts as are needed, of the time that a stream lasts."""
        return cls(np.linspace(stream.t.min(), stream.t.max() + 1, _PARTS + 1))

    def swing(self, stream: Stream, hz: float) -> Swing:
        """Return how much more ON than OFF events swing, and with which phase, (parts,)."""
        part = np.searchsorted(self.edges_us, stream.t, side="right") - 1
        inside = (part >= 0) & (part < _PARTS)
        turns = np.remainder(stream.t[inside] * 1e-6 * hz, 1.0)
        swung = (2.0 * stream.on[inside] - 1.0) * np.exp(-2j * np.pi * turns)
        real = np.bincount(part[inside], swung.real, _PARTS)
        return np.asarray(real + 1j * np.bincount(part[inside], swung.imag, _PARTS))

    def ahead(self, lamp: Lamp, product: Swing) -> Lamp:
        """Return the lamp that is ahead of another, in phase and pace, as events measured are.

        Parameters
        ----------
        lamp : Lamp
        product : (parts,)
            Of the swing measured and the conjugate of the other lamp's.
        """
        middles_s = 0.5e-6 * (self.edges_us[:-1] + self.edges_us[1:])
        length_s = 1e-6 * (self.edges_us[-1] - self.edges_us[0])
        faster_hz = np.linspace(-_TURNS, _TURNS, _TRIED) / length_s
        in_step = np.exp(-2j * np.pi * np.outer(faster_hz, middles_s)) @ product
        best = int(np.argmax(np.abs(in_step)))
        phase = lamp.phase_rad + float(np.angle(in_step[best]))
        return Lamp(lamp.hz + float(faster_hz[best]), math.remainder(phase, 2.0 * math.pi))


def _lit(declared: Config, lamp: Lamp, depth: float) -> Config:
    keys = {"depth": depth, "frequency_hz": lamp.hz, "phase_rad": lamp.phase_rad}
    return with_keys(declared, {f"frames.flicker.{key}": value for key, value in keys.items()})


def _is_multiple(hz: float, of_hz: float) -> bool:
    ratio = hz / of_hz
    return bool(round(ratio) >= 1 and abs(ratio - round(ratio)) < _NEAR * ratio)
