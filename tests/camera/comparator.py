r"""Events of all pixels in one time step, on which signal and reference are straight lines.

A pixel fires ON when signal - reference reaches its ON threshold, OFF when it falls to minus its
OFF threshold; the time is interpolated within the step.  Each event, whatever its cause, starts the
dead time, in which nothing fires and noise events are lost; at its end the reference is the signal.
Without dead time the reference moves by the threshold (signal) or to the signal (noise events).

Reset overshoot: the charge that the reset switch injects carries the new reference on in the
event's direction, by eps times that threshold.  Leak: the reference falls by the rate times the
pixel's ON threshold a second, so that a pixel at rest fires ON at that rate; with jitter the speed
is drawn anew after each event, as 1/(1 + jitter g).

Sources: Lichtsteiner, Posch, Delbruck, "A 128x128 120 dB 15 us latency asynchronous temporal
contrast vision sensor", 2008; Nozaki, Delbruck, "Temperature and parasitic photocurrent effects in
dynamic vision sensors", 2017 (leak); Yang, Liu, Delbruck, "A dynamic vision sensor with 1 %
temporal contrast sensitivity", 2015 (charge injection at reset).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from camera.running import Running

Array = NDArray[np.float64]
Index = NDArray[np.int64]


@dataclass(frozen=True, kw_only=True)
class Rules:
    """What happens at an event.

    Attributes
    ----------
    dead : (float, float)
        Dead time after an ON and an OFF event, in steps; zeros: there is none.
    overshoot : float
        Share of the threshold by which the reference goes on.
    leak_jitter : float
        Relative deviation of the time between leak events.
    """

    dead: tuple[float, float] = (0.0, 0.0)
    overshoot: float = 0.0
    leak_jitter: float = 0.0


class Moment(NamedTuple):
    """What happens to pixels within a step: at which fraction of it, with which polarity."""

    pixel: Index
    fraction: Array
    polarity: Index


class _Step(NamedTuple):
    """Signal at both ends of a step, fall of the references in it, thresholds."""

    number: int
    before: Array
    after: Array
    fall: Array | None
    on: Array
    off: Array


class Comparator:
    """References of all pixels, and the events so far.

    Parameters
    ----------
    on, off : (pixels,)
        Thresholds [ln].
    signal : (pixels,)
        Where the references start.
    dead : (n,)
        Pixels that never fire.
    rules : Rules
    rng : Generator
        Of the leak's jitter.
    running : Running, optional
        Where the pixels are in their leak cycles; None: where these begin.
    """

    def __init__(
        self,
        on: Array,
        off: Array,
        signal: Array,
        dead: Index,
        rules: Rules,
        rng: np.random.Generator,
        running: Running | None = None,
    ) -> None:
        self._on, self._off, self._rules, self._rng = on, off, rules, rng
        self._reference = signal.copy()
        self._reference[dead] = np.nan  # compares as False with any level: held
        self._releases: dict[int, list[Moment]] = {}
        self._start = np.zeros(len(on))
        self._noise_at = np.full(len(on), np.inf)
        self._noise_left: dict[int, Moment] = {}
        self._noise_polarity = np.zeros(len(on), np.int64)
        self._distance = np.empty(len(on))
        self._beyond = np.empty((2, len(on)), np.bool_)
        self._leak_speed = np.ones(len(on))
        self._draw_leak(np.arange(len(on)))
        if running is not None:
            self._reference -= running.fallen * on
            self._leak_speed[:] = running.speed
        self._times: list[Array] = []
        self._pixels: list[Index] = []
        self._polarities: list[Index] = []

    def step(
        self,
        number: int,
        before: Array,
        after: Array,
        leak: Array | None,
        factor: float | None,
        noise: Moment,
    ) -> None:
        """Fire the events of one step.

        Parameters
        ----------
        number : int
            Of the step.
        before, after : (pixels,)
            Signal at both ends.
        leak : (pixels,) or None
            Leak events in this step at nominal speed (rate times step).
        factor : float or None
            What all thresholds are multiplied with now.
        noise : Moment
            Noise events of this step, in time order.
        """
        on, off = self._on, self._off
        fall = None
        if leak is not None:
            fall = leak * self._on
            fall *= self._leak_speed
            self._reference -= fall
        if factor is not None:
            on, off = on * factor, off * factor
        step = _Step(number, before, after, fall, on, off)
        distance = np.subtract(after, self._reference, out=self._distance)
        active = np.greater_equal(distance, on, out=self._beyond[0])
        np.negative(distance, out=distance)
        active |= np.greater_equal(distance, off, out=self._beyond[1])
        released = self._release(step)
        active[released] = True
        noisy = self._put_noise(number, noise)
        active[noisy] = True
        i = np.flatnonzero(active)
        if len(i):
            self._fire(step, i[~np.isnan(self._reference[i])])
        self._start[released] = 0.0
        self._noise_at[noisy] = np.inf

    def _release(self, step: _Step) -> Index:
        """Give the pixels whose dead time ends in this step their reference; return them."""
        ending = self._releases.pop(step.number, None)
        if ending is None:
            return np.zeros(0, np.int64)
        i = np.concatenate([part.pixel for part in ending])
        s = np.concatenate([part.fraction for part in ending])
        polarity = np.concatenate([part.polarity for part in ending])
        self._start[i] = s
        self._set_reference(step, i, s, polarity)
        return i

    def _set_reference(self, step: _Step, i: Index, s: Array, polarity: Index) -> None:
        """Put the reference of pixels `i` at the signal at fraction `s`.

        What is kept is the reference at the end of the step.
        """
        level = np.where(polarity > 0, self._on[i], self._off[i])
        reference = step.before[i] + (step.after[i] - step.before[i]) * s
        reference += self._rules.overshoot * polarity * level
        if step.fall is not None:
            reference -= step.fall[i] * (1.0 - s)
        self._reference[i] = reference

    def _put_noise(self, number: int, noise: Moment) -> Index:
        """Note the noise event of each pixel; return the pixels.

        A pixel's second noise event in one step is put off to the next: no more than one a step.
        """
        left = self._noise_left.pop(number, None)
        if left is not None:
            noise = Moment(*(np.concatenate(pair) for pair in zip(left, noise, strict=True)))
        if not len(noise.pixel):
            return noise.pixel
        pixels, first = np.unique(noise.pixel, return_index=True)
        self._noise_at[pixels] = noise.fraction[first]
        self._noise_polarity[pixels] = noise.polarity[first]
        if len(first) < len(noise.pixel):
            i, _, polarity = (np.delete(column, first) for column in noise)
            self._noise_left[number + 1] = Moment(i, np.zeros(len(i)), polarity)
        return pixels

    def _fire(self, step: _Step, i: Index) -> None:
        """Fire all events of the pixels `i` in this step, one of each pixel a round."""
        s = self._start[i]
        while len(i):
            where, polarity, level = self._next_crossing(step, i, s)
            noise = self._noise_at[i]
            noise[noise < s] = np.inf  # in the dead time: lost
            noisy = noise < where
            fires = noisy | (where <= 1.0)
            i, noisy, level = i[fires], noisy[fires], level[fires]
            s = np.where(noisy, noise[fires], where[fires])
            polarity = np.where(noisy, self._noise_polarity[i], polarity[fires])
            self._noise_at[i[noisy]] = np.inf
            self._record(step.number, i, s, polarity)
            moved = polarity * level * (1.0 + self._rules.overshoot)
            self._reference[i[~noisy]] += moved[~noisy]
            self._set_reference(step, i[noisy], s[noisy], polarity[noisy])
            self._draw_leak(i)
            i, s = self._hold(step, i, s, polarity)

    def _next_crossing(self, step: _Step, i: Index, s: Array) -> tuple[Array, Index, Array]:
        """Return where pixels `i` next cross a level from fraction `s` on, which, and the level.

        A pixel that crosses none in this step has a fraction of infinity.
        """
        start = step.before[i] - self._reference[i]
        slope = step.after[i] - step.before[i]
        if step.fall is not None:
            start -= step.fall[i]
            slope += step.fall[i]
        at_end = start + slope
        polarity = np.where(at_end >= 0.0, 1, -1)
        level = np.where(polarity > 0, step.on[i], step.off[i])
        at_s, at_end = polarity * (start + slope * s), polarity * at_end
        way = at_end - at_s
        share = (level - at_s) / np.where(way == 0.0, 1.0, way)
        share[at_s >= level] = 0.0  # beyond it already
        where = s + (1.0 - s) * np.clip(share, 0.0, 1.0)
        where[at_end < level] = np.inf
        return where, polarity, level

    def _record(self, number: int, i: Index, s: Array, polarity: Index) -> None:
        self._times.append(number + s)
        self._pixels.append(i)
        self._polarities.append(polarity)

    def _hold(self, step: _Step, i: Index, s: Array, polarity: Index) -> tuple[Index, Array]:
        """Start the dead time of pixels `i`; return those that go on in this step, and where."""
        on_dead, off_dead = self._rules.dead
        if on_dead == 0.0 == off_dead:
            return i, s
        end = s + np.where(polarity > 0, on_dead, off_dead)
        here = end < 1.0
        self._set_reference(step, i[here], end[here], polarity[here])
        later = ~here
        self._reference[i[later]] = np.nan
        ahead = np.floor(end).astype(np.int64)
        for steps in np.unique(ahead[later]).tolist():
            those = ahead == steps
            part = Moment(i[those], end[those] - steps, polarity[those])
            self._releases.setdefault(step.number + steps, []).append(part)
        return i[here], end[here]

    def _draw_leak(self, i: Index) -> None:
        if self._rules.leak_jitter:
            g = np.clip(self._rng.standard_normal(len(i)), -3.0, 3.0)
            self._leak_speed[i] = 1.0 / (1.0 + self._rules.leak_jitter * g)

    def events(self) -> tuple[Array, Index, Index]:
        """Return times [steps], pixels and polarities (1 or -1) of all events, in time order."""
        if not self._times:
            return np.zeros(0), np.zeros(0, np.int64), np.zeros(0, np.int64)
        time = np.concatenate(self._times)
        order = np.argsort(time, kind="stable")
        return (
            time[order],
            np.concatenate(self._pixels)[order],
            np.concatenate(self._polarities)[order],
        )
