"""What a configured sensor does, measured on its simulation: thresholds, latency, noise, bandwidth.

Known light falls on a few thousand pixels, which :mod:`adv2e.pixel` simulates, and events are
counted.  No number follows from a formula of an effect, so that all effects act together.  The
docstring of each measure is the definition that stands beside its curve.
"""

from __future__ import annotations

import inspect
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
from adv2e.config.model import Frames, Pixel, Sampling
from adv2e.conversion.simulation import events_from_light
from adv2e.effects.composition import begin
from adv2e.effects.hooks import LightFrame
from adv2e.effects.pixel.initial_reference import SETTLED
from adv2e.effects.readout.arbiter import ArbiterHooks
from adv2e.events import Events, make_events, pixels_of, sort_events
from adv2e.options import SensorOptions, takes

if TYPE_CHECKING:
    from typing_extensions import Unpack

Array = NDArray[np.float64]
Fired = NDArray[np.bool_]
Found = dict[str, Any]

_WHITE_DN = 255.0
_LIGHT_DN = np.geomspace(_WHITE_DN, _WHITE_DN * 10**-2.5, 6)
"""Light levels of latency and noise; every other one also of thresholds and bandwidth."""
_PIXELS, _WATCHED, _FEW = 4000, 1000, 500
"""Pixels at a level: of thresholds; of noise; of latency and bandwidth, where each tells more."""
_SEEN_S, _LATEST_S = 0.2, 1.0
"""Time after a step in which events count, of thresholds and of latency."""
_WATCHED_S = 10, 60
"""Time for which noise is watched: the longer where the shorter holds too few events."""
_ENOUGH = 100
_MOST_CONTRAST = 3.0
_SMALL = 0.01
"""Thresholds where bandwidth is measured: the corner moves with the light, if that moves much."""
_BINS = 25
_CYCLES, _SAMPLES = 10, 24
"""Periods of a burst of flicker, and light values in each."""
_FLICKERED_S = 0.1
_LEAP_NS = 1000
_FRAMES_HZ = 240
"""Rate of frames for pixels that are advanced in steps, whose length acts on what they do."""
_LOADS = 0.1, 0.3, 0.5, 0.7, 0.8, 0.9, 0.95, 1.0, 1.1, 1.3, 2.0
_SIZE = 346, 260
"""Columns and rows of a sensor whose configuration does not say."""

_KEYS_OF = {
    "by leak": ("pixel.leak.rate_hz", "pixel.leak.photo_rate_hz"),
    "by shot noise": ("pixel.shot_noise.rate_hz",),
    "by photoreceptor noise": ("pixel.photoreceptor_noise.rms",),
    "by hot pixel": ("pixel.hot_pixels.fraction", "pixel.hot_pixels.rate_hz"),
}
_CORNERS = ("low_pass.cutoff_hz", "low_pass.dark_cutoff_hz", "source_follower.cutoff_hz")


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
        Ready for JSON.  ``options``: those that numbers depend on.  ``sensors``: of each its
        ``name``, resolved ``config``, ``conditions`` in words, ``numbers`` and ``plots``.

        A number has ``name``, ``at``, ``unit``, ``value``, ``low`` and ``high`` (95 % interval;
        without a value, the limit), and the ``keys`` of the configuration that it goes back to.  A
        plot has ``key``, ``title``, ``x_label`` and ``y_label`` with units, ``log`` (axes that are
        logarithmic), ``definition``, ``mark`` (a value of y and its name, or None) and ``series``:
        ``name``, ``x``, ``y``, ``low`` and ``high``, (points,) each.

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
    """Return what :func:`sensor` does, of configurations with names."""
    sensors = [_Bench(config, **options).found(name) for name, config in given]
    chosen = {name: value for name, value in options.items() if name != "threads"}
    return {"adv2e": __version__, "options": chosen, "sensors": sensors}


class _Bench:
    """Light, pixels and counters for one configuration."""

    def __init__(
        self, config: Config, contrast: float, white_lux: float | None, threads: int | None
    ) -> None:
        self._config, self._contrast, self._threads = config, contrast, threads
        self._lux = None if white_lux is None else white_lux / _WHITE_DN
        pixel = config.pixel
        self._stepped = pixel.low_pass is not None and pixel.low_pass.update != "exact"
        self._rate_hz = _FRAMES_HZ * config.sampling.L
        decades = math.log10(self._rate_hz / 8) if self._stepped else 5.0
        self._tried_hz = 10.0 ** np.arange(0.0, decades + 0.1, 0.25)
        # with update: paper, pixels climb at first from where they begin
        self._rest_ns = round(1e9 * _SEEN_S) if self._stepped else 0
        self._settled = replace(pixel, initial_reference=SETTLED)
        off: dict[str, Any] = dict.fromkeys(
            ("leak", "shot_noise", "photoreceptor_noise", "hot_pixels", "dead_pixels")
        )
        alike = replace(pixel.thresholds, mismatch=0.0)
        self._quiet = replace(self._settled, thresholds=alike, **off)
        self._numbers: list[Found] = []
        self._plots: list[Found] = []

    def found(self, name: str) -> Found:
        parts = self._thresholds, self._latency, self._noise, self._bandwidth, self._rate
        for measure in (*parts, self._readout):
            measure()
        conditions = [
            f"Light is what falls on the pixel; white is 255 DN{self._lux_text(_WHITE_DN)}. Keys of"
            " frames and sampling are not used, and the readout is measured by itself. Intervals"
            f" are of 95 %; pixels are drawn with seed {self._config.seed}.",
        ]
        if not (self._config.readout and self._config.readout.arbiter):
            conditions.append("There is no readout limit in this configuration.")
        if self._stepped:
            conditions.append(
                "The low-pass is advanced in steps, whose length acts on all numbers: here light"
                f" comes {self._rate_hz} times a second, as of {_FRAMES_HZ} frames and this L, with"
                f" K = {self._config.sampling.K}; a step takes from one to the next, and pixels"
                f" rest for {_SEEN_S:g} s before it."
            )
        return {
            "name": name, "config": to_dict(self._config), "conditions": conditions,
            "numbers": self._numbers, "plots": self._plots,
        }  # fmt: skip

    # ---- The simulation.

    def _events(self, frames: Iterator[LightFrame], pixel: Pixel, causes: bool = False) -> Events:
        """Return the events of pixels in light (rows, columns), after they have rested; t [us]."""
        config = replace(
            self._config, frames=Frames(), sensor=None, readout=None, pixel=pixel,
            sampling=Sampling(L=1, K=self._config.sampling.K),
        )  # fmt: skip
        if self._stepped:
            t0, first = next(frames)
            later = ((t + self._rest_ns, one) for t, one in itertools.chain([(t0, first)], frames))
            frames = _sampled(itertools.chain([(t0, first)], later), 1e9 / self._rate_hz)
        made = events_from_light(frames, config, threads=self._threads, causes=causes)
        events = np.concatenate(list(made))
        events["t"] -= self._rest_ns // 1000
        return events[events["t"] >= 0]

    def _after_step(self, bright: Array, dim: Array, rises: Fired, seen_s: float) -> Events:
        """Return the events of the steps' own polarity; of rows that rise, else fall."""
        up = rises[:, None]
        before, after = (np.where(up, *two) for two in ((dim, bright), (bright, dim)))
        low, high = before.astype(np.float32), after.astype(np.float32)
        frames = [(0, low), (_LEAP_NS, high), (_LEAP_NS + round(seen_s * 1e9), high)]
        events = self._events(iter(frames), self._settled)
        own: Fired = events["p"] == rises[events["y"]]
        return events[own]

    # ---- What is measured.

    def _thresholds(self) -> None:
        """Add thresholds.

        The light changes once: it rises to the level given, or falls from it, by a factor of 1 +
        contrast, for pixels whose reference is the signal.  Share of them with an event of that
        polarity within 200 ms; 4000 pixels a level, each with a contrast of its own, 160 a point.
        """
        rises = np.arange(6) % 2 == 0
        levels = _LIGHT_DN[::2].repeat(2)

        def fired(contrast: Array) -> Fired:
            bright = np.broadcast_to(levels[:, None], contrast.shape)
            seen = self._after_step(bright, bright * np.exp(-contrast), rises, _SEEN_S)
            return _fired(seen, contrast.shape)

        by_chance = fired(np.zeros((6, _PIXELS))).mean(axis=1)
        contrast = _reach(fired, 6)[:, None] * _ascending(_PIXELS)
        is_fired = fired(contrast)
        for up, word in ((True, "ON"), (False, "OFF")):
            series = []
            for row in np.flatnonzero(rises == up):
                at = self._at(levels[row])
                series.append(_s_curve(at, contrast[row], is_fired[row]))
                mean, spread = _moments(contrast[row], is_fired[row], by_chance[row])
                name = f"threshold, {word}"
                self._number(f"contrast {name}", at, "ln", *mean, f"thresholds.{word.lower()}")
                self._number(f"spread of the {name}", at, "ln", *spread, "thresholds.mismatch")
            self._plot(
                self._thresholds, f"s_curve_{word.lower()}", f"S-curve, {word}",
                "contrast: change of the light [%]", f"share of pixels with an {word} event",
                series, "x", (0.5, "half"),
            )  # fmt: skip

    def _latency(self) -> None:
        """Add the latency.

        Time from a step of the light, which takes 1 us, to the first event of its polarity within
        1 s; 500 pixels a point, whose reference is the signal.  Line: median, shaded: 10 to 90 % of
        the pixels.  No point: fewer than half of the pixels had one.  Less than 1 us is given as 1.
        """
        levels = _LIGHT_DN.size
        bright = np.tile(_LIGHT_DN, 2)[:, None].repeat(_FEW, axis=1)
        rises = np.arange(2 * levels) < levels
        seen = self._after_step(bright, bright * math.exp(-self._contrast), rises, _LATEST_S)
        first = np.full(bright.shape, np.inf)
        np.minimum.at(first, (seen["y"], seen["x"]), np.maximum(seen["t"], 1))
        first.sort(axis=1)
        apart = 0.98 / math.sqrt(_FEW)
        ranks = [
            first[:, math.ceil(share * _FEW) - 1]
            for share in (0.1, 0.5 - apart, 0.5, 0.5 + apart, 0.9)
        ]
        series = []
        for rows, word in ((slice(0, levels), "ON"), (slice(levels, None), "OFF")):
            low, least, middle, most, high = (row[rows] for row in ranks)
            series.append(_series(word, self._x(_LIGHT_DN), middle, low, high))
            for k in (0, 4):
                at, value = self._at(_LIGHT_DN[k]), (middle[k], least[k], most[k])
                self._number(f"latency, {word}, median", at, "us", *value)
        step = f"{100 * math.expm1(self._contrast):.3g} % ({self._contrast:g} ln)"
        x_label = self._x_label("light at the bright side of the step")
        y_label = f"first event after a step of {step} [us]"
        self._plot(self._latency, "latency", "Latency", x_label, y_label, series)

    def _noise(self) -> None:
        """Add noise and leak.

        Events of pixels at rest in constant light: the mean over 1000 pixels for 10 s, or for 60 s
        where 10 s hold few events.  Shaded: 95 %, of the pixels' spread and of counting; where no
        event came, up to the rate of three.  References begin as pixel.initial_reference says.
        """
        light = _LIGHT_DN[:, None].repeat(_WATCHED, axis=1).astype(np.float32)
        causes = not (self._config.pixel.high_pass and self._config.pixel.photoreceptor_noise)
        for seconds in _WATCHED_S[: 1 if self._stepped else 2]:
            frames = ((t * 10**9, light) for t in range(seconds + 1))
            events = self._events(frames, self._config.pixel, causes)
            if min(np.bincount(2 * events["y"] + events["p"], minlength=12)) >= _ENOUGH:
                break
        parts = {"ON": events["p"] == 1, "OFF": events["p"] == 0}
        for number, name in enumerate(CAUSES if causes else ()):
            if (chosen := events["cause"] == number).any():
                parts[f"by {name.replace('_', ' ')}"] = chosen
        series = []
        for word, chosen in parts.items():
            at = pixels_of(events[chosen], _WATCHED)
            rate = np.bincount(at, minlength=light.size).reshape(light.shape) / seconds
            mean = rate.mean(axis=1)
            error = np.maximum(rate.std(axis=1), np.sqrt(mean / seconds)) / math.sqrt(_WATCHED)
            low, high = np.maximum(mean - 1.96 * error, 0.0), mean + 1.96 * error
            high = np.where(mean > 0.0, high, 3.0 / (seconds * _WATCHED))
            series.append(_series(word, self._x(_LIGHT_DN), mean, low, high))
            for k in (0, 5):
                name, value = f"noise events, {word}", (mean[k], low[k], high[k])
                keys = _KEYS_OF.get(word, ())
                self._number(name, self._at(_LIGHT_DN[k]), "1/s a pixel", *value, *keys)
        labels = self._x_label("constant light"), "events [1/s a pixel]"
        self._plot(self._noise, "noise", "Noise and leak", *labels, series[:2])
        if series[2:]:
            title = "Noise and leak by cause, ON and OFF together"
            self._plot(self._noise, "noise_by_cause", title, *labels, series[2:])

    def _bandwidth(self) -> None:
        """Add the bandwidth.

        A burst of 10 periods: ln(light) is a sine about the level given, which swells and fades
        over 4 periods each.  The gain is the least amplitude that makes an event at any frequency
        over the one that does at this; -3 dB: 0.707.  Small signals: thresholds are 0.01 ln here,
        noise, leak and mismatch are off; 500 pixels a point, each with an amplitude of its own.
        """
        levels = _LIGHT_DN[::2]
        phase = np.arange(_CYCLES * _SAMPLES + 1) / _SAMPLES
        taper = np.sin(0.5 * np.pi * np.clip(np.minimum(phase, _CYCLES - phase) / 4, 0, 1)) ** 2
        wave = taper * np.sin(2.0 * np.pi * phase)
        both = replace(self._quiet.thresholds, on=_SMALL, off=_SMALL)
        pixel = replace(self._quiet, thresholds=both)

        def fired(hz: float, amplitude: Array) -> Fired:
            times = np.rint(1e9 * phase / hz).astype(np.int64).tolist()
            light = (levels[:, None] * np.exp(amplitude * one) for one in wave)
            frames = ((t, now.astype(np.float32)) for t, now in zip(times, light, strict=True))
            return _fired(self._events(frames, pixel), amplitude.shape)

        tried = self._tried_hz[4 * self._stepped :]
        top, least = _reach(partial(fired, tried[0]), 3), np.full((0, 3), np.nan)
        for hz in tried:
            is_fired = fired(hz, top[:, None] * _ascending(_FEW))
            now = np.where(is_fired[:, -1], top * (1.0 - is_fired.mean(axis=1)), np.nan)
            least = np.concatenate([least, now[None]])
            best = np.fmin.reduce(least)
            if (np.isnan(now) | (now > 4.0 * best)).all() and not np.isnan(best).all():
                break
            top = np.fmin(3.5 * now, _MOST_CONTRAST)
        gain, tried = best / least, tried[: len(least)]
        series = [_series(self._at(dn), tried, gain[:, k]) for k, dn in enumerate(levels)]
        for k, dn in enumerate(levels):
            self._number(
                "bandwidth, -3 dB", self._at(dn), "Hz", *_corner(tried, gain[:, k]), *_CORNERS
            )
        y_label = "gain: least amplitude that makes an event over that needed here"
        x_label, mark = "frequency of the flicker [Hz]", (math.sqrt(0.5), "-3 dB")
        self._plot(self._bandwidth, "bandwidth", "Bandwidth", x_label, y_label, series, "xy", mark)

    def _rate(self) -> None:
        """Add the highest rate.

        Events of one pixel without noise and leak, in square flicker between 1 % and 100 % of
        white: in the second half of 20 periods, or of 0.1 s if that is more.  Above the last point
        no event came.
        """
        sides = [np.full((1, 1), dn, np.float32) for dn in (0.01 * _WHITE_DN, _WHITE_DN)]
        tried, rates, least = self._tried_hz[4:], [], math.inf
        for hz in tried:
            halves = 2 * max(20, math.ceil(_FLICKERED_S * hz))
            edges = [round(0.5e9 * k / hz) for k in range(halves + 1)]
            leap = min(_LEAP_NS, edges[1] // 2)
            leaps = ((k, t) for k in range(halves) for t in (edges[k] + leap, edges[k + 1]))
            frames = itertools.chain([(0, sides[1])], ((t, sides[k % 2]) for k, t in leaps))
            times = self._events(frames, self._quiet)["t"].astype(np.float64)
            begins = 1e-3 * edges[halves // 2]
            rates.append(1e6 * np.count_nonzero(times >= begins) / (1e-3 * edges[-1] - begins))
            least = min(least, float(np.diff(times).min(initial=math.inf)))
            if not rates[-1]:
                break
        most, at = max(zip(rates, tried, strict=False)), "flicker between 1 and 100 % of white"
        key = "refractory.period_us"
        self._number(
            "highest rate of a pixel", f"{at}, {most[1]:,.0f} Hz", "1/s", *most[:1] * 3, key
        )
        ends = max(least - 1.0, 0.0), least + 1.0
        self._number("least time between events of a pixel", at, "us", least, *ends, key)
        series = [_series("ON and OFF", tried[: len(rates)], np.array(rates))]
        labels = "frequency of the flicker [Hz]", "events of a pixel [1/s]"
        self._plot(self._rate, "rate", "Highest rate of one pixel", *labels, series)

    def _readout(self) -> None:
        """Add the readout.

        Events at random times and pixels of the whole sensor go through the configuration's
        arbiter.  Load: their rate over its capacity, the rate that leaves it where nearly all
        pixels ask at once.  Delay: median, shaded: 10 to 90 % of the events; less than 1 us is
        given as 1.
        """
        given, size = self._config.readout, self._config.sensor
        if given is None or given.arbiter is None:
            return
        columns, rows = _SIZE if size is None else (size.width, size.height)
        arbiter = ArbiterHooks(given.arbiter)
        served = partial(_served, arbiter, columns, rows, self._config.seed)
        most = served(1e9)[0]
        parts = [served(most * load) for load in _LOADS]
        sent, lost, *delay = (np.array(part) for part in zip(*parts, strict=True))
        at = f"{columns}x{rows} pixels" + ", as the configuration has no size" * (size is None)
        keys = "arbiter.event_ns", "arbiter.row_ns"
        ends = 0.99 * most, 1.01 * most
        self._number("capacity of the readout", at, "1/s", most, *ends, *keys, section="readout")
        loads, x_label = np.array(_LOADS), "load: rate of events over the capacity"
        series = [_series("lost", loads, lost), _series("capacity used", loads, sent / most)]
        title = "Readout: loss"
        self._plot(self._readout, "readout_loss", title, x_label, "share", series, "")
        delays, y_label = [_series("delay", loads, *delay)], "delay [us]"
        self._plot(self._readout, "readout_delay", "Readout: delay", x_label, y_label, delays, "y")

    # ---- What is kept.

    def _lux_text(self, dn: float) -> str:
        return "" if self._lux is None else f" ({self._lux * dn:.4g} lux)"

    def _at(self, dn: float) -> str:
        return f"{100 * dn / _WHITE_DN:.3g} % of white{self._lux_text(dn)}"

    def _x(self, dn: Array) -> Array:
        return dn / _WHITE_DN if self._lux is None else dn * self._lux

    def _x_label(self, what: str) -> str:
        return f"{what} [{'DN/255 of white' if self._lux is None else 'lux'}]"

    def _plot(
        self, measure: Callable[[], None], key: str, title: str, x_label: str, y_label: str,
        series: list[Found], log: str = "xy", mark: tuple[float, str] | None = None,
    ) -> None:  # fmt: skip
        definition = " ".join((inspect.getdoc(measure) or "").partition("\n\n")[2].split())
        labels = {"key": key, "title": title, "x_label": x_label, "y_label": y_label, "log": log}
        self._plots.append({**labels, "definition": definition, "mark": mark, "series": series})

    def _number(
        self, name: str, at: str, unit: str, value: float, low: float, high: float, *keys: str,
        section: str = "pixel",
    ) -> None:  # fmt: skip
        shown = dict(zip(("value", "low", "high"), _plain([value, low, high]), strict=True))
        paths = [key if key.startswith("pixel.") else f"{section}.{key}" for key in keys]
        self._numbers.append({"name": name, "at": at, "unit": unit, **shown, "keys": paths})


def _series(
    name: str, x: Array, y: Array, low: Array | None = None, high: Array | None = None
) -> Found:
    rows = {"x": x, "y": y, "low": low, "high": high}
    return {"name": name, **{key: None if r is None else _plain(r) for key, r in rows.items()}}


def _plain(row: Array | Sequence[float]) -> list[float | None]:
    return [float(one) if math.isfinite(one) else None for one in row]


def _ascending(count: int) -> Array:
    return (np.arange(count) + 0.5) / count


def _fired(events: Events, shape: tuple[int, ...]) -> Fired:
    found = np.zeros(shape, np.bool_)
    found[events["y"], events["x"]] = True
    return found


def _sampled(frames: Iterator[LightFrame], period_ns: float) -> Iterator[LightFrame]:
    """Yield the light at equal times, on lines between the frames; the last as it is."""
    t0, first = next(frames)
    number = 0
    for t1, second in frames:
        while (t := round(number * period_ns)) <= t1:
            yield t, first + (second - first) * np.float32((t - t0) / max(t1 - t0, 1))
            number += 1
        t0, first = t1, second
    yield round(number * period_ns), first


def _reach(fired: Callable[[Array], Fired], rows: int) -> Array:
    """Return a contrast well above that at which half of the pixels of each row fire, (rows,)."""
    tried = np.geomspace(0.002, _MOST_CONTRAST, 40)
    found = fired(np.tile(tried.repeat(40), (rows, 1))).reshape(rows, tried.size, 40).mean(axis=2)
    half = np.array([tried[np.append(np.flatnonzero(row > 0.5), -1)[0]] for row in found])
    return np.minimum(2.5 * half, _MOST_CONTRAST)


def _s_curve(name: str, contrast: Array, fired: Fired) -> Found:
    """Return the share that fires in bins of the contrast [%], with Wilson's interval."""
    share = fired.reshape(_BINS, -1).mean(axis=1)
    z2 = 1.96**2 / (fired.size / _BINS)
    centre = (share + z2 / 2) / (1 + z2)
    half = np.sqrt(share * (1 - share) * z2 + z2**2 / 4) / (1 + z2)
    middle = 100.0 * np.expm1(contrast.reshape(_BINS, -1).mean(axis=1))
    return _series(name, middle, share, centre - half, centre + half)


def _moments(contrast: Array, fired: Fired, by_chance: float) -> list[tuple[float, float, float]]:
    """Return mean and standard deviation of the thresholds over pixels, with intervals [ln].

    By the method of Spearman and Karber, between the share that fires by chance and that which
    fires with the largest contrasts; NaN if there is little between them.
    """
    step, last = contrast[1] - contrast[0], fired[-fired.size // 8 :]
    most = last.mean()
    span = most - by_chance if most - by_chance > 0.5 else math.nan
    below = (most - fired) / span
    mean = step * below.sum()
    square = 2.0 * step * (contrast * below).sum() - mean**2
    spread = math.sqrt(square) if square > step**2 else 0.0 * span  # less does not show
    drawn = 0.5 * np.diff(fired.astype(np.float64), append=fired[-1]) ** 2
    ends = [math.sqrt(p * (1 - p) / n) for p, n in ((most, last.size), (by_chance, fired.size))]
    error = math.hypot(step * drawn.sum() ** 0.5, (contrast[-1] - mean) * ends[0], mean * ends[1])
    apart = step * (drawn * (contrast - mean) ** 2).sum() ** 0.5 / max(spread, step)
    both = ((mean, 1.96 * error / span), (spread, 1.96 * apart / span))
    return [(value, max(value - off, 0.0), value + off) for value, off in both]


def _corner(hz: Array, gain: Array) -> tuple[float, float, float]:
    """Return where the gain falls for good by 3 dB, with an interval; else from where on it may."""
    above = np.flatnonzero(gain >= math.sqrt(0.5))
    k = int(above[-1]) if above.size else 0
    if k + 1 >= gain.size or not above.size or math.isnan(gain[k + 1]):
        return math.nan, hz[k] if above.size else math.nan, math.nan
    # of one pole, this is a line
    left, right = np.log(1.0 / np.minimum(gain[k : k + 2], 0.999) ** 2 - 1.0)
    wide = math.log(hz[k + 1] / hz[k]) / (right - left)
    at, off = hz[k] * math.exp(-wide * left), math.exp(0.04 * wide)  # 1 % of the amplitude
    return at, at / off, at * off


def _served(
    arbiter: ArbiterHooks, columns: int, rows: int, seed: int, rate: float
) -> tuple[float, float, float, float, float]:
    """Return the rate that leaves the readout, the share lost, and delays [us].

    These are the median, 10 % and 90 % of them.
    """
    pixels = columns * rows
    count = max(200_000, 3 * pixels)
    draw = np.random.default_rng([seed, 1])
    where, times = draw.integers(pixels, size=count), draw.uniform(0.0, 1e6 * count / rate, count)
    asked = sort_events(
        make_events(times.astype(np.int64), where % columns, where // columns, where & 1)
    )
    next(begin([arbiter], iter([(0, np.zeros((rows, columns), np.float32))]), seed))
    left = np.concatenate(list(arbiter.events([asked])))
    # what a pixel asks for while it waits is lost: an event is the first since the one before
    far = 1 << 40
    given, out = (
        np.sort(pixels_of(one, columns).astype(np.int64) * far + one["t"]) for one in (asked, left)
    )
    before = np.maximum(np.append(-1, out[:-1]), out // far * far - 1)
    delay = out - given[np.searchsorted(given, before, "right").clip(max=count - 1)]
    late = np.maximum(delay[out % far > left["t"][-1] // 2], 1)
    span_us = max(int(left["t"][-1] - left["t"][0]), 1)
    middle, low, high = np.quantile(late, (0.5, 0.1, 0.9))
    return 1e6 * left.size / span_us, 1.0 - left.size / count, middle, low, high
