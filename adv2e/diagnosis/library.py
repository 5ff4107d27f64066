"""The effects that may be missing, where their fits start, and in which ranges they are physical.

Some effects are there several times: with one key alone, or more of them; the plainest that does as
well is taken.  An effect whose keys the configuration does not have is left out.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from adv2e.config import Config, to_dict
from adv2e.config.build import keys_of
from adv2e.config.paths import get_key
from adv2e.diagnosis.candidates import Candidate, Knob
from adv2e.diagnosis.evidence import Evidence
from adv2e.diagnosis.keys import known_keys, user_effects
from adv2e.diagnosis.lamps import Lamp
from adv2e.diagnosis.readouts import Readouts, readouts_of
from adv2e.diagnosis.stamps import Service, service_times, tick_of


@dataclass(frozen=True)
class Hints:
    """What a look at the recording says of where fits may start.

    Attributes
    ----------
    seconds : float
        Length of the recording.
    lamps : tuple of Lamp
        Of the strongest lines in the rate.
    tick_us : int
        Largest time of which nearly all stamps are multiples.
    encoding : str
        What ``frames.encoding: auto`` means for the frames.
    service : Service, optional
        Times that an event and a row take, where stamps look as if they had waited for a channel.
    readouts : Readouts, optional
        Of frames, where all pixels fire at once after each.
    """

    seconds: float
    lamps: tuple[Lamp, ...]
    tick_us: int
    encoding: str = "linear"
    service: Service | None = None
    readouts: Readouts | None = None


def library(declared: Config, hints: Hints) -> list[Candidate]:
    """Return all candidates for what `declared` may lack."""
    known = known_keys(type(declared))
    built_in = [one for one in _all(declared, hints) if all(key in known for key in _keys_of(one))]
    return [*built_in, *_of_the_user(declared)]


def _all(declared: Config, hints: Hints) -> list[Candidate]:
    values = to_dict(declared)

    def now(key: str, otherwise: float) -> float:
        held = get_key(values, key)
        return float(held) if isinstance(held, (int, float)) and held > 0 else otherwise

    def times(key: str, otherwise: float, *factors: float) -> tuple[tuple[float, ...], ...]:
        return tuple((now(key, otherwise) * factor,) for factor in factors)

    made: list[Candidate] = []
    for build in _BUILDERS:
        made += build(now, times, values, hints)
    return made


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


_Now = Callable[[str, float], float]
_Times = Callable[..., tuple[tuple[float, ...], ...]]


def _of_the_thresholds(now: _Now, times: _Times, values: Any, hints: Hints) -> list[Candidate]:
    on = Knob("pixel.thresholds.on", 0.01, 5.0)
    off = Knob("pixel.thresholds.off", 0.01, 5.0)
    a, b = now(on.key, 0.2), now(off.key, 0.2)
    drift = 0.2 / hints.seconds
    spread = "pixel.thresholds.mismatch"
    return [
        Candidate("thresholds", (on,), times(on.key, 0.2, 0.8, 1.25)),
        Candidate("thresholds", (off,), times(off.key, 0.2, 0.8, 1.25)),
        Candidate(
            "thresholds", (on, off), ((0.8 * a, 0.8 * b), (1.25 * a, 1.25 * b), (1.25 * a, 0.8 * b))
        ),
        Candidate(
            "threshold_mismatch", (Knob(spread, 1e-3, 0.5),), times(spread, 0.02, 0.5, 2.0, 4.0)
        ),
        Candidate(
            "threshold_drift",
            (Knob("pixel.thresholds.drift_per_s", -0.9 / hints.seconds, 20.0, False, drift),),
            ((-drift,), (drift,), (3 * drift,)),
        ),
    ]


def _of_the_photoreceptor(now: _Now, times: _Times, values: Any, hints: Hints) -> list[Candidate]:
    white = Knob("pixel.low_pass.cutoff_hz", 1.0, 1e5)
    dark = Knob("pixel.low_pass.dark_cutoff_hz", 0.05, 1e4)
    a, b = now(white.key, 300.0), now(dark.key, 20.0)
    made = [
        Candidate("low_pass", (white,), times(white.key, 300.0, 0.25, 0.6, 2.0)),
        Candidate("low_pass", (dark,), times(dark.key, 20.0, 0.3, 3.0)),
        Candidate("low_pass", (white, dark), ((0.4 * a, 0.5 * b), (2.0 * a, 2.0 * b))),
        Candidate(
            "dark_current",
            (Knob("pixel.dark_current.dn", 0.02, 200.0),),
            ((0.5,), (3.0,), (15.0,)),
        ),
        Candidate(
            "source_follower",
            (Knob("pixel.source_follower.cutoff_hz", 2.0, 1e5),),
            ((20.0,), (60.0,), (200.0,), (600.0,)),
        ),
    ]
    if get_key(values, "pixel.low_pass") is None:  # the others act on it
        return made
    least = min(now("pixel.thresholds.on", 0.2), now("pixel.thresholds.off", 0.2))
    return [
        *made,
        Candidate(
            "slew_limit",
            (Knob("pixel.slew_limit.per_s", 0.5, 1e4),),
            ((10.0,), (30.0,), (90.0,)),
        ),
        Candidate(
            "photoreceptor_noise",
            (Knob("pixel.photoreceptor_noise.rms", 1e-3, 0.5),),
            tuple((f * least,) for f in (0.12, 0.2, 0.3)),
        ),
    ]


def _of_the_comparator(now: _Now, times: _Times, values: Any, hints: Hints) -> list[Candidate]:
    return [
        Candidate(
            "refractory",
            (Knob("pixel.refractory.period_us", 1.0, 2e6),),
            ((1500.0,), (5000.0,), (15000.0,)),
        ),
        Candidate(
            "reset_overshoot",
            (Knob("pixel.reset_overshoot.fraction", -0.9, 0.9, False, 0.1),),
            ((-0.1,), (0.1,), (0.25,)),
        ),
        Candidate(
            "leak", (Knob("pixel.leak.rate_hz", 1e-3, 500.0),), ((0.6,), (2.0,), (6.0,))
        ),
        Candidate(
            "photo_leak",
            (Knob("pixel.leak.photo_rate_hz", 1e-2, 1000.0),),
            ((1.5,), (5.0,), (15.0,)),
            defaults=(("pixel.leak.rate_hz", 0.0),),
        ),
        Candidate(
            "shot_noise", (Knob("pixel.shot_noise.rate_hz", 1e-3, 500.0),),
            ((0.3,), (3.0,), (10.0,)),
        ),
        Candidate(
            "hot_pixels",
            (
                Knob("pixel.hot_pixels.fraction", 2e-4, 0.2, of_pixels=True),
                Knob("pixel.hot_pixels.rate_hz", 1.0, 2e4),
            ),
            ((0.003, 40.0), (0.01, 150.0)),
        ),
        Candidate(
            "dead_pixels",
            (Knob("pixel.dead_pixels.fraction", 2e-4, 0.9, of_pixels=True),),
            ((0.005,), (0.03,)),
        ),
    ]  # fmt: skip


def _of_the_readout(now: _Now, times: _Times, values: Any, hints: Hints) -> list[Candidate]:
    amplitude = Knob("readout.frame_coupling.amplitude", -2.0, 2.0, False, 0.05)
    tau = Knob("readout.frame_coupling.tau_us", 20.0, 1e5)
    made = [
        Candidate(
            "frame_coupling",
            (amplitude, tau),
            ((0.05, 300.0), (-0.05, 300.0), (0.05, 1200.0), (0.15, 300.0)),
            readouts=hints.readouts,
        ),
        _arbiter(hints.service),
        Candidate(
            "event_loss",
            (Knob("readout.loss.fraction", 1e-3, 0.95, False, 0.1),),
            ((0.05,), (0.2,), (0.45,)),
        ),
    ]
    if hints.tick_us > 1:
        tick = ("readout.tick_us", float(hints.tick_us))
        made.append(Candidate("timestamp_tick", (), ((),), (tick,)))
    return made


def _arbiter(service: Service | None) -> Candidate:
    """Return the readout with its two times, which stamps may tell far better than statistics."""
    times = Knob("readout.arbiter.event_ns", 1.0, 1e6), Knob("readout.arbiter.row_ns", 1.0, 1e7)
    probes = ((300.0, 3000.0), (2000.0, 10000.0), (3000.0, 30000.0))
    if service is None:
        return Candidate("readout", times, probes)
    event, row = times
    known = (
        (event.inner(service.event_ns), service.event_sd_ns / service.event_ns),
        (row.inner(service.row_ns), service.row_sd_ns / service.row_ns),
    )
    return Candidate("readout", times, (*probes, service[:2]), known=known)


def _of_the_frames(now: _Now, times: _Times, values: Any, hints: Hints) -> list[Candidate]:
    offset = Knob("frames.clock_offset_us", -1e6, 1e6, False, 1000.0)
    drift = Knob("frames.clock_drift_ppm", -1e5, 1e5, False, 1000.0)
    shift = tuple(Knob("frames.shift_px", -20.0, 20.0, False, 0.3, (part, 2)) for part in (0, 1))
    made = [
        Candidate(
            "black_level",
            (Knob("frames.black_level_dn", 0.02, 100.0),),
            ((0.3,), (1.5,), (6.0,)),
        ),
        Candidate(
            "exposure_blur",
            (Knob("frames.exposure_us", 100.0, 2e5),),
            ((4000.0,), (15000.0,)),
            # what changed faster than the exposure is not in the frames; at the true one, up to
            # 0.14 was left in eight recordings with 15 ms
            left=0.15,
        ),
        Candidate(
            "clock_offset",
            (offset,),
            ((-600.0,), (600.0,), (-3000.0,), (3000.0,)),
        ),
        Candidate("clock_drift", (drift,), ((-1500.0,), (1500.0,), (-6000.0,), (6000.0,))),
        Candidate(
            "misregistration",
            shift,
            ((0.3, 0.0), (-0.3, 0.0), (0.0, 0.3), (0.0, -0.3)),
            left=0.05,  # what is finer than a pixel is not in the frames
        ),
    ]  # fmt: skip
    for lamp in hints.lamps:
        depth = Knob("frames.flicker.depth", 0.005, 0.99)
        read_off = ("frames.flicker.frequency_hz", lamp.hz)
        near = lamp.phase_rad
        phase = Knob("frames.flicker.phase_rad", near - math.pi, near + math.pi, False, 0.1)
        probes = ((0.06, near), (0.15, near), (0.35, near))
        made.append(Candidate("flicker", (depth, phase), probes, (read_off,)))
    made += _encodings(values, hints)
    return made


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
    return 2.2 if encoding == "srgb" else 1.0


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


def hints_of(evidence: Evidence, lamps: Sequence[Lamp]) -> Hints:
    """Return hints from a recording, and the lamps that may have lit it."""
    stream = evidence.stream
    return Hints(
        evidence.seconds,
        tuple(lamps),
        tick_of(stream.t),
        evidence.encoding,
        service_times(stream),
        readouts_of(stream, evidence.times_s),
    )
