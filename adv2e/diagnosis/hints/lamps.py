"""Lamps that a recording may have been lit by: lines in its rate, and the phase each would have."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from adv2e.config import Config
from adv2e.diagnosis.configurations import with_keys
from adv2e.diagnosis.data.scene import Scene
from adv2e.diagnosis.data.stream import Stream
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


# ---- Timestamp resolution and arbiter times from the timestamps, where fits of the readout start.
#
# Fits do not find the times of an arbiter by steps from anywhere: timestamps of a busy channel
# form a comb, and a comb of other times is as far from it as none.


_STAMPS = 20
_ON_TICK = 0.99

_LEAST_US = 3
"""Least time of a row that stands out from stamps of whole microseconds."""
_LONGEST_US = 20_000
_RARELY = 0.01
_STANDS_OUT = 2.0
_NOTHING_NS = 20.0
_ROUNDS = 10

_SD_NS = 50.0
"""Standard deviation of an event's time where gaps are spread as no single time makes them."""
_SD_OF_BOTH_NS, _SD_OF_CHANCE_NS = 5.0, 120.0
"""Of both times together beside their chance, and more by the share of what comes by chance."""


class Service(NamedTuple):
    """Times that an event and the selection of a row take [ns], and their standard deviations."""

    event_ns: float
    row_ns: float
    event_sd_ns: float
    row_sd_ns: float


def tick_of(times_us: NDArray[np.int64]) -> int:
    """Return the largest time of which nearly all stamps are multiples [us].

    Of the times themselves, not of differences: ticks count from zero.  Of few stamps at a time, so
    that one which is wrong does not decide.
    """
    if len(times_us) < _STAMPS:
        return max(1, int(np.gcd.reduce(times_us))) if len(times_us) else 1
    groups = times_us[: len(times_us) // _STAMPS * _STAMPS].reshape(_STAMPS, -1)
    steps, often = np.unique(np.gcd.reduce(groups, axis=0), return_counts=True)
    step = max(1, int(steps[np.argmax(often)]))
    return step if np.mean(times_us % step == 0) >= _ON_TICK else 1


def service_times(stream: Stream) -> Service | None:
    """Return the times that an event and the selection of a row seem to take.

    An arbiter (:mod:`adv2e.effects.readout.arbiter`) lets no two events of different rows out in
    less than the time of both, and what waits for it leaves just that time later.  None where
    stamps do not look so.
    """
    row, column = np.divmod(stream.pixel.astype(np.int64), stream.width)
    gap, down, right = np.diff(stream.t), np.diff(row), np.diff(column)
    between_rows = gap[(down != 0) & (gap < _LONGEST_US)]
    often = np.bincount(between_rows, minlength=_LONGEST_US + 10)
    both_us = int(np.argmax(often))
    if both_us < _LEAST_US or often[both_us] < _STANDS_OUT * often[both_us + 2 : both_us + 6].max():
        return None
    if often[: both_us - 1].sum() > _RARELY * len(between_rows):
        return None
    both_ns, both_sd_ns = _of_both(often, both_us)
    latched = gap[(down == 0) & (right > 0) & (gap < both_us - 1)]
    event_ns, event_sd_ns = _of_an_event(latched, both_ns)
    row_sd_ns = float(np.hypot(event_sd_ns, both_sd_ns))
    return Service(event_ns, max(both_ns - event_ns, _NOTHING_NS), event_sd_ns, row_sd_ns)


def _of_an_event(latched: NDArray[np.int64], both_ns: float) -> tuple[float, float]:
    """Return the time that an event takes, and its standard deviation [ns].

    From the gaps between events that were latched together: each is that time, less or more what
    makes whole microseconds of it.
    """
    count = len(latched)
    if count == 0:
        return _NOTHING_NS, both_ns  # whatever it is
    mean = float(latched.mean())
    least = int(mean)
    if np.mean((latched == least) | (latched == least + 1)) < 1.0 - _RARELY:
        usual = int(np.argmax(np.bincount(latched)))
        near = latched[np.abs(latched - usual) <= 1]  # not beside what was lost
        return max(1e3 * float(near.mean()), _NOTHING_NS), _SD_NS
    # of those that are the longer ones; where none is seen, there may be one in as many again
    longer = ((mean - least) * count + 1.0) / (count + 2.0)
    return max(1e3 * mean, _NOTHING_NS), 1e3 * float(np.sqrt(longer * (1.0 - longer) / count))


def _of_both(often: NDArray[np.int64], about_us: int) -> tuple[float, float]:
    """Return the time that what had waited follows in, and its standard deviation [ns].

    Nothing follows sooner, and what comes by chance does so from there on, ever less often; both
    stamps have lost their parts of a microsecond, which spreads a gap over two of them.  `often`:
    how often each gap is [us], of which `about_us` is the most frequent one.
    """
    near = about_us + np.arange(-1, 2)
    soon, later = (float(often[about_us + k : about_us + k + 4].mean()) for k in (2, 6))
    fading = min(max(soon / max(later, 1.0), 1.0), _STANDS_OUT) ** 0.25
    chance = soon * fading ** (about_us + 3.5 - near)
    both = float(about_us)
    for _ in range(_ROUNDS):
        after = np.clip(near - both, -1.0, 1.0)
        whole = np.where(after < 0.0, 0.5 * (1.0 + after) ** 2, 1.0 - 0.5 * (1.0 - after) ** 2)
        waited = np.maximum(often[near] - chance * whole, 0.0)
        both = float(np.average(near, weights=waited))
    counted = float(often[near].sum())
    sd = np.hypot(500.0 / np.sqrt(counted), _SD_OF_BOTH_NS + _SD_OF_CHANCE_NS * soon / counted)
    return 1e3 * both, float(sd)
