"""The pixel array: state, thresholds and noise of every pixel, advanced from frame to frame."""

from __future__ import annotations

import math
import os
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.config.model import Pixel, Sampling
from adv2e.effects.pixel.hot_pixels import fill_first_hot_times
from adv2e.effects.pixel.leak import fill_first_factors
from adv2e.effects.pixel.low_pass import UPDATES
from adv2e.effects.pixel.photoreceptor_noise import fill_first_noise
from adv2e.effects.pixel.shot_noise import FALL_AT_WHITE, fill_first_candidates
from adv2e.effects.pixel.thresholds import fill_levels, fill_random_reference
from adv2e.errors import DataError
from adv2e.events import EVENT_DTYPE, Events
from adv2e.kernel import items, screen
from adv2e.kernel.screen import NODES_MAX, STRIP
from adv2e.kernel.tile import run_tile
from adv2e.kernel.workspace import (
    PIXEL_BITS,
    S_HOLD,
    S_HOT_DRAW,
    S_HOT_TIME,
    S_LAG2,
    S_LEAK_DRAW,
    S_LEAK_FACTOR,
    S_LIGHT,
    S_NOISE,
    S_NOISE_DRAW,
    S_OFF,
    S_ON,
    S_REFERENCE,
    S_SHOT_DRAW,
    S_SHOT_TIME,
    S_X,
    Circuit,
    pack_limit_us,
    workspace,
)

_NO_KNEE = 1e300
_PER_US = 1e-6


def thread_count(threads: int | None) -> int:
    """Return `threads`, or the number of cores this process may use."""
    if threads is not None:
        return max(1, threads)
    if hasattr(os, "sched_getaffinity"):
        return max(1, len(os.sched_getaffinity(0)))
    return os.cpu_count() or 1


def make_circuit(pixel: Pixel, steps: int, seed: int) -> Circuit:
    """Return what the compiled code needs of the configuration; rates a us, corners in rad a us."""
    low_pass, follower, leak = pixel.low_pass, pixel.source_follower, pixel.leak
    knee_dn = pixel.log_response.linear_below
    corner = 2.0 * math.pi * _PER_US
    dark = low_pass.dark_cutoff_hz if low_pass else 0.0
    white = low_pass.cutoff_hz if low_pass else 0.0
    noise = pixel.photoreceptor_noise
    return Circuit(
        update=UPDATES.index(low_pass.update) if low_pass else 0,
        steps=steps,
        filtered=low_pass is not None,
        dark=corner * dark,
        per_dn=corner * (white - dark) / 255.0,
        follower=corner * follower.cutoff_hz if follower else 0.0,
        knee=math.log(knee_dn) if knee_dn > 0 else -_NO_KNEE,
        slope=knee_dn / math.log(knee_dn) if knee_dn > 0 else 0.0,
        dead_time=pixel.refractory.period_us if pixel.refractory else 0.0,
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
        noise_rms=noise.rms if noise else 0.0,
        noise_step=noise.step if noise else 0.1,
        seed=seed,
    )


@lru_cache(maxsize=256)
def _quadrature(length: float, fastest: float) -> tuple[NDArray[Any], NDArray[Any]]:
    return screen.quadrature(length, fastest)


class _Tile:
    """A range of pixels with the scratch memory of whoever works on it."""

    def __init__(self, lo: int, hi: int, exact_times: bool) -> None:
        self.lo, self.hi = lo, hi
        self.scratch = workspace()
        # one row is not a multiple of a page: rows must not share cache sets
        self.columns = np.zeros((13, STRIP + 24))
        self.flags = np.zeros(STRIP, np.bool_)
        self.items = np.zeros((items.ROWS, items.CAPACITY + 24))
        self.keep = np.zeros(STRIP, np.bool_)
        self.found_time = np.empty(8 * items.CAPACITY)
        self.found_pixel = np.empty(8 * items.CAPACITY, np.int64)
        self.keys = np.empty(4096, np.int64)
        self.times = np.empty(4096 if exact_times else 0)


class PixelArray:
    """All pixels of a camera.

    Parameters
    ----------
    pixel, sampling
        The configuration's sections.
    seed : int
    first : (rows, columns) float
        Light of the first frame [DN].
    t_ns : int
        Its time.
    threads : int, optional
    tile : int, optional
        Pixels a tile; the events do not depend on it.
    exact_times : bool
        Keep unrounded times (`last_times`), for tests.

    Raises
    ------
    DataError
        More than 2^27 pixels.
    """

    def __init__(
        self,
        pixel: Pixel,
        sampling: Sampling,
        seed: int,
        first: NDArray[Any],
        t_ns: int,
        *,
        threads: int | None = None,
        tile: int | None = None,
        exact_times: bool = False,
    ) -> None:
        self.rows, self.columns = first.shape
        self.pixels = self.rows * self.columns
        if self.pixels >= 1 << PIXEL_BITS:
            raise DataError(
                f"{self.columns}x{self.rows} pixels: at most {1 << PIXEL_BITS} are supported"
            )
        self.origin_us = t_ns // 1000
        self.circuit = make_circuit(pixel, sampling.K, seed)
        self.floor = pixel.log_response.floor
        self.threads = thread_count(threads)
        self.started = False
        self.state = self._first_state(pixel, seed, first, self._relative(t_ns))
        size = tile or max(STRIP, -(-self.pixels // (4 * self.threads)))
        size = -(-size // STRIP) * STRIP
        self._tiles = [
            _Tile(lo, min(lo + size, self.pixels), exact_times)
            for lo in range(0, self.pixels, size)
        ]
        self.last_times = np.empty(0)

    def _relative(self, t_ns: int) -> float:
        return (t_ns - self.origin_us * 1000) * 1e-3

    def _first_state(
        self, pixel: Pixel, seed: int, first: NDArray[Any], start: float
    ) -> NDArray[Any]:
        circuit = self.circuit
        used = {
            S_SHOT_DRAW: circuit.shot_rate > 0,
            S_HOT_DRAW: circuit.hot_rate > 0,
            S_LAG2: circuit.follower > 0,
            S_LEAK_DRAW: circuit.leak_jitter > 0,
            S_NOISE_DRAW: circuit.noise_rms > 0,
        }
        rows = 1 + max([S_OFF, *(row for row, on in used.items() if on)])
        state = np.zeros((rows, self.pixels))
        light = np.ascontiguousarray(first).reshape(-1)
        screen.load_strip(light, circuit, self.floor, state[S_LIGHT], state[S_X])
        levels = pixel.thresholds
        on, off = state[S_ON], state[S_OFF]
        fill_levels(seed, levels.on, levels.off, levels.mismatch, on, off)
        state[S_REFERENCE] = state[S_X]
        state[S_HOLD] = -1.0
        if pixel.initial_reference == "random":
            fill_random_reference(seed, on, off, state[S_X], state[S_REFERENCE])
        if circuit.shot_rate > 0:
            times = state[S_SHOT_TIME]
            fill_first_candidates(seed, circuit.shot_rate, start, times)
        if pixel.hot_pixels and circuit.hot_rate > 0:
            share, times = pixel.hot_pixels.fraction, state[S_HOT_TIME]
            fill_first_hot_times(seed, share, circuit.hot_rate, start, times)
        if circuit.leak_jitter > 0:
            factors = state[S_LEAK_FACTOR]
            fill_first_factors(seed, circuit.leak_jitter, factors)
        if circuit.noise_rms > 0:
            noise = state[S_NOISE]
            fill_first_noise(seed, circuit.noise_rms, noise)
            if circuit.follower == 0:  # behind a second pole at rest it does not show yet
                state[S_REFERENCE] += noise
        return state

    def advance(
        self,
        frames: NDArray[Any],
        times_ns: list[int],
        last: NDArray[np.bool_],
        pool: ThreadPoolExecutor | None = None,
    ) -> Events:
        """Return the sorted events of the intervals between neighbouring frames.

        Parameters
        ----------
        frames : (intervals + 1, rows, columns) float32 or float64
            Light [DN], the first as at the end of the last call; with the printed last interval
            one more, for the look-ahead.
        times_ns : (intervals + 1)
        last : (intervals + 1,) bool
            See :func:`adv2e.kernel.tile.run_tile`.
        pool : ThreadPoolExecutor, optional
            Threads to work in; none: the calling one.
        """
        starts = np.array([self._relative(t) for t in times_ns])
        t_base = math.floor(starts[0]) - 1
        if starts[-1] - starts[0] >= pack_limit_us() // 2:
            raise DataError(f"{(starts[-1] - starts[0]) / 1e6:.0f} s between frames: too long")
        flat = frames.reshape(frames.shape[0], -1)
        nodes, weights, counts = self._nodes(np.diff(starts))

        def run(tile: _Tile) -> tuple[NDArray[Any], NDArray[Any]]:
            n, tile.keys, tile.times = run_tile(
                tile.lo, tile.hi, flat, starts, not self.started, last, self.floor,
                self.circuit, nodes, weights, counts, t_base, self.state, tile.scratch,
                tile.columns, tile.flags, tile.items, tile.keep, tile.found_time, tile.found_pixel,
                tile.keys, tile.times,
            )  # fmt: skip
            return tile.keys[:n], tile.times[:n]

        parts = list(pool.map(run, self._tiles) if pool else map(run, self._tiles))
        self.started = True
        keys = np.concatenate([part[0] for part in parts])
        times = np.concatenate([part[1] for part in parts])
        if times.size:
            order = np.argsort(keys, kind="stable")
            self.last_times = times[order]
        keys.sort()
        return self._unpack(keys, t_base)

    def _nodes(self, lengths: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any], NDArray[np.int64]]:
        nodes = np.zeros((lengths.size, NODES_MAX))
        weights = np.zeros_like(nodes)
        counts = np.zeros(lengths.size, np.int64)
        fastest = max(self.circuit.dark + 255.0 * self.circuit.per_dn, self.circuit.dark)
        for k, length in enumerate(lengths):
            # rounded up so that jitter of the frame times does not miss the cache
            rounded = float(f"{length * 1.005:.2e}")
            node, weight = _quadrature(rounded, fastest)
            counts[k] = node.size
            nodes[k, : node.size] = node
            weights[k, : node.size] = weight
        return nodes, weights, counts

    def _unpack(self, keys: NDArray[Any], t_base: int) -> Events:
        events = np.empty(keys.size, EVENT_DTYPE)
        events["t"] = (keys >> (PIXEL_BITS + 1)) + (self.origin_us + t_base)
        index = (keys >> 1) & ((1 << PIXEL_BITS) - 1)
        events["x"] = index % self.columns
        events["y"] = index // self.columns
        events["p"] = keys & 1
        return events
