"""The state of all pixels before the first frame: thresholds, references, first noise events."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.causes import FRAME_COUPLING
from adv2e.config.model import Pixel, Sampling
from adv2e.effects.hooks import LONGEST_US, Hooks
from adv2e.effects.pixel.initial_reference import RANDOM, RUNNING
from adv2e.effects.pixel.low_pass import UPDATES
from adv2e.effects.pixel.shot_noise import FALL_AT_WHITE
from adv2e.effects.pixel.thresholds import FLOOR
from adv2e.errors import UsageError
from adv2e.kernel import exact, per_pixel, rng, unfiltered
from adv2e.kernel.inputs import Circuit
from adv2e.kernel.leak import fill_first_factors, fill_running
from adv2e.kernel.noise import (
    fill_first_candidates,
    fill_first_hot_times,
    fill_first_noise,
)
from adv2e.kernel.per_pixel import fill_levels, fill_random_reference
from adv2e.kernel.photoreceptor.exits import exits
from adv2e.kernel.photoreceptor.law import noise_of
from adv2e.kernel.photoreceptor.running import fill_running_noise
from adv2e.kernel.stepped.signal import log_of_light
from adv2e.pixel.steps import Stepping

_State = NDArray[np.float64]


def initial_state(
    pixel: Pixel,
    circuit: Circuit,
    first: NDArray[Any],
    start: float,
    stepping: Stepping | None,
    threads: int,
) -> _State:
    """Return the state of all pixels before the first frame, (rows of the state, pixels).

    `first` is the light of the first frame [DN] at `start` us; `stepping` that of a circuit that is
    solved in steps of time.
    """
    fill = partial(_over_pixels, threads, first.size)
    seed = circuit.seed
    # rows that nothing writes to take no memory
    state = np.zeros((per_pixel.ROWS, first.size))
    least = 0.0 if circuit.slope > 0.0 else circuit.floor
    light = np.maximum(first.reshape(-1), least, dtype=float)
    log_of_light(light, circuit, state[per_pixel.X])
    levels = pixel.thresholds
    on, off = state[per_pixel.ON], state[per_pixel.OFF]
    means, spare = (levels.on, levels.off), state[per_pixel.REFERENCE]
    fill(fill_levels, seed, *means, levels.mismatch, FLOOR, on, off, spare)
    state[per_pixel.REFERENCE] = state[per_pixel.X]
    state[per_pixel.HOLD] = -1.0
    if pixel.initial_reference == RANDOM:
        fill_random_reference(seed, on, off, state[per_pixel.X], state[per_pixel.REFERENCE])
    if circuit.shot_rate > 0:
        times = state[per_pixel.SHOT_TIME]
        draws = state[per_pixel.SHOT_DRAW]
        fill(fill_first_candidates, seed, circuit.shot_rate, start, times, draws)
    if pixel.hot_pixels and circuit.hot_rate > 0:
        share, times = pixel.hot_pixels.fraction, state[per_pixel.HOT_TIME]
        rate, spread = circuit.hot_rate, circuit.hot_spread
        fill_first_hot_times(seed, share, rate, spread, start, times)
    if stepping is not None:
        _rest_poles(state, stepping)
    lit, on_level, off_level = light, np.ones(first.size), np.ones(first.size)
    if stepping is not None:
        lit = stepping.first_light(light)
        on_level *= stepping.first_level("on")
        off_level *= stepping.first_level("off")
    noise, running = circuit.noise_rms > 0, pixel.initial_reference == RUNNING
    if noise and running:
        cell, tables = noise_of(circuit, 0.0, LONGEST_US).cell, exits()
        fill(fill_running_noise, circuit, cell, start, lit, on_level, off_level, tables, state)
    elif noise:
        fill(fill_first_noise, circuit, lit, state)
    if noise and stepping is not None:
        state[per_pixel.SECOND] += state[per_pixel.SEEN]
    if circuit.high > 0:  # it rests on the signal
        state[per_pixel.SLOW] += state[per_pixel.FIRST]
        state[per_pixel.REFERENCE] -= state[per_pixel.FIRST]
    reset = state[per_pixel.REFERENCE].copy() if circuit.causes else None
    if running and not noise and (circuit.leak > 0 or circuit.photo_leak > 0):
        fill(fill_running, circuit, start, lit, on_level, state)
    elif circuit.leak_jitter > 0 and not (noise and running):
        fill_first_factors(seed, circuit.leak_jitter, state[per_pixel.LEAK_FACTOR])
    if reset is not None:
        added = 0.0 if stepping is None else stepping.first_signal()
        state[per_pixel.RESET_ADDED] = added
        if noise and running:
            state[per_pixel.RESET_LIGHT] -= added
        else:
            _note_resets(state, circuit, reset)
    return state


def _note_resets(state: _State, circuit: Circuit, reference: _State) -> None:
    """Fill the rows that causes follow from; `reference`: without what leak has done before.

    Where references are random, the light has moved from there.
    """
    seen = state[per_pixel.SEEN]
    state[per_pixel.RESET_LIGHT] = reference - seen - state[per_pixel.RESET_ADDED]
    state[per_pixel.RESET_NOISE] = seen
    began = state[per_pixel.REFERENCE] != reference  # a cycle, by a reset
    beyond = np.where(began, circuit.overshoot * state[per_pixel.ON], 0.0)
    held = state[per_pixel.HOLD] >= 0.0
    state[per_pixel.RESET] = np.where(held, per_pixel.NEVER, reference + beyond)


def _rest_poles(state: _State, stepping: Stepping) -> None:
    """Fill the rows of a state that only steps of time have; all poles are at rest."""
    driven = stepping.first_driven(state[per_pixel.X])
    state[per_pixel.FIRST] = driven
    state[per_pixel.SECOND] = driven
    state[per_pixel.REFERENCE] += driven - state[per_pixel.X] + stepping.first_signal()


def _over_pixels(threads: int, pixels: int, fill: Callable[..., None], *arguments: Any) -> None:
    """Call `fill` for ranges of pixels, in threads: drawing for all of them takes its time."""
    if threads == 1:
        fill(0, pixels, *arguments)
        return
    borders = np.linspace(0, pixels, threads + 1).astype(int).tolist()
    with ThreadPoolExecutor(threads) as pool:
        for done in [
            pool.submit(fill, lo, hi, *arguments) for lo, hi in itertools.pairwise(borders)
        ]:
            done.result()


# ---- Circuit parameters for the compiled code from the configuration, and choice of the solver.


_NO_KNEE = 1e300
_PER_US = 1e-6

METHODS = ("auto", "stepped")
"""Solvers of the circuit: the fastest one that covers it, or steps of time."""


def make_circuit(
    pixel: Pixel, sampling: Sampling, seed: int, causes: bool = False, added: int = FRAME_COUPLING
) -> Circuit:
    """Return the circuit of a configuration; rates [1/us], corners [rad/us].

    With `causes`, events have a cause each; `added` is the cause of events by what effects add to
    the signal.
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
        high=corner * pixel.high_pass.cutoff_hz if pixel.high_pass else 0.0,
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
        hot_off=pixel.hot_pixels.off_fraction if pixel.hot_pixels else 0.0,
        noise_rms=noise.rms if noise else 0.0,
        noise_step=noise.step if noise else 0.1,
        causes=causes,
        added=added,
        seed=rng.key_of(seed),
    )


def driver_of(pixel: Pixel, circuit: Circuit, inside: Sequence[Hooks], method: str) -> str:
    """Return the name of the compiled function that advances pixels with effects inside them."""
    if method not in METHODS:
        raise UsageError(f"method: must be one of {', '.join(METHODS)}, got {method!r}")
    if method == "stepped" or inside:
        return "run_stepped"
    if exact.covers(circuit):
        return "run_exact"
    is_bare = pixel.thresholds.drift_per_s == 0.0 and unfiltered.covers(circuit)
    return "run_unfiltered" if is_bare else "run_stepped"
