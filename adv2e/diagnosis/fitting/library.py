"""The effects that may be missing, and where their fits start.

In which ranges they are physical, and where a fit of one begins, is declared with their parameters
(:class:`adv2e.parameters.Fit`).  Here stands what depends on the recording or on several keys.

Some effects are there several times: with one key alone, or more of them; the plainest that does as
well is taken.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import asdict, replace
from itertools import zip_longest
from typing import Any

import numpy as np

from adv2e.config import Config, to_dict
from adv2e.config.build import keys_of
from adv2e.config.tree import get_key
from adv2e.config.user_effects import user_effects
from adv2e.diagnosis.configurations import coupling_of
from adv2e.diagnosis.fitting.candidates import Candidate, FitParameter
from adv2e.diagnosis.hints.collect import Hints
from adv2e.diagnosis.hints.lamps import Lamp
from adv2e.diagnosis.hints.readouts import WIDTH, has_pulse
from adv2e.effects.pixel.initial_reference import RANDOM, SETTLED
from adv2e.effects.readout.double_read import DoubleRead
from adv2e.parameters import Fit
from adv2e.reports.markup import BUILT_IN

OF_FRAMES = (
    *("black_level", "exposure_blur", "misregistration", "flicker", "frame_encoding"),
    "frame_coupling",
)
"""Effects on light that frames tell; of known light there are none, but its clock may be off."""
_BETWEEN, _BEYOND, _MOST_STARTS = 0.25, 0.5, 16
"""Of the values where fits under known light begin, on the fitted scale."""
_LEAST_DN = 0.02
"""Of a black level, either way."""
_USUAL, _FARTHEST = 2.0, 10.0
"""Factors on the number of events: up to this, fits find the thresholds from near; most tried."""


def library(declared: Config, hints: Hints) -> list[Candidate]:
    """Return all candidates for what `declared` may lack, with effects of the user's own."""
    coupling = coupling_of(declared)
    if has_pulse(declared):  # it stays where it is
        hints = replace(hints, pulse=None)
    if coupling is not None and (coupling.width_us or coupling.period_us):
        hints = replace(hints, own_period=None)
    every = [*_built_in(declared, hints), *_of_the_user(declared)]
    return [replace(one, pulse=hints.pulse) for one in every]


def of_known_light(declared: Config, hints: Hints) -> list[Candidate]:
    """Return the candidates of :func:`library` that there are where the light is known.

    All pixels do the same at the same time, so that statistics follow keys in steps: a fit that
    does not begin near does not arrive.  What has one key begins at many values.
    """
    every = [one for one in library(declared, hints) if one.name not in OF_FRAMES]
    return [_from_many(one) if len(one.parameters) == 1 else one for one in every]


def _from_many(candidate: Candidate) -> Candidate:
    """Return a candidate of one parameter that begins at more values, about those that it has."""
    (parameter,) = candidate.parameters
    given = [parameter.scaled(start) for (start,) in candidate.starts]
    low, high = min(given) - _BEYOND, max(given) + _BEYOND
    count = min(round((high - low) / _BETWEEN) + 1, _MOST_STARTS)
    more = (parameter.value_at(at) for at in np.linspace(low, high, count).tolist())
    return replace(candidate, starts=(*candidate.starts, *((value,) for value in more)))


def names(config: Config | None = None) -> list[str]:
    """Return the names of all effects that can be found, with those of the user's own."""
    hints = Hints(1.0, (Lamp(100.0),), 10, double_read=DoubleRead(on=0.01, off=0.01))
    built_in = (one.name for one in _built_in(Config(), hints))
    return list(dict.fromkeys([*built_in, *(user_effects(config) if config else ())]))


def _built_in(declared: Config, hints: Hints) -> Iterator[Candidate]:
    values = to_dict(declared)
    yield from _of_the_thresholds(values, hints)
    yield from _of_the_photoreceptor(values)
    yield from _of_the_comparator(hints)
    yield from _of_the_readout(values, hints)
    yield from _of_the_frames(values, hints)


def _fit_of(key: str) -> Fit:
    fit = BUILT_IN[key].fit
    assert fit is not None, key
    return fit


def _parameter(
    key: str, scale: float = 1.0, *, part: tuple[int, int] | None = None, of_pixels: bool = False
) -> FitParameter:
    """Return the number of a key, in the range and on the scale that it is declared with."""
    fit = _fit_of(key)
    return FitParameter(key, fit.low, fit.high, fit.log, scale, part, of_pixels=of_pixels)


def _of_one(name: str, parameter: FitParameter | str, *starts: float, **options: Any) -> Candidate:
    """Return an effect with one key; without `starts`, it begins where that is declared."""
    if isinstance(parameter, str):
        parameter = _parameter(parameter)
    starts = starts or _fit_of(parameter.key).starts
    return Candidate(name, (parameter,), tuple((start,) for start in starts), **options)


def _now(values: dict[str, Any], key: str) -> float:
    """Return the value of a key, or the start of its fit where it has none above zero."""
    held = get_key(values, key)
    return float(held) if isinstance(held, (int, float)) and held > 0 else _fit_of(key).start


def _multiples(key: str, value: float) -> list[float]:
    return [factor * value for factor in _fit_of(key).factors]


def _of_the_user(config: Config) -> Iterator[Candidate]:
    """Yield the effects of the user's own: the parameters that say where they may be fitted.

    One without such parameters is switched on as it is, if it is off.
    """
    for name, effect in user_effects(config).items():
        parameters, begin = [], []
        for key in keys_of(effect.Parameters, f"user.{name}"):
            fit, count = key.about.fit, len(key.parts)
            if fit is None:
                continue
            scale = (fit.high - fit.low) / 10.0
            parts: list[tuple[int, int] | None] = [(n, count) for n in range(count)]
            for part in parts or [None]:
                one = FitParameter(key.path, fit.low, fit.high, fit.log, scale, part)
                parameters.append(one)
                begin.append(fit.start)
        starts = [tuple(begin)]
        for k, one in enumerate(parameters):
            for step in (-1.0, 1.0):
                moved = one.value_at(one.scaled(begin[k]) + step)
                starts.append((*begin[:k], moved, *begin[k + 1 :]))
        if parameters:
            yield Candidate(name, tuple(parameters), tuple(dict.fromkeys(starts)))
        elif get_key(to_dict(config), f"user.{name}") is None:
            yield Candidate(name, (), ((),), ((f"user.{name}", {}),))


def _of_the_thresholds(values: dict[str, Any], hints: Hints) -> Iterator[Candidate]:
    on, off = _parameter("pixel.thresholds.on"), _parameter("pixel.thresholds.off")
    a, b = _now(values, on.key), _now(values, off.key)
    far_on, far_off = (_far_off(ratio) for ratio in hints.too_many)
    yield _of_one("thresholds", on, *_multiples(on.key, a), *(a * far for far in far_on))
    yield _of_one("thresholds", off, *_multiples(off.key, b), *(b * far for far in far_off))
    near = (0.8 * a, 0.8 * b), (1.25 * a, 1.25 * b), (1.25 * a, 0.8 * b)
    far = ((f * a, g * b) for f, g in zip_longest(far_on, far_off, fillvalue=1.0))
    yield Candidate("thresholds", (on, off), (*near, *far))
    # the other way in which pixels may be when the recording begins
    key = "pixel.initial_reference"
    other = SETTLED if get_key(values, key) == RANDOM else RANDOM
    yield Candidate("initial_reference", (), ((),), ((key, other),), of_chance=True)
    key = "pixel.thresholds.mismatch"
    yield _of_one("threshold_mismatch", key, *_multiples(key, _now(values, key)))
    drift = 0.2 / hints.seconds
    drifts = _parameter("pixel.thresholds.drift_per_s", drift)
    # they must not reach zero before the end
    drifts = replace(drifts, low=-0.9 / hints.seconds)
    yield _of_one("threshold_drift", drifts, -drift, drift, 3 * drift)


def _far_off(ratio: float) -> tuple[float, ...]:
    """Return factors on a threshold that may bring far too many or too few events right."""
    if 1.0 / _USUAL < ratio < _USUAL:
        return ()
    whole = min(max(ratio, 1.0 / _FARTHEST), _FARTHEST)
    return whole, math.sqrt(whole)


def _of_the_photoreceptor(values: dict[str, Any]) -> Iterator[Candidate]:
    white, dark = "pixel.low_pass.cutoff_hz", "pixel.low_pass.dark_cutoff_hz"
    # dark corners near none are tried from a little above the least that is fitted
    a, b = _now(values, white), max(_now(values, dark), 5.0 * _fit_of(dark).low)
    off = get_key(values, "pixel.low_pass") is None
    # of a low-pass that is off, the other corner is nothing that was declared
    extra = ((dark, b),) if off else ()
    yield _of_one("low_pass", white, *_multiples(white, a), extra=extra)
    if not off:
        yield _of_one("low_pass", dark, *_multiples(dark, b))
    both = _parameter(white), _parameter(dark)
    yield Candidate("low_pass", both, ((0.4 * a, 0.5 * b), (2.0 * a, 2.0 * b)))
    yield _of_one("dark_current", "pixel.dark_current.dn")
    yield _of_one("source_follower", "pixel.source_follower.cutoff_hz")
    yield _of_one("high_pass", "pixel.high_pass.cutoff_hz")
    if not off:  # they act on it
        yield _of_one("slew_limit", "pixel.slew_limit.per_s")
        least = min(_now(values, f"pixel.thresholds.{sign}") for sign in ("on", "off"))
        rms = (factor * least for factor in (0.12, 0.2, 0.3))
        yield _of_one("photoreceptor_noise", "pixel.photoreceptor_noise.rms", *rms)


def _of_the_comparator(hints: Hints) -> Iterator[Candidate]:
    period, seen = "pixel.refractory.period_us", hints.shortest_us
    fit = _fit_of(period)
    read_off = () if seen is None else (max(seen, fit.low),)
    yield _of_one("refractory", period, *fit.starts, *read_off)
    overshoot = _parameter("pixel.reset_overshoot.fraction", 0.1)
    yield _of_one("reset_overshoot", overshoot)
    yield _of_one("leak", "pixel.leak.rate_hz")
    alone = (("pixel.leak.rate_hz", 0.0),)
    yield _of_one("photo_leak", "pixel.leak.photo_rate_hz", defaults=alone)
    yield _of_one("shot_noise", "pixel.shot_noise.rate_hz")
    share = _parameter("pixel.hot_pixels.fraction", of_pixels=True)
    rate = _parameter("pixel.hot_pixels.rate_hz")
    yield Candidate("hot_pixels", (share, rate), ((0.003, 40.0), (0.01, 150.0)))
    dead = _parameter("pixel.dead_pixels.fraction", of_pixels=True)
    yield _of_one("dead_pixels", dead)


def _of_the_readout(values: dict[str, Any], hints: Hints) -> Iterator[Candidate]:
    yield from _frame_coupling(hints)
    times = _parameter("readout.arbiter.event_ns"), _parameter("readout.arbiter.row_ns")
    starts: tuple[tuple[float, ...], ...] = ((300.0, 3e3), (2e3, 1e4), (3e3, 3e4))
    known: tuple[tuple[float, float], ...] = ()
    service = hints.service
    if service is not None:  # stamps tell both times far better than statistics
        starts += (service[:2],)
        known = tuple(
            (one.scaled(ns), sd_ns / ns)
            for one, ns, sd_ns in zip(times, service[:2], service[2:], strict=True)
        )
    yield Candidate("readout", times, starts, known=known)
    yield _of_one("event_loss", _parameter("readout.loss.fraction", 0.1))
    twice = hints.double_read
    if twice is not None and get_key(values, "readout.double_read") is None:
        keys = ((f"readout.double_read.{key}", value) for key, value in asdict(twice).items())
        yield Candidate("double_read", (), ((),), tuple(keys))
    tick_us = float(hints.tick_us) if hints.tick_us > 1 else 0.0
    if tick_us != (get_key(values, "readout.tick_us") or 0.0):
        yield Candidate("timestamp_tick", (), ((),), (("readout.tick_us", tick_us),))


def _frame_coupling(hints: Hints) -> Iterator[Candidate]:
    """Yield leaps at the end of exposures; or the pulse that bursts of events tell."""
    amplitude = _parameter("readout.frame_coupling.amplitude", 0.05)
    tau = _parameter("readout.frame_coupling.tau_us")
    starts: tuple[tuple[float, ...], ...]
    own, pulse = hints.own_period, hints.pulse
    if pulse is None:
        starts = ((0.05, 300.0), (-0.05, 300.0), (0.05, 1200.0), (0.15, 300.0))
        leaps = Candidate("frame_coupling", (amplitude, tau), starts, readouts=hints.readouts)
        if own is None:
            yield leaps
        else:
            extra = tuple(own.keys.items())
            yield replace(leaps, extra=extra, readouts=None, read_off=own.read_off, is_seen=True)
    up, down = replace(amplitude, low=0.0), replace(amplitude, high=0.0)
    for sign, leap in ((1.0, up), (-1.0, down)):
        of_pulse = pulse.keys(up=leap is up) if pulse else None
        keys = own.keys_of_pulse(up=leap is up) if own else of_pulse
        if keys is None:
            continue
        starts = tuple(
            (sign * size, min(max(widths * keys[WIDTH], tau.low), tau.high))
            for size in (0.03, 0.1)
            for widths in (2.0, 20.0)
        )
        read_off = own.read_off if own else ()
        extra = tuple(keys.items())
        yield Candidate(
            "frame_coupling", (leap, tau), starts, extra, read_off=read_off, is_seen=True
        )


def _either_way(*sizes: float) -> tuple[float, ...]:
    """Return starts of a key on both sides of nothing.

    Sizes should be about a factor of two apart: from half or twice the time, fits of periodic
    scenes do not come to their end.
    """
    return tuple(sign * size for size in sizes for sign in (-1.0, 1.0))


def _of_the_frames(values: dict[str, Any], hints: Hints) -> Iterator[Candidate]:
    # the one is small beside the light or large; how large the other may be, the darkest light says
    black = _parameter("frames.black_level_dn")
    yield _of_one("black_level", replace(black, low=_LEAST_DN, log=True), 0.3, 1.5, 6.0)
    yield _of_one("black_level", replace(black, high=-_LEAST_DN), -0.5, -2.0, -6.0)
    # what changed faster than the exposure is not in the frames; at the true one, up to 0.14 was
    # left in eight recordings with 15 ms
    yield _of_one("exposure_blur", "frames.exposure_us", 4000.0, 15000.0, left=0.15)
    offset, drift = (
        _parameter(f"frames.{key}", 1000.0) for key in ("clock_offset_us", "clock_drift_ppm")
    )
    yield _of_one("clock_offset", offset, *_either_way(600.0, 1300.0, 2900.0, 6300.0))
    yield _of_one("clock_drift", drift, *_either_way(700.0, 1500.0, 3300.0, 7200.0))
    shift = tuple(_parameter("frames.shift_px", 0.3, part=(part, 2)) for part in (0, 1))
    starts = ((0.3, 0.0), (-0.3, 0.0), (0.0, 0.3), (0.0, -0.3))
    # what is finer than a pixel is not in the frames
    yield Candidate("misregistration", shift, starts, left=0.05)
    for lamp in hints.lamps:
        depth, near = _parameter("frames.flicker.depth"), lamp.phase_rad
        turn = _parameter("frames.flicker.phase_rad", 0.1)
        phase = replace(turn, low=near + turn.low, high=near + turn.high)
        lit = ((0.06, near), (0.15, near), (0.35, near))
        yield Candidate("flicker", (depth, phase), lit, (("frames.flicker.frequency_hz", lamp.hz),))
    if get_key(values, "frames.flicker") is not None:
        yield Candidate("flicker", (), ((),), (("frames.flicker", None),))
    held = str(get_key(values, "frames.encoding"))
    here = _exponent(hints.encoding if held == "auto" else held)
    gamma = FitParameter("frames.encoding", 0.2, 5.0, text="gamma:{}", neutral=here)
    yield _of_one("frame_encoding", gamma, *(here * factor for factor in (0.8, 1.15, 1.5)))


def _exponent(encoding: str) -> float:
    """Return the exponent that an encoding has, or is about as steep as."""
    if encoding.startswith("gamma:"):
        return float(encoding.partition(":")[2])
    return {"srgb": 2.2, "bt709": 2.0}.get(encoding, 1.0)
