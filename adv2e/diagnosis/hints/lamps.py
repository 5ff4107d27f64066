"""Lamps that a recording may have been lit by: lines in its rate, and the phase each would have."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.config import Config
from adv2e.diagnosis.configurations import with_keys
from adv2e.diagnosis.data.scene import Scene
from adv2e.diagnosis.data.splits import Stream
from adv2e.diagnosis.statistics.spectrum import BIN_US, keeps_time, prominence

Array = NDArray[np.float64]
Swing = NDArray[np.complex128]

_LOWEST_HZ = 30.0
_LEAST_BINS = 16
_PADDING = 8
_BESIDE = 16 * _PADDING
_MOST = 2
_APART_HZ, _SAME_HZ = 5.0, 2.0

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


def strongest_lines(stream: Stream, pilot: Sequence[Stream], scene: Scene) -> tuple[float, ...]:
    """Return the frequencies [Hz] of the lines of a stream that stand out of simulations' lines.

    At least the strongest one is returned, whatever it is worth; none if the recording is too short
    to have any.  What keeps time with the frames is a line in simulations, too, for what happens
    between frames is made up: there a line must stand out of theirs at the same frequency.
    """
    start = scene.times_us[0]
    bins = int((scene.times_us[-1] - start) // BIN_US)
    if bins < _LEAST_BINS or not pilot:
        return ()
    hz = np.fft.rfftfreq(_PADDING * bins, BIN_US * 1e-6)
    above = hz > _LOWEST_HZ
    hz = hz[above]

    def heights(one: Stream) -> Array:
        """Return the prominence of spectral lines: of all events, and of ON less OFF."""
        step = np.minimum((one.t - start) // BIN_US, bins - 1).astype(np.int64)
        signs = np.ones(len(one)), 2.0 * one.on - 1.0
        binned = (np.bincount(step, sign, minlength=bins) for sign in signs)
        return np.array([prominence(rate, _BESIDE, _PADDING)[above] for rate in binned])

    measured, simulated = heights(stream), [heights(one) for one in pilot]
    if not hz.size:
        return ()
    locked = np.broadcast_to(keeps_time(hz, scene), measured.shape)
    usual = max((top for one in simulated for _, top in _peaks(hz, one, ~locked)), default=0.0)
    stands_out = locked & (measured > np.maximum(np.max(simulated, axis=0), usual))
    found = [*_peaks(hz, measured, ~locked), *_peaks(hz, measured, stands_out)]
    found.sort(key=lambda line: -line[1])
    return tuple(line for k, (line, height) in enumerate(found) if k == 0 or height > usual)


def _peaks(hz: NDArray[Any], height: Array, where: NDArray[np.bool_]) -> list[tuple[float, float]]:
    """Return frequency and height of the strongest lines there, the strongest first."""
    found: list[tuple[float, float]] = []
    for row in np.where(where, height, -np.inf):
        for _ in range(_MOST):
            best = int(np.argmax(row))
            if np.isneginf(row[best]):
                break
            line = float(hz[best]), float(row[best])
            same = [k for k, (other, _) in enumerate(found) if abs(other - line[0]) <= _SAME_HZ]
            if not same:
                found.append(line)
            elif line[1] > found[same[0]][1]:  # it stands out more of ON less OFF
                found[same[0]] = line
            row[np.abs(hz - hz[best]) < _APART_HZ] = -np.inf
    return sorted(found, key=lambda line: -line[1])


def lamps_of(
    lines_hz: Sequence[float],
    measured: Stream,
    declared: Config,
    simulate: Callable[[Config], Stream],
) -> list[Lamp]:
    """Return a lamp for each line, the strongest first, that is no multiple of a stronger one.

    A lamp's swing comes back in the difference of ON and OFF events, later by what the pixel's
    poles make of it.  A simulation with a lamp of phase zero, about as deep, tells how much it is,
    so that the phase can be read off the measured events; and the frequency, to a small part of a
    turn over the recording, as the one that both keep time with from end to end.  What swings
    without a lamp is taken off: motion may, and what is made up between frames does so at multiples
    of their rate.
    """
    if not lines_hz:
        return []
    unlit = simulate(declared)
    edges_us = np.linspace(measured.t.min(), measured.t.max() + 1, _PARTS + 1)
    lamps: list[Lamp] = []
    for hz in lines_hz:
        if any(_is_multiple(hz, lamp.hz) for lamp in lamps):
            continue
        idle = _swing(unlit, hz, edges_us)
        seen = _swing(measured, hz, edges_us) - idle
        streams = [simulate(_lit(declared, Lamp(hz), depth)) for depth in _DEPTHS]
        lit = np.array([_swing(stream, hz, edges_us) - idle for stream in streams])
        size, sizes = abs(seen.sum()), np.abs(lit.sum(axis=1))
        depth = float(np.interp(size, np.maximum.accumulate(sizes), _DEPTHS))
        nearest = lit[np.argmin(np.abs(sizes - size))]
        near = _ahead(Lamp(hz), seen * np.conj(nearest), edges_us)
        # how much comes back, and when, hangs on depth and phase: once more, from nearby
        idle = _swing(unlit, near.hz, edges_us)
        seen = _swing(measured, near.hz, edges_us) - idle
        lit_near = _swing(simulate(_lit(declared, near, depth)), near.hz, edges_us) - idle
        lamps.append(_ahead(near, seen * np.conj(lit_near), edges_us))
    return lamps


def _swing(stream: Stream, hz: float, edges_us: Array) -> Swing:
    """Return the Fourier sum at `hz` of ON less OFF events in each part of the time, complex."""
    part = np.searchsorted(edges_us, stream.t, side="right") - 1
    inside = (part >= 0) & (part < _PARTS)
    turns = np.remainder(stream.t[inside] * 1e-6 * hz, 1.0)
    swung = (2.0 * stream.on[inside] - 1.0) * np.exp(-2j * np.pi * turns)
    real, imaginary = (np.bincount(part[inside], of, _PARTS) for of in (swung.real, swung.imag))
    return np.asarray(real + 1j * imaginary)


def _ahead(lamp: Lamp, product: Swing, edges_us: Array) -> Lamp:
    """Return the lamp that is ahead of another, in phase and pace, as events measured are.

    `product`: (parts,) of the swing measured and the conjugate of the other lamp's.
    """
    middles_s = 0.5e-6 * (edges_us[:-1] + edges_us[1:])
    length_s = 1e-6 * (edges_us[-1] - edges_us[0])
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
