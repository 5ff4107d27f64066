"""Circuit parameters for the compiled code from the configuration, and choice of the solver."""

from __future__ import annotations

import math

from adv2e.causes import FRAME_COUPLING
from adv2e.config.model import Pixel, Sampling
from adv2e.effects.courses import Additions
from adv2e.effects.pixel.low_pass import UPDATES
from adv2e.effects.pixel.shot_noise import FALL_AT_WHITE
from adv2e.errors import UsageError
from adv2e.kernel import rng
from adv2e.kernel.exact import covers
from adv2e.kernel.inputs import Circuit

_NO_KNEE = 1e300
_PER_US = 1e-6

METHODS = ("auto", "stepped")
"""Solvers of the circuit: the fastest one that covers it, or steps of time."""


def make_circuit(
    pixel: Pixel, sampling: Sampling, seed: int, causes: bool = False, added: int = FRAME_COUPLING
) -> Circuit:
    """Return the circuit of a configuration; rates [1/us], corners [rad/us].

    With `causes`, events have a cause each; `added` is the cause of events by additions to the
    signal.
    """
    low_pass, follower, leak = pixel.low_pass, pixel.source_follower, pixel.leak
    knee_dn = pixel.log_response.linear_below
    corner = 2.0 * math.pi * _PER_US
    dark = low_pass.dark_cutoff_hz if low_pass else 0.0
    white = low_pass.cutoff_hz if low_pass else 0.0
    noise = pixel.photoreceptor_noise
    return Circuit(
        update=UPDATES.index(low_pass.update) if low_pass else 0,
        steps=sampling.K,
        printed=sampling.last_interval == "printed",
        filtered=low_pass is not None,
        dark=corner * dark,
        per_dn=corner * (white - dark) / 255.0,
        slew=pixel.slew_limit.per_s * _PER_US if pixel.slew_limit else 0.0,
        follower=corner * follower.cutoff_hz if follower else 0.0,
        knee=math.log(knee_dn) if knee_dn > 0 else -_NO_KNEE,
        slope=knee_dn / math.log(knee_dn) if knee_dn > 0 else 0.0,
        floor=pixel.log_response.floor,
        dead_time=pixel.refractory.period_us if pixel.refractory else 0.0,
        overshoot=pixel.reset_overshoot.fraction if pixel.reset_overshoot else 0.0,
        leak=leak.rate_hz * _PER_US if leak else 0.0,
        photo_leak=leak.photo_rate_hz * _PER_US / 255.0 if leak else 0.0,
        leak_jitter=leak.jitter if leak else 0.0,
        shot_rate=pixel.shot_noise.rate_hz * _PER_US if pixel.shot_noise else 0.0,
        shot_fall=FALL_AT_WHITE / 255.0,
        hot_rate=(
            pixel.hot_pixels.rate_hz * _PER_US
            if pixel.hot_pixels and pixel.hot_pixels.fraction > 0
            else 0.0
        ),
        hot_spread=math.log(10.0) * pixel.hot_pixels.spread if pixel.hot_pixels else 0.0,
        noise_rms=noise.rms if noise else 0.0,
        noise_step=noise.step if noise else 0.1,
        causes=causes,
        added=added,
        seed=rng.key_of(seed),
    )


def driver_of(pixel: Pixel, circuit: Circuit, additions: Additions | None, method: str) -> str:
    """Return the name of the compiled function that advances these pixels."""
    if method not in METHODS:
        raise UsageError(f"method: must be one of {', '.join(METHODS)}, got {method!r}")
    steps = method == "stepped" or additions is not None or not covers(circuit)
    return "run_stepped" if steps else "run_exact"
