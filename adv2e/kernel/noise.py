"""Events and noise that come by themselves: shot noise, hot pixels, photoreceptor noise.

The equations are those of the modules of these names in :mod:`adv2e.effects.pixel`.
"""

from __future__ import annotations

import math

import numpy as np

from adv2e.compiled import entry, inlined, kernel
from adv2e.kernel import rng
from adv2e.kernel.workspace import (
    NEVER,
    S_HOT_DRAW,
    S_HOT_TIME,
    S_SHOT_DRAW,
    S_SHOT_TIME,
    Array,
    Circuit,
)


@inlined
def next_candidate_time(i: int, circuit: Circuit, state: Array) -> None:
    """Move pixel i on to its next candidate."""
    state[S_SHOT_DRAW, i] += 1
    wait = rng.exponential(circuit.seed, rng.SHOT_TIME, i, state[S_SHOT_DRAW, i])
    state[S_SHOT_TIME, i] += wait / circuit.shot_rate


@inlined
def candidate_polarity(i: int, light: float, circuit: Circuit, state: Array) -> int:
    """Return what the present candidate of pixel i becomes at this light [DN]: 1, -1, 0 nothing."""
    u, v = rng.uniforms(circuit.seed, rng.SHOT_KIND, i, state[S_SHOT_DRAW, i])
    if u >= 1.0 - circuit.shot_fall * light:
        return 0
    return 1 if v < 0.5 else -1


@entry
def fill_first_candidates(
    lo: int, hi: int, seed: np.uint64, rate: float, start: float, times: Array, draws: Array
) -> None:
    """Draw the first candidate time [us] of the pixels lo..hi; rate in events a us.

    `draws`, how often each has drawn since, becomes 0.
    """
    u, spare = times[lo:hi], draws[lo:hi]
    rng.uniforms_of_pixels(seed, rng.SHOT_TIME, lo, u, spare)
    for k in range(hi - lo):
        u[k] = start + -math.log(u[k]) / rate
        spare[k] = 0.0


@inlined
def next_hot_time(i: int, circuit: Circuit, state: Array) -> None:
    """Move hot pixel i on to its next event."""
    state[S_HOT_DRAW, i] += 1
    wait = rng.exponential(circuit.seed, rng.HOT_TIME, i, state[S_HOT_DRAW, i])
    state[S_HOT_TIME, i] += wait / circuit.hot_rate


@entry
def fill_first_hot_times(
    seed: np.uint64, fraction: float, rate: float, start: float, times: Array
) -> None:
    """Choose the hot pixels and draw their first times [us]; the others never fire."""
    for i in range(times.shape[0]):
        times[i] = NEVER
        if rng.uniforms(seed, rng.HOT_CHOICE, i, 0)[0] < fraction:
            times[i] = start + rng.exponential(seed, rng.HOT_TIME, i, 0) / rate


@entry
def fill_first_noise(seed: np.uint64, rms: float, noise: Array) -> None:
    """Draw the noise of every pixel at the start from its stationary distribution."""
    for i in range(noise.shape[0]):
        noise[i] = rms * rng.normal(seed, rng.PHOTORECEPTOR, i, 0)


@kernel
def fill_normals(seed: np.uint64, first: int, count: int, block: int, normals: Array) -> None:
    """Draw the normal numbers of four steps in time, (4, count..), for the pixels first.. ."""
    rng.normals_of_four(seed, rng.PHOTORECEPTOR_STEPS, first, count, block, normals)
