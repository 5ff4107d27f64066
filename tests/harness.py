"""The compiled pixel on light given directly, with exact times pixel by pixel; and its twin."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
from reference.agreement import count_and_time_errors, split_by_pixel
from reference.circuit import Draws
from reference.twin import simulate_twin

from adv2e.config.model import (
    HotPixels,
    Leak,
    LogResponse,
    LowPass,
    PhotoreceptorNoise,
    Pixel,
    Refractory,
    Sampling,
    ShotNoise,
    SourceFollower,
    Thresholds,
)
from adv2e.effects.hooks import Hooks, View
from adv2e.kernel import per_pixel
from adv2e.pixel.array import PixelArray

QUIET = {"refractory": None, "leak": None, "shot_noise": None}
"""Everything off that is on by default, but for the mismatch of thresholds."""

EVERYTHING = {
    "low_pass": LowPass(),
    "source_follower": SourceFollower(cutoff_hz=900.0),
    "thresholds": Thresholds(on=0.2, off=0.25, mismatch=0.03),
    "refractory": Refractory(period_us=700.0),
    "leak": Leak(rate_hz=5.0, photo_rate_hz=10.0, jitter=0.1),
    "shot_noise": ShotNoise(rate_hz=20.0),
    "photoreceptor_noise": PhotoreceptorNoise(rms=0.04, step=0.3),
    "hot_pixels": HotPixels(fraction=0.05, rate_hz=80.0),
}

IN_LANES = {
    name: section
    for name, section in EVERYTHING.items()
    if name not in ("source_follower", "photoreceptor_noise")
}
"""Of these what is not solved in steps of time."""

STEPPED_FORM = {
    **IN_LANES,
    "low_pass": LowPass(update="first_order_hold"),
    "source_follower": SourceFollower(cutoff_hz=900.0),
}
"""A form of the low-pass in K steps, and a second pole."""


PIXELS, SECONDS = 3000, 4.0
"""Size and length of a recording at rest, from which rates are counted."""


def quiet(**sections):
    """Return a pixel without noise, dead time and mismatch, but for the sections given."""
    base = {
        **QUIET,
        "thresholds": Thresholds(mismatch=0.0),
        "log_response": LogResponse(linear_below=20.0, floor=0.1),
        "initial_reference": "settled",
    }
    return Pixel(**{**base, **sections})


def pure(**sections):
    """Return a quiet pixel whose response is a logarithm everywhere."""
    return quiet(log_response=LogResponse(linear_below=0), **sections)


def effect(shape, step_us=100.0, module=__name__, **methods):
    """Return an effect of the `methods` given, which has begun on pixels of `shape`.

    `module` says whose it is.
    """
    own = {name: staticmethod(method) for name, method in methods.items()}
    made = type("Made", (Hooks,), {"__module__": module, "step_us": step_us, **own})()
    made.begin(View(*shape, 0, 0.0))
    return made


def last_flags(knots, L, printed):
    """Which intervals between `knots` frames are the last of L, with the look-ahead entry."""
    last = np.zeros(knots, bool)
    if printed:
        last[: knots - 1] = (np.arange(knots - 1) + 1) % L == 0
    return last


def start(light, times_ns, pixel, K=10, seed=0, printed=False, **options):
    """Return the pixel array at the first frame; `light` is (knots, pixels) or (knots, h, w)."""
    first = light[0][None] if light.ndim == 2 else light[0]
    last = "printed" if printed else "corrected"
    sampling = Sampling(K=K, last_interval=last)
    return PixelArray(pixel, sampling, seed, first, times_ns[0], **options)


def first_draws(array, factors=None):
    """Return where the pixels are in their leak cycles, for the reference.

    `factors` : per pixel, leak speeds of the cycles, of which this one's is put in.
    """
    state = array.state
    hold = state[per_pixel.HOLD]
    release = np.where(hold < 0.0, -np.inf, (hold + array.origin_us) * 1e-6)
    if factors is not None and array.circuit.leak_jitter > 0:
        factors = [
            np.append(now, later[1:])
            for now, later in zip(state[per_pixel.LEAK_FACTOR], factors, strict=True)
        ]
    offset = state[per_pixel.REFERENCE] - state[per_pixel.X]
    return Draws(reference_offset=offset, first_release=release, leak_factors=factors)


def advance(array, light, times_ns, *, chunk=None, threads=1, L=1, printed=False):
    """Return (events, exact times [us]) of all intervals, taken `chunk` at a time."""
    frames = light[:, None, :] if light.ndim == 2 else light
    frames = np.ascontiguousarray(frames)
    intervals = len(frames) - 1
    last = last_flags(len(frames), L, printed)
    events, exact = [], []
    with ThreadPoolExecutor(threads) as pool:
        for a in range(0, intervals, chunk or intervals):
            b = min(intervals, a + (chunk or intervals))
            part = frames[a : b + 1 + (1 if printed and b < intervals else 0)]
            events.append(array.advance(part, times_ns[a : b + 1], last[a : b + 1], pool))
            exact.append(array.last_times)
    return np.concatenate(events), np.concatenate(exact)


def by_pixel(array, events, exact):
    """Return one (events, 2) array of time [s] and polarity a pixel, from exact times."""
    index = events["y"].astype(np.int64) * array.columns + events["x"]
    times = (exact + array.origin_us) * 1e-6
    return split_by_pixel(times, index, events["p"], array.pixels)


def solve(light, times_s, pixel, *, begin=None, **options):
    """Return the events of `light` (knots, pixels) as one (events, 2) array a pixel.

    `begin` is called with the pixel array before the first frame.
    """
    split = ("chunk", "threads", "L", "printed")
    run = {key: options.pop(key) for key in split if key in options}
    times_ns = [round(float(t) * 1e9) for t in times_s]
    printed = run.get("printed", False)
    array = start(light, times_ns, pixel, exact_times=True, printed=printed, **options)
    if begin is not None:
        begin(array)
    events, exact = advance(array, light, times_ns, **run)
    return by_pixel(array, events, exact)


def at_rest(dn, pixel, seconds=SECONDS, pixels=PIXELS, frames=5, seed=3):
    """Return (events, exact times [us]) of pixels that see the constant light `dn`."""
    light = np.full((frames, 1, pixels), dn, np.float32)
    times = [round(k * seconds / (frames - 1) * 1e9) for k in range(frames)]
    array = start(light, times, pixel, seed=seed, exact_times=True)
    return advance(array, light, times)


def within(count, expected, sigmas=4.0):
    """Tell whether a number of Poisson events is as expected."""
    return abs(count - expected) <= sigmas * np.sqrt(expected)


def moving_light(knots, pixels, seed=0, step=0.3):
    """Return light that wanders, rests, returns to old values, and crosses the knee both ways."""
    draw = np.random.default_rng(seed)
    walk = np.exp(np.cumsum(draw.normal(0, step, (knots, pixels)), 0) + np.log(50))
    walk = np.clip(walk, 0.3, 255)
    walk[3:5, : pixels // 4] = walk[2, : pixels // 4]
    walk[-2:, pixels // 4 : pixels // 2] = walk[0, pixels // 4 : pixels // 2]
    walk[1, -1], walk[2, -1] = 3.0, 250.0
    return walk.astype(np.float32).astype(np.float64)


def check_against_twin(
    light, times, pixel, circuit, draws=None, within_us=0.3, step_us=4.0, in_steps=False, **options
):
    """Compare the kernel with the twin; `in_steps`: the solver in steps of time, too."""
    draws = draws or Draws()

    def begin(array):
        nonlocal draws
        first = first_draws(array, draws.leak_factors)
        draws = replace(first, injected=draws.injected)

    kernel = solve(light, times, pixel, begin=begin, **options)
    twin = simulate_twin(light, times, circuit, draws, step_us=step_us)
    solved = [(kernel, within_us)]
    if in_steps:
        solved.append((solve(light, times, pixel, method="stepped", **options), 1.0))
    for events, most_us in solved:
        found = count_and_time_errors(events, twin)
        assert found.count_b > 50
        assert not found.differing
        assert found.max_dt_us < most_us


def clock(knots, interval_s):
    """Return the times of `knots` even frames [s], in whole nanoseconds."""
    return np.round(np.arange(knots) * interval_s * 1e9) * 1e-9
