"""Runs the compiled pixel on light given directly, and returns exact times pixel by pixel."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
from reference.agreement import split_by_pixel
from reference.circuit import Draws

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


def quiet(**sections):
    """Return a pixel without noise, dead time and mismatch, but for the sections given."""
    base = {
        **QUIET,
        "thresholds": Thresholds(mismatch=0.0),
        "log_response": LogResponse(linear_below=20.0, floor=0.1),
        "initial_reference": "settled",
    }
    return Pixel(**{**base, **sections})


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
