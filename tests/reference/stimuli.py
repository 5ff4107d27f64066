"""Inputs for the reference solvers: light [DN] at knots (knots, pixels) and their times [s]."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from reference.circuit import Array

FRAME_RATES = (10.0, 24.0, 240.0, 1000.0)
"""Frame rates at which the pixel is checked [Hz]."""


class Stimulus(NamedTuple):
    """Light of each pixel at the (interpolated) frames.

    light : (knots, pixels) [DN]; times : (knots,) [s]
    """

    light: Array
    times: Array


def clock(knots: int, fps: float, L: int) -> Array:
    """Times [s] of interpolated frames."""
    return np.arange(knots) / (fps * L)


def edge(
    low: float = 10.0,
    high: float = 255.0,
    *,
    fps: float = 24.0,
    L: int = 10,
    sub_frames: int = 1,
    before: int = 3,
    after: int = 60,
) -> Stimulus:
    """One pixel that goes from `low` to `high` DN, linearly in light, over some sub-frames.

    `before` and `after` count the sub-frames of rest.  With one sub-frame the edge is linear in
    log intensity.  high < low makes an OFF edge; 100 to 200 DN over 5 L sub-frames a slow ramp.
    """
    at = np.arange(before + sub_frames + after + 1)
    share = np.clip((at - before) / sub_frames, 0, 1)
    return Stimulus((low + (high - low) * share)[:, None], clock(len(at), fps, L))


def slow_ramp(*, fps: float = 24.0, L: int = 10) -> Stimulus:
    """One pixel that goes from 100 to 200 DN over five frames."""
    return edge(100.0, 200.0, fps=fps, L=L, sub_frames=5 * L)


def pink_texture(length: int, seed: int, low: float = 4.0, high: float = 255.0) -> Array:
    """One line of a 1/f texture that closes on itself, between `low` and `high` DN.

    The logarithm of the light has amplitudes 1/frequency and random phases.
    """
    rng = np.random.default_rng(seed)
    k = np.arange(length // 2 + 1)
    amplitude = np.where(k > 0, 1 / np.maximum(k, 1), 0)
    line = np.fft.irfft(amplitude * np.exp(2j * math.pi * rng.random(k.size)), length)
    line = (line - line.min()) / np.ptp(line)
    return low * (high / low) ** line


def texture(
    pixels: int = 40,
    frames: int = 13,
    *,
    fps: float = 24.0,
    L: int = 10,
    speed: float = 12.0,
    seed: int = 1,
    whole_dn: bool = False,
) -> Stimulus:
    """Pixels that a 1/f texture of 4096 columns passes at `speed` columns a frame.

    Frames are samples of the texture, in whole DN if so asked (as from an 8-bit camera); the L - 1
    frames between two are linear in light, as the package's linear interpolation makes them.
    """
    line = pink_texture(4096, seed)
    start = np.random.default_rng(seed + 1000).integers(0, 4096, pixels)
    where = (start + speed * np.arange(frames)[:, None]) % 4096
    light = np.interp(where, np.arange(4097), np.append(line, line[0]))
    return interpolated(np.round(light) if whole_dn else light, fps=fps, L=L)


def interpolated(frames: Array, *, fps: float, L: int) -> Stimulus:
    """Put L - 1 frames, linear in light, between each two of `frames` (frames, pixels)."""
    at = np.arange((len(frames) - 1) * L + 1) / L
    m = np.minimum(at.astype(int), len(frames) - 2)
    share = (at - m)[:, None]
    light = frames[m] + (frames[m + 1] - frames[m]) * share
    return Stimulus(light, clock(len(at), fps, L))


def blinking(
    pixels: int = 20,
    frames: int = 13,
    *,
    fps: float = 24.0,
    L: int = 10,
    hold: int = 1,
    darkest: int = 1,
    seed: int = 1,
) -> Stimulus:
    """Pixels that jump between three whole grey levels and often come back to their first one.

    Each level drawn stays for `hold` of the frames.  Made for exact ties: a pixel that returns to
    its first value comes back to its first reference and, in exact arithmetic, never reaches it.
    """
    rng = np.random.default_rng(seed)
    levels = rng.integers(darkest, 256, (3, pixels))
    choice = rng.integers(0, 3, (-(-frames // hold), pixels))
    choice[0] = 0
    frames_dn = np.take_along_axis(levels, choice, axis=0).astype(np.float64)
    return interpolated(np.repeat(frames_dn, hold, axis=0)[:frames], fps=fps, L=L)


def side_by_side(*stimuli: Stimulus) -> Stimulus:
    """Join stimuli of one clock into one with all their pixels; shorter ones rest at their end."""
    longest = max(stimuli, key=lambda s: len(s.times))
    padded = []
    for light, times in stimuli:
        assert np.array_equal(times, longest.times[: len(times)]), "different clocks"
        padded.append(np.pad(light, ((0, len(longest.times) - len(times)), (0, 0)), mode="edge"))
    return Stimulus(np.hstack(padded), longest.times)


def standard(fps: float, *, L: int = 10, pixels: int = 40, frames: int = 13) -> Stimulus:
    """Edges both ways, at once and over a frame, slow ramp, moving texture: `pixels` + 5 pixels."""
    return side_by_side(
        edge(10.0, 255.0, fps=fps, L=L),
        edge(255.0, 10.0, fps=fps, L=L),
        edge(10.0, 255.0, fps=fps, L=L, sub_frames=L),
        edge(255.0, 10.0, fps=fps, L=L, sub_frames=L),
        slow_ramp(fps=fps, L=L),
        texture(pixels, frames, fps=fps, L=L),
    )
