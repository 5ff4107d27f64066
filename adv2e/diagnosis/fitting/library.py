"""The effects that may be missing, and where their fits start.

In which ranges they are physical is declared with their parameters (:class:`adv2e.parameters.Fit`).

Some effects are there several times: with one key alone, or more of them; the plainest that does as
well is taken.  An effect whose keys the configuration does not have is left out.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping
from itertools import zip_longest
from typing import Any

from adv2e.config import Config, to_dict
from adv2e.config.build import keys_of
from adv2e.config.own import user_effects
from adv2e.config.paths import get_key
from adv2e.diagnosis.fitting.candidates import Candidate, Knob
from adv2e.diagnosis.fitting.keys import known_keys
from adv2e.diagnosis.hints.collect import Hints
from adv2e.diagnosis.hints.lamps import Lamp
from adv2e.diagnosis.hints.pulses import WIDTH, has_pulse
from adv2e.diagnosis.hints.stamps import Service
from adv2e.effects.pixel.initial_reference import RANDOM, SETTLED
from adv2e.parameters import Fit

_DECLARED = known_keys(Config)


def library(declared: Config, hints: Hints) -> list[Candidate]:
    """Return all candidates for what `declared` may lack."""
    known = known_keys(type(declared))
    if has_pulse(declared):  # it stays where it is
        hints = dataclasses.replace(hints, pulse=None)
    built_in = [one for one in _all(declared, hints) if all(key in known for key in _keys_of(one))]
    every = [*built_in, *_of_the_user(declared)]
    return [dataclasses.replace(one, pulse=hints.pulse) for one in every]


def _all(declared: Config, hints: Hints) -> list[Candidate]:
    values = to_dict(declared)

    def now(key: str) -> float:
        held = get_key(values, key)
        return float(held) if isinstance(held, (int, float)) and held > 0 else _fit_of(key).start

    def times(key: str, *factors: float) -> tuple[tuple[float, ...], ...]:
        return tuple((now(key) * factor,) for factor in factors)

    made: list[Candidate] = []
    for build in _BUILDERS:
        made += build(now, times, values, hints)
    return made


def _fit_of(key: str) -> Fit:
    """Return where the parameter of a key is declared to be fitted."""
    fit = _DECLARED[key].fit
    assert fit is not None, key
    return fit


def _knob(
    key: str, scale: float = 1.0, *, part: tuple[int, int] | None = None, of_pixels: bool = False
) -> Knob:
    """Return the knob on a key, in the range and on the scale that it is declared with."""
    fit = _fit_of(key)
    return Knob(key, fit.low, fit.high, fit.log, scale, part, of_pixels=of_pixels)


def _keys_of(candidate: Candidate) -> list[str]:
    return [knob.key for knob in candidate.knobs] + [key for key, _ in candidate.extra]


def _of_the_user(config: Config) -> list[Candidate]:
    """Return the effects of the user's own: the parameters that say where they may be fitted.

    One without such parameters is switched on as it is, if it is off.
    """
    made = []
    values = to_dict(config)
    for name, effect in user_effects(config).items():
        knobs, starts = [], []
        for key in keys_of(effect.Parameters, f"user.{name}"):
            fit, count = key.about.fit, len(key.parts)
            if fit is None:
                continue
            scale = (fit.high - fit.low) / 10.0
            parts = [(n, count) for n in range(count)] if count else [None]
            for part in parts:
                knobs.append(Knob(key.path, fit.low, fit.high, fit.log, scale, part))
                starts.append(fit.start)
        milder = [knob.outer(knob.inner(v) - 1.0) for knob, v in zip(knobs, starts, strict=True)]
        more = [knob.outer(knob.inner(v) + 1.0) for knob, v in zip(knobs, starts, strict=True)]
        probes = [tuple(starts)]
        for k in range(len(knobs)):
            probes += [(*starts[:k], other[k], *starts[k + 1 :]) for other in (milder, more)]
        if knobs:
            made.append(Candidate(name, tuple(knobs), tuple(dict.fromkeys(probes))))
        elif get_key(values, f"user.{name}") is None:
            made.append(Candidate(name, (), ((),), ((f"user.{name}", {}),)))
    return made


_LEAST_DN = 0.02
"""Of a black level, either way."""

_Now = Callable[[str], float]
_Times = Callable[..., tuple[tuple[float, ...], ...]]


def _of_the_thresholds(now: _Now, times: _Times, values: Any, hints: Hints) -> list[Candidate]:
    on, off = _knob("pixel.thresholds.on"), _knob("pixel.thresholds.off")
    a, b = now(on.key), now(off.key)
    far_on, far_off = (_far_off(ratio) for ratio in hints.too_many)
    spread = _knob("pixel.thresholds.mismatch")
    drift = 0.2 / hints.seconds
    drifts = _knob("pixel.thresholds.drift_per_s", drift)
    # they must not reach zero before the end
    drifts = dataclasses.replace(drifts, low=-0.9 / hints.seconds)
    return [
        Candidate("thresholds", (on,), times(on.key, 0.8, 1.25, *far_on)),
        Candidate("thresholds", (off,), times(off.key, 0.8, 1.25, *far_off)),
        Candidate(
            "thresholds",
            (on, off),
            (
                *((0.8 * a, 0.8 * b), (1.25 * a, 1.25 * b), (1.25 * a, 0.8 * b)),
                *((f * a, g * b) for f, g in zip_longest(far_on, far_off, fillvalue=1.0)),
            ),
        ),
        _start(values),
        Candidate("threshold_mismatch", (spread,), times(spread.key, 0.5, 2.0, 4.0)),
        Candidate("threshold_drift", (drifts,), ((-drift,), (drift,), (3 * drift,))),
    ]


_USUAL, _FARTHEST = 2.0, 10.0
"""Factors on the number of events: up to this, fits find the thresholds from near; most tried."""


def _far_off(ratio: float) -> tuple[float, ...]:
    """Return factors on a threshold that may bring far too many or too few events right."""
    if 1.0 / _USUAL < ratio < _USUAL:
        return ()
    whole = min(max(ratio, 1.0 / _FARTHEST), _FARTHEST)
    return whole, math.sqrt(whole)


def _start(values: Any) -> Candidate:
    """Return the other way in which pixels may be when the recording begins."""
    key = "pixel.initial_reference"
    other = SETTLED if get_key(values, key) == RANDOM else RANDOM
    return Candidate("initial_reference", (), ((),), ((key, other),), of_chance=True)


def _of_the_photoreceptor(now: _Now, times: _Times, values: Any, hints: Hints) -> list[Candidate]:
    white, dark = _knob("pixel.low_pass.cutoff_hz"), _knob("pixel.low_pass.dark_cutoff_hz")
    a, b = now(white.key), now(dark.key)
    off = get_key(values, "pixel.low_pass") is None
    made = [
        # of a low-pass that is off, the other corner is nothing that was declared
        Candidate(
            "low_pass", (white,), times(white.key, 0.25, 0.6, 2.0), ((dark.key, b),) if off else ()
        ),
        *([] if off else [Candidate("low_pass", (dark,), times(dark.key, 0.3, 3.0))]),
        Candidate("low_pass", (white, dark), ((0.4 * a, 0.5 * b), (2.0 * a, 2.0 * b))),
        Candidate("dark_current", (_knob("pixel.dark_current.dn"),), ((0.5,), (3.0,), (15.0,))),
        Candidate(
            "source_follower",
            (_knob("pixel.source_follower.cutoff_hz"),),
            ((20.0,), (60.0,), (200.0,), (600.0,)),
        ),
    ]
    if off:  # the others act on it
        return made
    least = min(now("pixel.thresholds.on"), now("pixel.thresholds.off"))
    return [
        *made,
        Candidate("slew_limit", (_knob("pixel.slew_limit.per_s"),), ((10.0,), (30.0,), (90.0,))),
        Candidate(
            "photoreceptor_noise",
            (_knob("pixel.photoreceptor_noise.rms"),),
            tuple((f * least,) for f in (0.12, 0.2, 0.3)),
        ),
    ]


def _of_the_comparator(now: _Now, times: _Times, values: Any, hints: Hints) -> list[Candidate]:
    return [
        Candidate(
            "refractory",
            (_knob("pixel.refractory.period_us"),),
            ((1500.0,), (5000.0,), (15000.0,)),
        ),
        Candidate(
            "reset_overshoot",
            (_knob("pixel.reset_overshoot.fraction", 0.1),),
            ((-0.1,), (0.1,), (0.25,)),
        ),
        Candidate(
            "leak", (_knob("pixel.leak.rate_hz"),), ((0.6,), (2.0,), (6.0,))
        ),
        Candidate(
            "photo_leak",
            (_knob("pixel.leak.photo_rate_hz"),),
            ((1.5,), (5.0,), (15.0,)),
            defaults=(("pixel.leak.rate_hz", 0.0),),
        ),
        Candidate(
            "shot_noise", (_knob("pixel.shot_noise.rate_hz"),),
            ((0.3,), (3.0,), (10.0,)),
        ),
        Candidate(
            "hot_pixels",
            (
                _knob("pixel.hot_pixels.fraction", of_pixels=True),
                _knob("pixel.hot_pixels.rate_hz"),
            ),
            ((0.003, 40.0), (0.01, 150.0)),
        ),
        Candidate(
            "dead_pixels",
            (_knob("pixel.dead_pixels.fraction", of_pixels=True),),
            ((0.005,), (0.03,)),
        ),
    ]  # fmt: skip


def _of_the_readout(now: _Now, times: _Times, values: Any, hints: Hints) -> list[Candidate]:
    made = [
        *_frame_coupling(hints),
        _arbiter(hints.service),
        Candidate(
            "event_loss",
            (_knob("readout.loss.fraction", 0.1),),
            ((0.05,), (0.2,), (0.45,)),
        ),
    ]
    tick_us = float(hints.tick_us) if hints.tick_us > 1 else 0.0
    if tick_us != (get_key(values, "readout.tick_us") or 0.0):
        made.append(Candidate("timestamp_tick", (), ((),), (("readout.tick_us", tick_us),)))
    return made


def _frame_coupling(hints: Hints) -> list[Candidate]:
    """Return leaps at the end of exposures; or the pulse that bursts of events tell."""
    amplitude = _knob("readout.frame_coupling.amplitude", 0.05)
    tau = _knob("readout.frame_coupling.tau_us")
    if hints.pulse is None:
        probes = ((0.05, 300.0), (-0.05, 300.0), (0.05, 1200.0), (0.15, 300.0))
        return [
            Candidate("frame_coupling", (amplitude, tau), probes, readouts=hints.readouts),
        ]
    made = []
    for sign in (1.0, -1.0):
        leap = (
            dataclasses.replace(amplitude, low=0.0)
            if sign > 0.0
            else dataclasses.replace(amplitude, high=0.0)
        )
        keys = hints.pulse.keys(up=sign > 0.0)
        starts = tuple(
            (sign * size, min(max(widths * keys[WIDTH], tau.low), tau.high))
            for size in (0.03, 0.1)
            for widths in (2.0, 20.0)
        )
        made.append(Candidate("frame_coupling", (leap, tau), starts, tuple(keys.items())))
    return made


def _arbiter(service: Service | None) -> Candidate:
    """Return the readout with its two times, which stamps may tell far better than statistics."""
    times = _knob("readout.arbiter.event_ns"), _knob("readout.arbiter.row_ns")
    probes = ((300.0, 3000.0), (2000.0, 10000.0), (3000.0, 30000.0))
    if service is None:
        return Candidate("readout", times, probes)
    event, row = times
    known = (
        (event.inner(service.event_ns), service.event_sd_ns / service.event_ns),
        (row.inner(service.row_ns), service.row_sd_ns / service.row_ns),
    )
    return Candidate("readout", times, (*probes, service[:2]), known=known)


def _either_way(*sizes: float) -> tuple[tuple[float, ...], ...]:
    """Return probes of a key on both sides of nothing.

    Sizes should be about a factor of two apart: from half or twice the time, fits of periodic
    scenes do not come to their end.
    """
    return tuple((sign * size,) for size in sizes for sign in (-1.0, 1.0))


def _of_the_frames(now: _Now, times: _Times, values: Any, hints: Hints) -> list[Candidate]:
    offset = _knob("frames.clock_offset_us", 1000.0)
    drift = _knob("frames.clock_drift_ppm", 1000.0)
    shift = tuple(_knob("frames.shift_px", 0.3, part=(part, 2)) for part in (0, 1))
    made = [
        *_black_levels(),
        Candidate(
            "exposure_blur",
            (_knob("frames.exposure_us"),),
            ((4000.0,), (15000.0,)),
            # what changed faster than the exposure is not in the frames; at the true one, up to
            # 0.14 was left in eight recordings with 15 ms
            left=0.15,
        ),
        Candidate(
            "clock_offset",
            (offset,),
            _either_way(600.0, 1300.0, 2900.0, 6300.0),
        ),
        Candidate("clock_drift", (drift,), _either_way(700.0, 1500.0, 3300.0, 7200.0)),
        Candidate(
            "misregistration",
            shift,
            ((0.3, 0.0), (-0.3, 0.0), (0.0, 0.3), (0.0, -0.3)),
            left=0.05,  # what is finer than a pixel is not in the frames
        ),
    ]  # fmt: skip
    for lamp in hints.lamps:
        depth = _knob("frames.flicker.depth")
        read_off = ("frames.flicker.frequency_hz", lamp.hz)
        near = lamp.phase_rad
        turn = _knob("frames.flicker.phase_rad", 0.1)
        phase = dataclasses.replace(turn, low=near + turn.low, high=near + turn.high)
        probes = ((0.06, near), (0.15, near), (0.35, near))
        made.append(Candidate("flicker", (depth, phase), probes, (read_off,)))
    if get_key(values, "frames.flicker") is not None:
        made.append(Candidate("flicker", (), ((),), (("frames.flicker", None),)))
    made += _encodings(values, hints)
    return made


def _black_levels() -> list[Candidate]:
    """Return what the frames lack, and what is too much in them.

    The one is small beside the light or large; how large the other may be, the darkest light says.
    """
    knob = _knob("frames.black_level_dn")
    lack = dataclasses.replace(knob, low=_LEAST_DN, log=True)
    excess = dataclasses.replace(knob, high=-_LEAST_DN)
    return [
        Candidate("black_level", (lack,), ((0.3,), (1.5,), (6.0,))),
        Candidate("black_level", (excess,), ((-0.5,), (-2.0,), (-6.0,))),
    ]


def _encodings(values: Mapping[str, Any], hints: Hints) -> list[Candidate]:
    held = str(get_key(values, "frames.encoding"))
    here = _exponent(hints.encoding if held == "auto" else held)
    gamma = Knob("frames.encoding", 0.2, 5.0, text="gamma:{}", neutral=here)
    return [
        Candidate("frame_encoding", (gamma,), tuple((here * f,) for f in (0.8, 1.15, 1.5))),
    ]


def _exponent(encoding: str) -> float:
    """Return the exponent that an encoding has, or is about as steep as."""
    if encoding.startswith("gamma:"):
        return float(encoding.partition(":")[2])
    return {"srgb": 2.2, "bt709": 2.0}.get(encoding, 1.0)


_BUILDERS = (
    _of_the_thresholds,
    _of_the_photoreceptor,
    _of_the_comparator,
    _of_the_readout,
    _of_the_frames,
)


def names(config: Config | None = None) -> list[str]:
    """Return the names of all effects that can be found, with those of the user's own."""
    built_in = (one.name for one in _all(Config(), Hints(1.0, (Lamp(100.0),), 10)))
    return list(dict.fromkeys([*built_in, *(user_effects(config) if config else ())]))
