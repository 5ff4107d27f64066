"""Steps of the stepped solver, and what is added to the pixels at them.

How long a step of ``exact`` may be follows from what :mod:`adv2e.kernel.stepped.signal` leaves out.
The cubic through values and slopes at both ends of a step of h departs from the signal by at most
h^4 y''''/384, for a lag u behind a corner w by u (w h)^4/384; as the signal moves by u w, that is a
time of h (w h)^3/384: 0.03 us at the longest step and w h = 1/2, its limit with one pole.  The
change c of the corner over the step counts in second order, terms of c (w h)^2.  Steps end where x
bends, at the frames; where the light passes the knee of the log map within a step, its slope bends
there, which leaves some 0.1 us.  Where a slew limit sets in or ends, its curvature leaps: an event
of that step may be off by h (w h)/13 (1.15 us were found at w h = 0.15), so that steps are shorter
with it, for 0.3 us.  Leak is a cubic, noise and courses are lines within each step: they are as
good as ``step_us`` resolves them.  Behind a second pole or a high-pass events may come where the
signal creeps, and what it lacks is many times that in time: steps are half as long (at w h = 1/2,
one event of 50 was 5 us off; 0.8 us at 1/4).  Against dense solutions of the circuit all times
agree within 1 us, most within 0.05 us.

Photoreceptor noise is drawn at each step here, so in every pixel at most
``photoreceptor_noise.step`` of the correlation time at white apart.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from adv2e.effects.composition import COURSES, course, injected, longest_step_us, overrides
from adv2e.effects.hooks import LONGEST_US, Hooks
from adv2e.effects.pixel.threshold_drift import drift_factors
from adv2e.kernel.inputs import EXACT, Circuit, FrameStack, fastest_corner
from adv2e.kernel.stepped.driver import BLOCK, Run
from adv2e.kernel.stepped.events import Injected, injected_of
from adv2e.light.intervals import Part

_Planned = tuple[Run, Injected]

_SHARE, _SHARE_OF_TWO = 0.5, 0.25
"""Longest step as a share of the shortest time constant, of one pole and of two."""

_BEND_US = 4.0
"""Longest step squared times the corner [us], with a slew limit: events of the step in which that
sets in or ends are off by up to a thirteenth of it."""

_FEWEST, _SHORT_US = 4, 10.0
"""Steps of an interval, unless they are shorter than this: the light may grow by e-folds in it."""

_VALUES = 1 << 22
"""Values of a course that are in memory at a time, unless one block of steps has more."""

_NONE = np.zeros((0, 1))
_NO_INDEX = np.zeros(0, np.int64)
NOTHING = Injected(np.zeros(0), np.zeros(0, np.bool_), _NO_INDEX, _NO_INDEX)
"""No events from outside."""


_WHITE = 255.0


class Coarseness(NamedTuple):
    """Factors on the longest steps that are precise enough, as far as steps stay stable.

    Attributes
    ----------
    solved : float
        For the circuit.
    added : float
        For what is added at the steps, and the noise drawn there: leaps are spread, and the fastest
        part of the noise is lost.
    """

    solved: float = 1.0
    added: float = 1.0


PRECISE = Coarseness()
"""Steps as short as all need."""


def steps_of(
    length_us: float,
    circuit: Circuit,
    step_us: float = math.inf,
    brightest: float = _WHITE,
    coarseness: Coarseness = PRECISE,
) -> int:
    """Return the number of steps that ``exact`` makes of a straight piece of x.

    `step_us` is the longest step that resolves the added courses, `brightest` the light in the
    piece if it is above white [DN].
    """
    solved, added = coarseness
    # without a pole the signal is a line, and so is a leak that does not follow the light
    creeps = max(circuit.follower, circuit.high)
    curved = circuit.filtered or max(creeps, circuit.slew, circuit.photo_leak) > 0.0
    if not curved and step_us == math.inf:
        return 1
    limit = min(solved * LONGEST_US, added * step_us)
    fastest = fastest_corner(circuit, max(brightest, _WHITE))
    share = min(_SHARE, solved * _SHARE_OF_TWO) if creeps > 0.0 else _SHARE
    if circuit.filtered:
        limit = min(limit, share / fastest if fastest > 0 else limit)
        if circuit.noise_rms > 0.0:
            drawn = added * circuit.noise_step
            limit = min(limit, drawn / fastest if fastest > 0 else limit)
    if circuit.slew > 0.0 and fastest > 0.0:
        limit = min(limit, solved * math.sqrt(_BEND_US / fastest))
    if creeps > 0.0:
        limit = min(limit, share / creeps)
    few = min(_FEWEST, math.ceil(length_us / _SHORT_US))
    # where the light overshoots, up to 4 us were found
    return max(1, few, math.ceil(length_us / limit)) * (2 if circuit.printed else 1)


class Stepping:
    """Runs of the stepped solver through a recording.

    Parameters
    ----------
    pixels : int
        Those that are advanced: the first so many.
    hooks : sequence of Hooks
        Effects that act inside the pixel.
    drift_per_s : float
        Of the thresholds.
    origin_us : int
        Time that the pixel array counts from, on the recording's clock.
    start_us : float
        Time of the first frame, from there.
    """

    def __init__(
        self, circuit: Circuit, pixels: int, columns: int, hooks: Sequence[Hooks],
        drift_per_s: float, origin_us: int, start_us: float, coarseness: Coarseness = PRECISE,
    ) -> None:  # fmt: skip
        self._circuit, self._pixels, self._columns = circuit, pixels, columns
        self._hooks = hooks
        self._drift, self._origin, self._start = drift_per_s, origin_us, start_us
        self._coarseness = coarseness
        at = np.array([start_us])
        widths = (self._course(name, at).shape[1] for name in COURSES)
        self._width = sum(width for width in widths if width > 1)

    def first_driven(self, x: NDArray[np.float64]) -> NDArray[Any]:
        """Return the input of the poles at the first frame, of log intensity `x` (pixels,)."""
        at, circuit = np.array([self._start]), self._circuit
        gain = self._course("gain", at)
        if gain.size:
            light = gain[0] * np.where(x < circuit.knee, x * circuit.slope, np.exp(x))
            foot = light < math.exp(circuit.knee)
            below = light / (circuit.slope or 1.0)
            x = np.where(foot, below, np.log(np.where(foot, 1.0, light)))
        return np.asarray(x + _at_first(self._course("drive", at)))

    def first_light(self, light: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the light on the pixels at the first frame [DN], with the gain of effects."""
        gain = self._course("gain", np.array([self._start]))
        return gain[0] * light if gain.size else light

    def first_level(self, name: str) -> NDArray[Any]:
        """Return the factor on the thresholds `name` at the first frame, (1,) or (pixels,)."""
        factors = self._factors(name, np.array([self._start]))
        return factors[0] if factors.size else np.ones(1)

    def first_signal(self) -> NDArray[Any]:
        """Return the addition to the signal at the first frame, (1,) or (pixels,)."""
        return _at_first(self._course("signal", np.array([self._start])))

    def runs(
        self, part: Part, frames: FrameStack, starts: NDArray[np.float64]
    ) -> Iterator[_Planned]:
        """Yield the runs over the intervals of a part, and the events that are injected in each.

        `starts` are the ends of the intervals since the origin [us].  Raises ConfigError where
        thresholds drift to zero.
        """
        circuit = self._circuit
        lengths = np.diff(starts)
        pieces = circuit.steps if circuit.update != EXACT or circuit.printed else 1
        exact = circuit.update == EXACT
        steps = np.ones(lengths.size, np.int64)
        brightest = np.zeros(lengths.size)
        if exact:
            brightest, ends_s = _brightest(part, frames, lengths.size), self._seconds(starts)
            for f, length in enumerate(lengths):
                step_us = longest_step_us(self._hooks, float(ends_s[f]), float(ends_s[f + 1]))
                steps[f] = steps_of(
                    length / pieces, circuit, step_us, float(brightest[f]), self._coarseness
                )
        for first, first_step, stop, stop_step in self._cuts(pieces, steps):
            times = _instants(starts, pieces * steps, first, first_step, stop, stop_step)
            run = Run(
                first=first, first_step=first_step, last=stop, last_step=stop_step, pieces=pieces,
                steps=steps, brightest=brightest, gain=self._course("gain", times),
                drive=self._course("drive", times), signal=self._course("signal", times),
                on=self._factors("on", times), off=self._factors("off", times),
            )  # fmt: skip
            yield run, self._injected(times[0], times[-1])

    def _cuts(self, pieces: int, steps: NDArray[np.int64]) -> Iterator[tuple[int, int, int, int]]:
        """Yield first interval and step, and those before which they end, of runs of blocks."""
        most = max(1, _VALUES // max(1, self._width))
        begin, taken, border = (0, 0), 0, (0, 0)
        for f, of_piece in enumerate(steps.tolist()):
            for start, stop in _blocks(pieces, of_piece):
                if taken and taken + stop - start > most:
                    yield (*begin, *border)
                    begin, taken = (f, start), 0
                taken += stop - start
                border = (f + 1, stop)
        yield (*begin, *border)

    def _course(self, name: str, times: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return a course at times since the origin [us], without rows if there is none."""
        values = course(self._hooks, name, self._seconds(times))
        return _NONE if values is None else np.ascontiguousarray(values[:, : self._pixels])

    def _factors(self, name: str, times: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the factors on a threshold, drift and course together."""
        factors = self._course(name, times)
        if self._drift == 0.0:
            return factors
        drift = drift_factors((times - self._start) * 1e-6, self._drift)[:, None]
        return drift * factors if factors.size else drift

    def _injected(self, t0_us: float, t1_us: float) -> Injected:
        if not any(overrides(hook, "inject") for hook in self._hooks):
            return NOTHING
        t0, t1 = (float(t) for t in self._seconds(np.array([t0_us, t1_us])))
        found = injected(self._hooks, t0, t1)
        pixels = found["y"].astype(np.int64) * self._columns + found["x"]
        # seconds and back: rounding must not take an event out of its run
        at = np.clip(found["t"] * 1e6 - self._origin, t0_us, np.nextafter(t1_us, -math.inf))
        return injected_of(at, pixels, found["p"] > 0, self._pixels)

    def _seconds(self, times: NDArray[np.float64]) -> NDArray[np.float64]:
        return (times + self._origin) * 1e-6


def _brightest(part: Part, frames: FrameStack, intervals: int) -> NDArray[np.float64]:
    """Return the brightest light of each interval, of all frames that count there [DN]."""
    if frames.coded:
        return np.full(intervals, float(frames.table.max()))
    peaks = frames.light.max(axis=1).tolist()
    at = [
        max(peaks[b + 1], peaks[b] if share < 1 else 0.0)
        for b, share in zip(part.before.tolist(), part.share.tolist(), strict=True)
    ]
    return np.array([max(a, b) for a, b in itertools.pairwise(at[: intervals + 1])], np.float64)


def _at_first(values: NDArray[np.float64]) -> NDArray[Any]:
    return values[0] if values.size else np.zeros(1)


def _blocks(pieces: int, steps: int) -> Iterator[tuple[int, int]]:
    """Yield the blocks of an interval: first step, and the one after the last."""
    if steps == 1:
        for start in range(0, pieces, BLOCK):
            yield start, min(start + BLOCK, pieces)
        return
    for piece in range(pieces):
        for start in range(0, steps, BLOCK):
            yield piece * steps + start, piece * steps + min(start + BLOCK, steps)


def _instants(
    starts: NDArray[np.float64], totals: NDArray[np.int64], first: int, first_step: int, stop: int,
    stop_step: int,
) -> NDArray[np.float64]:  # fmt: skip
    """Return the start of a run and the end of each of its steps, since the origin [us]."""
    parts = []
    for f in range(first, stop):
        total = int(totals[f])
        low = first_step if f == first else 0
        high = stop_step if f == stop - 1 else total
        steps = np.arange(low if f == first else 1, high + 1)
        parts.append(starts[f] + (starts[f + 1] - starts[f]) * (steps / total))
    return np.concatenate(parts)
