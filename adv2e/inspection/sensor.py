"""What a configured sensor does, measured on its simulation: thresholds, latency, noise, bandwidth.

Known light falls on a few thousand pixels, which :mod:`adv2e.pixel` simulates, and events are
counted.  No number follows from a formula of an effect, so that all effects act together.
``docs/sensor.md`` defines each quantity.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from adv2e import __version__
from adv2e.causes import CAUSES
from adv2e.config import Config, Written, load_config, names_of, to_dict
from adv2e.config.active_effects import active_hooks
from adv2e.config.model import Frames, Readout, Sampling
from adv2e.conversion.simulation import events_from_light
from adv2e.effects.composition import begin, map_events
from adv2e.effects.hooks import LightFrame
from adv2e.effects.pixel.initial_reference import SETTLED
from adv2e.effects.readout.arbiter import ArbiterHooks
from adv2e.events import Events, make_events, pixels_of, sort_events
from adv2e.options import SensorOptions, takes

if TYPE_CHECKING:
    from typing_extensions import Unpack

Array = NDArray[np.float64]
Found = dict[str, Any]

_WHITE_DN = 255.0
_LIGHT_DN: Array = _WHITE_DN * 10.0 ** (-0.5 * np.arange(6))
"""Light levels of latency and noise; every other one also of thresholds and bandwidth [DN]."""
_PIXELS, _WATCHED, _FEW = 4000, 1000, 500
"""Pixels at a level: of thresholds; of noise; of latencies and bandwidth, where each tells more."""
_SEEN_S = 0.2
"""Time after a step in which an event counts."""
_LATEST_S = 1.0
"""The same for the latency."""
_WATCHED_S = 10.0, 60.0
"""Time for which noise is watched; the longer if shorter ones hold too few events."""
_ENOUGH = 100
_MOST_CONTRAST = 3.0
_BINS = 25
_PER_DECADE, _CYCLES, _SAMPLES = 4, 10, 24
"""Frequencies a decade; periods of a burst of flicker, and light values in each."""
_DECADES = 5.0
"""Of the frequencies, from 1 Hz on."""
_FRAMES_HZ = 240.0
"""Rate of frames for pixels that are advanced in steps, whose length acts on what they do."""
_FLICKERED_S = 0.1
_LEAP_NS = 1000
_SMALL = 0.02
"""Thresholds where bandwidth is measured: the corner moves with the light, if that moves much [ln].
"""
_LOADS = 0.1, 0.3, 0.5, 0.7, 0.8, 0.9, 0.95, 1.0, 1.1, 1.3, 2.0
_SIZE = 346, 260


@takes(SensorOptions)
def sensor(*configs: Written | Sequence[Written], **options: Unpack[SensorOptions]) -> Found:
    """Return what the sensors of some configurations do, measured on their simulation.

    Parameters
    ----------
    *configs : what :func:`adv2e.load_config` takes
        One for each sensor; none: the defaults.
    **options
        See :class:`adv2e.options.SensorOptions`.

    Returns
    -------
    dict
        Ready for JSON.  ``sensors``: of each its ``name``, resolved ``config``, ``conditions`` in
        words, ``numbers`` and ``plots``.  A number has ``name``, ``at``, ``unit``, ``value``,
        ``low`` and ``high`` (95 % interval; without a value, the limit), and the ``keys`` of the
        configuration that it goes back to.  A plot has ``key``, ``title``, ``x_label`` and
        ``y_label`` with units, ``x_log``, ``y_log``, ``definition``, ``mark`` (a value of y and its
        name, or None) and ``series``: ``name``, ``x``, ``y``, ``low`` and ``high``, (points,) each.

    Raises
    ------
    ConfigError, UsageError
        As :func:`adv2e.load_config`.
    DataError
        More events than ``max_events``.

    Examples
    --------
    >>> from adv2e import sensor
    >>> numbers = sensor("ideal", white_lux=1000)["sensors"][0]["numbers"]
    >>> numbers[0]["name"], round(numbers[0]["value"], 2), numbers[0]["unit"]
    ('contrast threshold, ON', 0.2, 'ln')
    """
    given = [(names_of(one) or "adv2e", load_config(one)) for one in configs or ["adv2e"]]
    return measured(given, **options)


def measured(given: Sequence[tuple[str, Config]], **options: Any) -> Found:
    """Return what :func:`sensor` does, of configurations with names, in that order."""
    return {
        "adv2e": __version__,
        "contrast_ln": options["contrast"],
        "white_lux": options["white_lux"],
        "sensors": [_Bench(config, **options).found(name) for name, config in given],
    }


class _Bench:
    """Light, pixels and counters for one configuration."""

    def __init__(
        self, config: Config, contrast: float, white_lux: float | None, threads: int | None
    ) -> None:
        self._contrast, self._threads, self._config = contrast, threads, config
        self._lux = None if white_lux is None else white_lux / _WHITE_DN
        pixel = config.pixel
        update = "exact" if pixel.low_pass is None else pixel.low_pass.update
        self._stepped = update != "exact"
        self._rate_hz = _FRAMES_HZ * config.sampling.L
        highest = math.log10(self._rate_hz / 8.0) if self._stepped else _DECADES
        self._tried_hz = 10.0 ** (np.arange(0, _PER_DECADE * highest + 0.5) / _PER_DECADE)
        self._rest_ns = round(_SEEN_S * 1e9) if update == "paper" else 0
        self._causes = not (pixel.high_pass and pixel.photoreceptor_noise)
        self._settled = replace(pixel, initial_reference=SETTLED)
        alike = replace(pixel.thresholds, mismatch=0.0)
        quiet: dict[str, Any] = dict.fromkeys(
            ("leak", "shot_noise", "photoreceptor_noise", "hot_pixels", "dead_pixels")
        )
        self._quiet = replace(self._settled, thresholds=alike, **quiet)
        self._numbers: list[Found] = []
        self._plots: list[Found] = []

    def found(self, name: str) -> Found:
        for measure in (self._thresholds, self._latency, self._noise, self._flicker, self._rate):
            measure()
        self._readout()
        return {
            "name": name,
            "config": to_dict(self._config),
            "conditions": self._conditions(),
            "numbers": self._numbers,
            "plots": self._plots,
        }

    def _conditions(self) -> list[str]:
        words = [
            f"Light is what falls on the pixel, 255 DN being white{self._white()}; frames.* and"
            " sampling.* are not used, and the readout is measured apart.",
            "Intervals are of 95 %. The numbers hold for these pixels, drawn with seed"
            f" {self._config.seed}.",
        ]
        if self._stepped:
            words.append(
                "The low-pass is advanced in steps, whose length acts on all numbers. Here light"
                f" comes {self._rate_hz:g} times a second, as that of {_FRAMES_HZ:g} frames with"
                f" this L, with K = {self._config.sampling.K} steps between, and a step of the"
                " light takes as long as from one to the next."
            )
        if self._rest_ns:
            words.append(
                f"The pixels rest for {_SEEN_S:g} s before a step: with this update they climb from"
                " where they begin, so that their references are no longer the signal."
            )
        return words

    def _white(self) -> str:
        return "" if self._lux is None else f" ({self._lux * _WHITE_DN:g} lux)"

    # ---- The simulation.

    def _events(self, frames: Iterator[LightFrame], pixel: Any, causes: bool = False) -> Events:
        config = replace(
            self._config,
            frames=Frames(),
            sensor=None,
            readout=None,
            pixel=pixel,
            sampling=Sampling(L=1, K=self._config.sampling.K),
        )
        if self._stepped:
            frames = _sampled(frames, 1e9 / self._rate_hz)
        made = events_from_light(frames, config, threads=self._threads, causes=causes)
        return np.concatenate(list(made))

    def _after_step(self, before: Array, after: Array, seen_s: float, pixel: Any) -> Events:
        """Return the events after a step, (rows, columns) of light before and after; t [us]."""
        low, high = before.astype(np.float32), after.astype(np.float32)
        leaps = self._rest_ns + _LEAP_NS
        ends = [(0, low), *[(self._rest_ns, low)] * bool(self._rest_ns), (leaps, high)]
        events = self._events(iter([*ends, (leaps + round(seen_s * 1e9), high)]), pixel)
        events["t"] -= self._rest_ns // 1000
        return events[events["t"] >= 0]

    # ---- What is measured.

    def _thresholds(self) -> None:
        levels = _LIGHT_DN[::2]
        bright = np.tile(np.repeat(levels, 2)[:, None], _PIXELS)
        rises = np.arange(len(bright)) % 2 == 0

        def fired(contrast: Array) -> NDArray[np.bool_]:
            dim = bright[:, : contrast.shape[1]] * np.exp(-contrast)
            full = np.broadcast_to(bright[:, : contrast.shape[1]], dim.shape)
            up = rises[:, None]
            sides = np.where(up, dim, full), np.where(up, full, dim)
            events = self._after_step(*sides, _SEEN_S, self._settled)
            return _fired(events[events["p"] == rises[events["y"]]], dim.shape)

        by_chance = fired(np.zeros((len(bright), _PIXELS))).mean(axis=1)
        top = _reach(fired, len(bright))
        contrast = top[:, None] * _ascending(_PIXELS)
        is_fired = fired(contrast)
        for up, word in ((True, "ON"), (False, "OFF")):
            series = []
            for row in np.flatnonzero(rises == up):
                light = self._light(bright[row, 0])
                series.append(self._curve(light, contrast[row], is_fired[row]))
                mean, spread = _moments(contrast[row], is_fired[row], by_chance[row])
                key = f"pixel.thresholds.{word.lower()}"
                self._number(f"contrast threshold, {word}", f"at {light}", "ln", *mean, key)
                self._number(
                    f"spread of the threshold over pixels, {word}", f"at {light}", "ln", *spread,
                    "pixel.thresholds.mismatch",
                )  # fmt: skip
            fall = "rises to" if up else "falls from"
            self._plot(
                f"s_curve_{word.lower()}", f"S-curve, {word}", "contrast: change of the light [%]",
                f"share of pixels with an {word} event", True, False, series,
                f"The light {fall} the level given, once, by a factor of 1 + contrast, for pixels"
                f" whose reference is the signal; the share of them with an {word} event within"
                f" {1e3 * _SEEN_S:g} ms. {_PIXELS} pixels a level, each with a contrast of its own;"
                f" {_PIXELS // _BINS} a point.", (0.5, "half"),
            )  # fmt: skip

    def _latency(self) -> None:
        count = _FEW
        bright = np.tile(_LIGHT_DN[:, None], count)
        dim = bright * math.exp(-self._contrast)
        sides = np.concatenate([dim, bright]), np.concatenate([bright, dim])
        events = self._after_step(*sides, _LATEST_S, self._settled)
        series = []
        for up, word in ((1, "ON"), (0, "OFF")):
            first = np.full((len(bright), count), np.inf)
            own = events[(events["p"] == up) & (events["y"] // len(bright) == 1 - up)]
            np.minimum.at(first, (own["y"] % len(bright), own["x"]), own["t"])
            first.sort(axis=1)
            first = np.maximum(first, 1.0)
            at = [_ranked(first, share) for share in (0.5, 0.1, 0.9)]
            series.append(self._series(word, self._x(_LIGHT_DN), *at))
            half = 0.98 / math.sqrt(count)
            ends = _ranked(first, 0.5 - half), _ranked(first, 0.5 + half)
            for k in (0, len(bright) - 2):
                self._number(
                    f"latency, {word}, median over pixels", f"at {self._light(_LIGHT_DN[k])}", "us",
                    at[0][k], (ends[0][k], ends[1][k]),
                    "pixel.low_pass.cutoff_hz", "pixel.source_follower.cutoff_hz",
                )  # fmt: skip
        self._plot(
            "latency", "Latency", self._x_label("the brighter side of the step"),
            "first event after a step [us]: median, 10 to 90 % of the pixels", True, True, series,
            f"Time of the first event of the step's polarity within {_LATEST_S:g} s after a step by"
            f" {100 * math.expm1(self._contrast):.3g} % ({self._contrast:g} ln) that takes"
            f" {_LEAP_NS / 1e3:g} us; {count} pixels a point, whose reference is the signal. No"
            " point: fewer than half of the pixels had one. Less than 1 us is given as 1.",
        )  # fmt: skip

    def _noise(self) -> None:
        count = _WATCHED
        light = np.tile(_LIGHT_DN[:, None], count).astype(np.float32)
        for seconds in (_WATCHED_S[0],) if self._rest_ns else _WATCHED_S:
            frames = ((t * 10**9, light) for t in range(int(seconds) + 1))
            events = self._events(frames, self._config.pixel, self._causes)
            if self._rest_ns:
                events = events[events["t"] >= self._rest_ns // 1000]
            watched = seconds - 1e-9 * self._rest_ns
            if min(np.bincount(2 * events["y"] + events["p"], minlength=12)) >= _ENOUGH:
                break
        series = []
        parts = {word: events["p"] == up for word, up in (("ON", 1), ("OFF", 0))}
        if self._causes:
            parts |= {
                f"by {name.replace('_', ' ')}": events["cause"] == number
                for number, name in enumerate(CAUSES)
                if (events["cause"] == number).any()
            }
        for word, chosen in parts.items():
            own = events[chosen]
            each = np.bincount(own["y"] * count + own["x"], minlength=light.size)
            rate = each.reshape(light.shape) / watched
            mean = rate.mean(axis=1)
            error = np.maximum(rate.std(axis=1), np.sqrt(mean / watched)) / math.sqrt(count)
            low, high = np.maximum(mean - 1.96 * error, 0.0), mean + 1.96 * error
            high = np.where(mean > 0.0, high, 3.0 / (watched * count))
            series.append(self._series(word, self._x(_LIGHT_DN), mean, low, high))
            for k in (0, len(light) - 1):
                self._number(
                    f"noise events, {word}", f"at {self._light(_LIGHT_DN[k])}", "1/s a pixel",
                    mean[k], (low[k], high[k]), *_KEYS_OF.get(word.removeprefix("by "), ()),
                )  # fmt: skip
        text = (
            f"Events a pixel and second, the mean over {count} pixels at rest in constant light for"
            f" {watched:g} s, with initial_reference: {self._config.pixel.initial_reference}."
            " Shaded: 95 %, of the pixels' spread and of counting; where no event came, up to the"
            " rate of three."
        )
        label = self._x_label("constant light")
        for key, title, some in (
            ("noise", "Noise and leak", series[:2]),
            ("noise_by_cause", "Noise and leak by cause, ON and OFF together", series[2:]),
        ):
            if some:
                unit = "events [1/s a pixel]"
                self._plot(key, title, label, unit, True, True, some, text)

    def _flicker(self) -> None:
        levels = _LIGHT_DN[::2]
        count = _FEW
        phase = np.arange(_CYCLES * _SAMPLES + 1) / _SAMPLES
        taper = np.sin(0.5 * np.pi * np.clip(np.minimum(phase, _CYCLES - phase) / 4, 0, 1)) ** 2
        wave = taper * np.sin(2.0 * np.pi * phase)
        both = replace(self._quiet.thresholds, on=_SMALL, off=_SMALL)
        small = replace(self._quiet, thresholds=both)

        def fired(hz: float, amplitude: Array) -> NDArray[np.bool_]:
            times = self._rest_ns + np.rint(1e9 * phase / hz).astype(np.int64)
            if self._rest_ns:
                times[0] = 0
            light = (levels[:, None] * np.exp(amplitude * one) for one in wave)
            frames = (
                (t, now.astype(np.float32)) for t, now in zip(times.tolist(), light, strict=True)
            )
            events = self._events(frames, small)
            return _fired(events[events["t"] >= self._rest_ns // 1000], amplitude.shape)

        tried = self._tried_hz[_PER_DECADE * self._stepped :]
        top = _reach(partial(fired, tried[0]), len(levels))
        least = np.full((0, len(levels)), np.nan)
        for hz in tried:
            is_fired = fired(hz, top[:, None] * _ascending(count))
            now = np.where(is_fired[:, -1], top * (1.0 - is_fired.mean(axis=1)), np.nan)
            least = np.concatenate([least, now[None]])
            best = np.fmin.reduce(least)
            if (np.isnan(now) | (now > 4.0 * best)).all() and not np.isnan(best).all():
                break
            top = np.fmin(3.5 * now, _MOST_CONTRAST)
        gain, tried = best / least, tried[: len(least)]
        series = [self._series(self._light(dn), tried, gain[:, k]) for k, dn in enumerate(levels)]
        for k, dn in enumerate(levels):
            self._number(
                "bandwidth, -3 dB", f"at {self._light(dn)}", "Hz",
                *_corner(tried, gain[:, k], 3.5 / count),
                "pixel.low_pass.cutoff_hz", "pixel.low_pass.dark_cutoff_hz",
                "pixel.source_follower.cutoff_hz",
            )  # fmt: skip
        self._plot(
            "bandwidth", "Bandwidth", "frequency of the flicker [Hz]",
            "gain: least amplitude that makes an event over that needed here", True, True, series,
            f"A burst of {_CYCLES} periods: ln(light) is a sine about the level given, which swells"
            " and fades over 4 periods each. The gain is the least amplitude that makes an event at"
            " any frequency over the one that does at this; -3 dB: 0.707. Small signals: thresholds"
            f" are {_SMALL:g} ln here, noise, leak and mismatch are off; {count} pixels a point, each"
            " with an amplitude of its own.", (math.sqrt(0.5), "-3 dB"),
        )  # fmt: skip

    def _rate(self) -> None:
        tried = self._tried_hz[_PER_DECADE:]
        sides = [np.full((1, 1), dn, np.float32) for dn in (0.01 * _WHITE_DN, _WHITE_DN)]
        rates, least = [], math.inf
        for hz in tried:
            halves = 2 * max(20, math.ceil(_FLICKERED_S * hz))
            edges = [round(0.5e9 * k / hz) for k in range(halves + 1)]
            frames = [(0, sides[1])]
            for k, (now, then) in enumerate(itertools.pairwise(edges)):
                leap = min(_LEAP_NS, (then - now) // 2)
                frames += [(now + leap, sides[k % 2]), (then, sides[k % 2])]
            times = self._events(iter(frames), self._quiet)["t"].astype(np.float64)
            begins = 1e-3 * edges[halves // 2]
            rates.append(1e6 * np.count_nonzero(times >= begins) / (1e-3 * edges[-1] - begins))
            least = min(least, float(np.diff(times).min(initial=math.inf)))
            if not rates[-1]:
                break
        tried = tried[: len(rates)]
        rate = np.array(rates)
        highest = int(rate.argmax())
        key = "pixel.refractory.period_us"
        at = f"light between 1 and 100 % of white, {tried[highest]:.3g} Hz"
        self._number("highest rate of a pixel", at, "1/s", rate[highest], 0.0, key)
        self._number(
            "least time between events of a pixel", "the same light, any frequency", "us", least,
            (max(least - 1.0, 0.0), least + 1.0), key,
        )  # fmt: skip
        self._plot(
            "rate", "Highest rate of one pixel", "frequency of the flicker [Hz]",
            "events of a pixel [1/s]", True, True, [self._series("ON and OFF", tried, rate)],
            f"Square flicker between 1 % and 100 % of white, of a pixel without noise and leak: the"
            f" second half of 20 periods, or of {_FLICKERED_S:g} s if that is more. Above the last"
            " point no event came.",
        )  # fmt: skip

    def _readout(self) -> None:
        given = self._config.readout
        if given is None or given.arbiter is None:
            return
        size = self._config.sensor
        columns, rows = _SIZE if size is None else (size.width, size.height)
        hooks = [
            hook
            for hook in active_hooks(replace(self._config, readout=Readout(arbiter=given.arbiter)))
            if isinstance(hook, ArbiterHooks)
        ]
        most, _, _ = _served(hooks, columns, rows, 1e9, self._config.seed)
        loads = np.array(_LOADS)
        parts = [_served(hooks, columns, rows, most * one, self._config.seed) for one in loads]
        sent, lost, delay = (np.array(part) for part in zip(*parts, strict=True))
        keys = "readout.arbiter.event_ns", "readout.arbiter.row_ns"
        sized = f"{columns}x{rows}" + " (the configuration has no size)" * (size is None)
        self._number("capacity of the readout", sized, "1/s", most, 0.01 * most, *keys)
        text = (
            f"Events at random on {columns}x{rows} pixels go through the configuration's arbiter."
            f" Load: their rate over its capacity, {most:.3g} events a second, which is what leaves"
            " it where all pixels ask at once."
        )
        x_label = "load: rate of events over the capacity"
        self._plot(
            "readout_loss", "Readout: events lost", x_label, "share of events", False, False,
            [self._series("lost", loads, lost), self._series("capacity used", loads, sent / most)],
            text,
        )  # fmt: skip
        middle, low, high = delay.T
        self._plot(
            "readout_delay", "Readout: delay", x_label, "delay [us]: median, 10 to 90 %",
            False, True, [self._series("delay", loads, middle, low, high)], text,
        )  # fmt: skip

    # ---- What is kept.

    def _light(self, dn: float) -> str:
        share = f"{100 * dn / _WHITE_DN:.3g} % of white"
        return share if self._lux is None else f"{share} ({self._lux * dn:.3g} lux)"

    def _x(self, dn: Array) -> Array:
        return dn / _WHITE_DN if self._lux is None else dn * self._lux

    def _x_label(self, what: str) -> str:
        unit = "DN/255 of white" if self._lux is None else f"lux, white being 255 DN{self._white()}"
        return f"{what} [{unit}]"

    def _series(
        self, name: str, x: Array, y: Array, low: Array | None = None, high: Array | None = None
    ) -> Found:
        rows = {"x": x, "y": y, "low": low, "high": high}
        lists = {key: None if row is None else _plain(row) for key, row in rows.items()}
        return {"name": name, **lists}

    def _curve(self, name: str, contrast: Array, fired: NDArray[np.bool_]) -> Found:
        """Return the share that fires in bins of the contrast, with Wilson's interval."""
        share = fired.reshape(_BINS, -1).mean(axis=1)
        middle = contrast.reshape(_BINS, -1).mean(axis=1)
        z2 = 1.96**2 / (fired.size / _BINS)
        centre = (share + z2 / 2) / (1 + z2)
        half = np.sqrt(share * (1 - share) * z2 + z2**2 / 4) / (1 + z2)
        return self._series(name, 100.0 * np.expm1(middle), share, centre - half, centre + half)

    def _plot(
        self, key: str, title: str, x_label: str, y_label: str, x_log: bool, y_log: bool,
        series: list[Found], definition: str, mark: tuple[float, str] | None = None,
    ) -> None:  # fmt: skip
        self._plots.append(
            {
                "key": key, "title": title, "x_label": x_label, "y_label": y_label,
                "x_log": x_log, "y_log": y_log, "definition": definition, "series": series,
                "mark": mark,
            }
        )  # fmt: skip

    def _number(
        self, name: str, at: str, unit: str, value: float,
        error: float | tuple[float, float], *keys: str,
    ) -> None:  # fmt: skip
        """Keep a number; `error` is a standard error, or the ends of the interval."""
        ends = error if isinstance(error, tuple) else (value - 1.96 * error, value + 1.96 * error)
        shown = _plain([value, max(ends[0], 0.0), ends[1]])
        self._numbers.append(
            {
                "name": name, "at": at, "unit": unit,
                **dict(zip(("value", "low", "high"), shown, strict=True)), "keys": list(keys),
            }
        )  # fmt: skip


_KEYS_OF = {
    "leak": ("pixel.leak.rate_hz", "pixel.leak.photo_rate_hz"),
    "shot noise": ("pixel.shot_noise.rate_hz",),
    "photoreceptor noise": ("pixel.photoreceptor_noise.rms",),
    "hot pixel": ("pixel.hot_pixels.fraction", "pixel.hot_pixels.rate_hz"),
}
"""Keys by what makes noise."""


def _plain(row: Array | Sequence[float]) -> list[float | None]:
    return [float(one) if math.isfinite(one) else None for one in row]


def _ascending(count: int) -> Array:
    return (np.arange(count) + 0.5) / count


def _fired(events: Events, shape: tuple[int, ...]) -> NDArray[np.bool_]:
    found = np.zeros(shape, np.bool_)
    found[events["y"], events["x"]] = True
    return found


def _sampled(frames: Iterator[LightFrame], period_ns: float) -> Iterator[LightFrame]:
    """Yield the light at equal times, on lines between the frames; the last as it is."""
    t0, first = next(frames)
    number = 0
    for t1, second in frames:
        while (t := round(number * period_ns)) <= t1:
            yield t, first + (second - first) * np.float32(max(t - t0, 0) / (t1 - t0))
            number += 1
        t0, first = t1, second
    yield round(number * period_ns), first


def _reach(fired: Callable[[Array], NDArray[np.bool_]], rows: int) -> Array:
    """Return a contrast well above that at which half of the pixels of each row fire, (rows,)."""
    tried = np.geomspace(0.01, _MOST_CONTRAST, 30)
    found = fired(np.tile(tried.repeat(40), (rows, 1))).reshape(rows, tried.size, 40).mean(axis=2)
    half = np.array([tried[np.append(np.flatnonzero(row > 0.5), -1)[0]] for row in found])
    return np.minimum(2.5 * half, _MOST_CONTRAST)


def _moments(
    contrast: Array, fired: NDArray[np.bool_], by_chance: float
) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return mean and standard deviation of the thresholds over pixels, each with its error [ln].

    By the method of Spearman and Karber, between the share that fires by chance and that which
    fires with the largest contrasts; NaN if there is little between them.  The error is that of
    drawing the pixels.
    """
    step = contrast[1] - contrast[0]
    last = fired[-fired.size // 8 :]
    most = last.mean()
    span = most - by_chance if most - by_chance > 0.5 else math.nan
    below = (most - fired) / span
    mean = step * below.sum()
    spread = math.sqrt(max(2.0 * step * (contrast * below).sum() - mean**2, 0.0))
    drawn = 0.5 * np.diff(fired.astype(np.float64), append=fired[-1]) ** 2
    ends = [math.sqrt(p * (1 - p) / n) for p, n in ((most, last.size), (by_chance, fired.size))]
    error = math.hypot(
        step * math.sqrt(drawn.sum()), (contrast[-1] - mean) * ends[0], mean * ends[1]
    )
    apart = step * math.sqrt((drawn * (contrast - mean) ** 2).sum()) / max(spread, step)
    return (mean, error / span), (spread, apart / span)


def _ranked(ordered: Array, share: float) -> Array:
    """Return of each row the value that this share does not exceed; NaN if it is infinite."""
    found = ordered[:, max(math.ceil(share * ordered.shape[1]) - 1, 0)]
    return np.where(np.isfinite(found), found, np.nan)


def _corner(hz: Array, gain: Array, step: float) -> tuple[float, tuple[float, float]]:
    """Return where the gain falls for good by 3 dB, with an interval; else from where on it may.

    `step`: of the amplitudes, as a share of the largest.
    """
    above = np.flatnonzero(gain >= math.sqrt(0.5))
    k = int(above[-1]) if above.size else 0
    if k + 1 >= gain.size or not above.size or math.isnan(gain[k + 1]):
        return math.nan, (hz[k] if above.size else math.nan, math.nan)
    # of one pole, this is a line
    left, right = np.log(1.0 / np.minimum(gain[k : k + 2], 0.999) ** 2 - 1.0)
    wide = math.log(hz[k + 1] / hz[k]) / (right - left)
    at = hz[k] * math.exp(-wide * left)
    off = math.exp(6.0 * wide * step)
    return at, (at / off, at * off)


def _served(
    hooks: Sequence[ArbiterHooks], columns: int, rows: int, rate: float, seed: int
) -> tuple[float, float, list[float]]:
    """Return the rate that leaves the readout, the share lost, and quantiles of the delay [us]."""
    pixels = columns * rows
    count = max(200_000, 3 * pixels)
    draw = np.random.default_rng([seed, 1])
    span_us = 1e6 * count / rate
    where = draw.integers(pixels, size=count)
    times = draw.uniform(0.0, span_us, count).astype(np.int64)
    asked = sort_events(make_events(times, where % columns, where // columns, where & 1))
    next(iter(begin(hooks, iter([(0, np.zeros((rows, columns), np.float32))]), seed)))
    left = np.concatenate(list(map_events(hooks, iter([asked]), False)))
    begins, ends = int(left["t"][0]), int(left["t"][-1])
    # what a pixel asks for while it waits is lost: an event is the first since the one before
    far = 1 << 40
    given = np.sort(pixels_of(asked, columns).astype(np.int64) * far + asked["t"])
    out = np.sort(pixels_of(left, columns).astype(np.int64) * far + left["t"])
    before = np.append(out[0] // far * far - 1, out[:-1])
    since = np.where(before // far == out // far, before, out // far * far - 1)
    delay = (out - given[np.searchsorted(given, since, "right").clip(max=given.size - 1)]).clip(0)
    late = delay[out % far > ends // 2]
    quantiles = np.quantile(late, (0.5, 0.1, 0.9)).tolist()
    return 1e6 * left.size / max(ends - begins, 1), 1.0 - left.size / count, quantiles
