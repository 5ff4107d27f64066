"""The pixel array: state, thresholds and noise of every pixel, advanced from frame to frame."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from queue import SimpleQueue
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.background import default_threads
from adv2e.causes import CAUSE_BITS, CAUSED_DTYPE
from adv2e.config.model import Pixel, Sampling
from adv2e.effects.composition import cause_of_signal, inside_pixel
from adv2e.effects.hooks import LONGEST_US, Hooks
from adv2e.effects.pixel.threshold_drift import drift_factors
from adv2e.errors import DataError
from adv2e.events import EVENT_DTYPE, Events
from adv2e.kernel import exact, unfiltered
from adv2e.kernel import packing as order
from adv2e.kernel.cascade.plan import plan_for
from adv2e.kernel.comparator import EventBuffer
from adv2e.kernel.inputs import FrameStack, Schedule, fastest_corner, frames_of
from adv2e.kernel.packing import PIXEL_BITS, pack_limit_us
from adv2e.kernel.photoreceptor.law import noise_of
from adv2e.kernel.quadrature import rules_for
from adv2e.kernel.stepped import driver
from adv2e.kernel.work_queue import STRIP, nothing_claimed
from adv2e.light.intervals import Part
from adv2e.pixel.merge import Parted, in_order, polarity_bits
from adv2e.pixel.state import driver_of, initial_state, make_circuit
from adv2e.pixel.steps import NOTHING, PRECISE, Coarseness, Stepping

_LARGEST_SIDE = 1 << 16
_TILE = 16 * STRIP
"""Pixels of the largest tiles; their events are held twice for a moment."""

_SOLVERS: dict[str, tuple[Any, Callable[[], Any]]] = {
    "run_exact": (exact.run_exact, exact.new_memory),
    "run_unfiltered": (unfiltered.run_unfiltered, unfiltered.new_memory),
    "run_stepped": (driver.run_stepped, driver.new_memory),
}
"""Compiled function, and what makes its memory, by the name of the function."""


class _Worker:
    """Memory that one thread works with."""

    def __init__(self, memory: Any, exact_times: bool) -> None:
        self.memory = memory
        self.keys = np.empty(4096, np.int64)
        self.times = np.empty(self.keys.size if exact_times else 0)


class PixelArray:
    """All pixels of a camera.

    Parameters
    ----------
    pixel, sampling
        The configuration's sections.
    first : (rows, columns) float
        Light of the first frame [DN].
    t_ns : int
        Its time.
    tile : int, optional
        Most pixels that one call of the kernel advances; the events do not depend on it.
    exact_times : bool
        Keep unrounded times (`last_times`), for tests.
    hooks : sequence of Hooks
        Effects that have begun; those that act inside the pixel do so here.
    method : {"auto", "stepped"}
        How the circuit is solved: the fastest way that covers it, or in steps of time.
    coarseness : Coarseness
        Of those steps, where some us of precision may go for speed.
    causes : bool
        Events are of CAUSED_DTYPE: they know why they came.

    Raises
    ------
    DataError
        More than 2^27 pixels, or more than 2^16 columns or rows.
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
        hooks: Sequence[Hooks] = (),
        method: str = "auto",
        coarseness: Coarseness = PRECISE,
        causes: bool = False,
    ) -> None:
        self.rows, self.columns = first.shape
        self.pixels = self.rows * self.columns
        if max(self.rows, self.columns) > _LARGEST_SIDE:
            raise DataError(
                f"{self.columns}x{self.rows} pixels: events hold columns and rows below"
                f" {_LARGEST_SIDE}"
            )
        if self.pixels >= 1 << PIXEL_BITS:
            raise DataError(
                f"{self.columns}x{self.rows} pixels: at most {1 << PIXEL_BITS} are supported"
            )
        self.origin_us = t_ns // 1000
        inside = inside_pixel(hooks)
        self.circuit = make_circuit(pixel, sampling, seed, causes, cause_of_signal(inside))
        self.threads = default_threads() if threads is None else max(1, threads)
        self.started = False
        self._drift_per_s = pixel.thresholds.drift_per_s
        self._level = min(pixel.thresholds.on, pixel.thresholds.off)
        self._start = start = self._relative(t_ns)
        name = driver_of(pixel, self.circuit, inside, method)
        self._advance, new_memory = _SOLVERS[name]
        self.merges = name == "run_exact" and self.circuit.noise_rms > 0.0
        self._stepping = None if name == "run_exact" else Stepping(
            self.circuit, self.pixels, self.columns, inside, self._drift_per_s, self.origin_us,
            start, coarseness,
        )  # fmt: skip
        light = first.reshape(-1)
        self.state = initial_state(pixel, self.circuit, light, start, self._stepping, self.threads)
        strips = -(-self.pixels // STRIP)
        self._most = -(-(tile or _TILE) // STRIP)
        # full tiles, and one for each thread that finds the rest, or nothing
        self._tiles = strips // self._most + self.threads
        self._workers: SimpleQueue[_Worker] = SimpleQueue()
        for _ in range(self.threads):
            self._workers.put(_Worker(new_memory(), exact_times))
        self.last_times = np.empty(0)

    def _relative(self, t_ns: int) -> float:
        return (t_ns - self.origin_us * 1000) * 1e-3

    def advance(
        self,
        frames: NDArray[Any],
        times_ns: list[int],
        last: NDArray[np.bool_],
        pool: ThreadPoolExecutor | None = None,
    ) -> Events:
        """Return the sorted events of the intervals between neighbouring frames of light [DN].

        The first frame is the last of the call before; for the printed last interval one more
        follows, to look ahead.  `last`: see :class:`adv2e.kernel.inputs.Schedule`.
        """
        before = np.arange(-1, frames.shape[0] - 1)
        part = Part(frames, before, np.ones(before.size, np.float32), times_ns, last)
        nothing = np.empty(0, CAUSED_DTYPE if self.circuit.causes else EVENT_DTYPE)
        return np.concatenate([nothing, *self.advance_part(part, None, pool)])

    def advance_part(
        self, part: Part, table: NDArray[np.float32] | None, pool: ThreadPoolExecutor | None
    ) -> Iterator[Events]:
        """Yield the sorted events of a part, not too many at a time.

        `table` is the light of each grey value, where its frames are not of light; without a `pool`
        the calling thread works.
        """
        starts = np.array([self._relative(t) for t in part.times_ns])
        span = starts[-1] - starts[0]
        t_base = math.floor(starts[0]) - 1
        bits = CAUSE_BITS if self.circuit.causes else 0
        if span >= (pack_limit_us() >> bits) // 2:
            raise DataError(
                f"{span / 1e6:.0f} s between frames: too long; are their times in another unit?"
            )
        frames = frames_of(part.frames, table)
        per_us = order.SLICES / (span + 2.0) / (1 << bits)
        parted: list[Parted] = []
        schedule = Schedule(frames, part.before, part.share, starts, not self.started, part.last)
        for how in self._solutions(part, frames, starts):
            arguments = schedule, self.circuit, *how, self.state
            parted += self._by_tiles(arguments, t_base, per_us, pool)
        self.started = True
        self._keep_times(parted)
        t0_us = self.origin_us + t_base
        yield from in_order(parted, self.columns, t0_us, pool, self.circuit.causes)

    def _solutions(
        self, part: Part, frames: FrameStack, starts: NDArray[Any]
    ) -> Iterable[tuple[Any, ...]]:
        """Return the further arguments of the solver, for each call of it."""
        if self._advance is unfiltered.run_unfiltered:
            return [(NOTHING,)]
        if self._stepping is not None:
            return self._stepping.runs(part, frames, starts)
        circuit, lengths = self.circuit, np.diff(starts)
        fastest = fastest_corner(circuit)
        simple = max(abs(circuit.overshoot), abs(self._drift_per_s), circuit.noise_rms) == 0.0
        if circuit.follower == 0.0 and simple:
            return [(rules_for(lengths, fastest, circuit.dead_time), None)]
        noise = noise_of(circuit, self._level, LONGEST_US) if self.merges else None
        factors = drift_factors((starts - self._start) * 1e-6, self._drift_per_s)
        until = part.until if self.merges else np.arange(1, starts.size)
        inside = part.share[: lengths.size] != 1.0
        plan = plan_for(starts, until, inside, fastest, circuit.follower, factors, simple, noise)
        return [(None, plan)]

    def _by_tiles(
        self, arguments: tuple[Any, ...], t_base: int, per_us: float,
        pool: ThreadPoolExecutor | None,
    ) -> list[Parted]:  # fmt: skip
        """Return the events of all tiles; each call finds its tile itself."""
        claimed = nothing_claimed()

        def run(_: int) -> Parted:
            worker = self._workers.get()
            try:
                buffer = EventBuffer(worker.keys, worker.times, t_base)
                n, buffer = self._advance(claimed, self._most, *arguments, worker.memory, buffer)
                worker.keys, worker.times = buffer.keys, buffer.times
                return Parted(worker.keys, worker.times, n, per_us)
            finally:
                self._workers.put(worker)

        return list((pool.map if pool else map)(run, range(self._tiles)))

    def _keep_times(self, parted: list[Parted]) -> None:
        times = np.concatenate([tile.times for tile in parted])
        keys = np.concatenate([tile.raw for tile in parted])
        places = keys >> polarity_bits(self.circuit.causes)
        self.last_times = times[np.argsort(places, kind="stable")]
