"""Comparator of the twin: thresholds, dead time, leak and injected events along straight lines."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from reference.circuit import Array, Circuit, Draws


class Line(NamedTuple):
    """Straight line of every pixel's signal, with the unfiltered light; (pixels,) arrays.

    start, end [s]; signal_start, signal_end [ln units]; light_start, light_end [DN]; noise_start,
    noise_end: what of the signal is noise [ln units].
    """

    start: float
    end: float
    signal_start: Array
    signal_end: Array
    light_start: Array
    light_end: Array
    noise_start: Array
    noise_end: Array


class Moves(NamedTuple):
    """How far each of them has moved the comparator since the reset, upwards [ln units].

    An injected event has none of them, but NaN.
    """

    light: float
    leak: float
    noise: float


INJECTED = Moves(math.nan, math.nan, math.nan)


class Comparator:
    """References, dead times and injected events of all pixels, along lines of the signal."""

    def __init__(self, line: Line, circuit: Circuit, draws: Draws, tie: float) -> None:
        first = line.signal_start
        pixels = len(first)
        self.circuit, self.draws, self.tie = circuit, draws, tie
        self.on, self.off = circuit.levels(pixels)
        offset = draws.reference_offset
        self.reference = first + (0.0 if offset is None else offset)
        release = draws.first_release
        self.release = np.full(pixels, -np.inf) if release is None else release.copy()
        self.injected = draws.injected or [np.empty((0, 3))] * pixels
        self.used = [0] * pixels
        self.due = np.array([c[0, 0] if len(c) else np.inf for c in self.injected])
        self.events: list[list[tuple[float, int]]] = [[] for _ in range(pixels)]
        self.moves: list[list[Moves]] = [[] for _ in range(pixels)]
        self.factor = np.array([self.leak_factor(i) for i in range(pixels)])
        # at the reset: signal without noise, noise; and what has leaked since: the offset too
        self.light_then, self.noise_then = first - line.noise_start, line.noise_start.copy()
        self.leaked = np.zeros(pixels) if offset is None else -offset

    def leak_factor(self, i: int) -> float:
        """Relative speed of the leak of pixel i after the events it has fired."""
        if self.draws.leak_factors is None:
            return 1.0
        return float(self.draws.leak_factors[i][len(self.events[i])])

    def follow(self, line: Line) -> None:
        """Fire all events on a line."""
        circuit = self.circuit
        assert np.all(np.abs(line.signal_end) < 1e4), "the update diverges"
        fall = np.zeros_like(self.reference)
        if circuit.leak_hz or circuit.photo_leak_hz:
            light = 0.5 * (line.light_start + line.light_end)
            fall = (circuit.leak_hz + circuit.photo_leak_hz * light / 255) * self.on
        drop = fall * self.factor * (line.end - line.start)
        high = np.maximum(line.signal_start, line.signal_end)
        low = np.minimum(line.signal_start, line.signal_end)
        busy = (high + drop - self.reference >= self.on) | (self.reference - low >= self.off)
        busy |= (self.release >= line.start) | (self.due < line.end)
        busy &= self.release < line.end
        self.reference[~busy] -= drop[~busy]
        self.leaked[~busy] += drop[~busy]
        for i in np.flatnonzero(busy):
            self.follow_one(int(i), float(fall[i]), line)

    def follow_one(self, i: int, fall: float, line: Line) -> None:
        """Fire the events of pixel i on a line; fall: of its reference a second, nominal."""
        t, end = line.start, line.end
        za, slope_z = line.signal_start[i], 0.0
        if end > t:
            slope_z = (line.signal_end[i] - za) / (end - t)
        reference = self.reference[i]
        leaked_from = t
        while self.release[i] < end:
            if self.release[i] >= t:
                t = leaked_from = self.release[i]
                reference = za + slope_z * (t - line.start)
                self.release[i] = -np.inf
                self.reset(i, t, reference, line)
            distance = za + slope_z * (t - line.start) - reference
            slope = slope_z + fall * self.factor[i]
            t_cross, polarity = math.inf, 0
            if slope > 0:
                t_cross, polarity = t + (self.on[i] + self.tie - distance) / slope, 1
            elif slope < 0:
                t_cross, polarity = t + (-self.off[i] - self.tie - distance) / slope, -1
            t_cross = max(t, t_cross)
            t_noise, noise_polarity = self.next_injected(i, t, line)
            if min(t_cross, t_noise) >= end:
                break
            signal_event = t_cross <= t_noise
            if not signal_event:
                t_cross, polarity = t_noise, noise_polarity
                self.used[i] += 1
            reference -= fall * self.factor[i] * (t_cross - t)
            t = t_cross
            self.leaked[i] += fall * self.factor[i] * (t - leaked_from)
            leaked_from = t
            self.events[i].append((t, polarity))
            signal = za + slope_z * (t - line.start)
            self.moves[i].append(self.moved(i, t, signal, line) if signal_event else INJECTED)
            self.reset(i, t, signal, line)
            self.factor[i] = self.leak_factor(i)
            if self.circuit.dead_time_us is not None:
                self.release[i] = t + self.circuit.dead_time_us * 1e-6
            elif signal_event:
                reference += self.on[i] if polarity > 0 else -self.off[i]
            else:
                reference = za + slope_z * (t - line.start)
        self.reference[i] = reference - fall * self.factor[i] * (end - t)
        self.leaked[i] += fall * self.factor[i] * (end - leaked_from)
        waiting = self.injected[i][self.used[i] :]
        self.due[i] = waiting[0, 0] if len(waiting) else math.inf

    def noise_at(self, i: int, t: float, line: Line) -> float:
        """Return the noise in the signal of pixel i on a line."""
        share = (t - line.start) / (line.end - line.start)
        return float(line.noise_start[i] + (line.noise_end[i] - line.noise_start[i]) * share)

    def moved(self, i: int, t: float, signal: float, line: Line) -> Moves:
        """Return what has moved pixel i since its reset."""
        noise = self.noise_at(i, t, line)
        light = signal - noise - self.light_then[i]
        return Moves(float(light), float(self.leaked[i]), noise - float(self.noise_then[i]))

    def reset(self, i: int, t: float, signal: float, line: Line) -> None:
        """Take notice of a reset of pixel i."""
        self.noise_then[i] = self.noise_at(i, t, line)
        self.light_then[i] = signal - self.noise_then[i]
        self.leaked[i] = 0.0

    def next_injected(self, i: int, t: float, line: Line) -> tuple[float, int]:
        """Time and polarity of the next injected event in [t, end) that the light keeps."""
        candidates = self.injected[i]
        found = (math.inf, 0)
        while self.used[i] < len(candidates):
            at, uniform, polarity = candidates[self.used[i]]
            if at >= line.end:
                break
            share = (at - line.start) / (line.end - line.start)
            light = line.light_start[i] + (line.light_end[i] - line.light_start[i]) * share
            kept = uniform < 1 - 0.75 * light / 255
            if at >= t and kept:
                found = (float(at), int(polarity))
                break
            self.used[i] += 1
        return found
