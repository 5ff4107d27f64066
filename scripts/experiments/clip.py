"""Frames of light and their times: what every simulator is given."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from adv2e.errors import DataError
from adv2e.events import Events


@dataclass(frozen=True)
class Clip:
    """A clip: linear light [DN of 255], and increasing times [ns]."""

    frames: NDArray[Any]
    times_ns: NDArray[np.int64]

    def __post_init__(self) -> None:
        if self.frames.ndim != 3 or len(self.frames) != len(self.times_ns) or len(self.frames) < 2:
            raise DataError(
                f"a clip of {self.frames.shape} with {len(self.times_ns)} times: it needs (frames,"
                " rows, columns), two frames or more, and a time for each"
            )
        if np.diff(self.times_ns).min() <= 0:
            raise DataError("a clip whose times do not increase")

    @property
    def size(self) -> tuple[int, int]:
        """Columns and rows."""
        return self.frames.shape[2], self.frames.shape[1]

    def until(self, t_us: int) -> Clip:
        """Return the clip up to the first frame at or after a time [us], two frames at least."""
        count = max(2, int(np.searchsorted(self.times_ns, 1000 * t_us)) + 1)
        return Clip(self.frames[:count], self.times_ns[:count])

    def at(self, t_ns: int) -> NDArray[np.float32]:
        """Return the light at a time [ns] within the clip, linear between frames."""
        after = int(np.clip(np.searchsorted(self.times_ns, t_ns), 1, len(self.times_ns) - 1))
        t0, t1 = (int(t) for t in self.times_ns[after - 1 : after + 1])
        before, here = (frame.astype(np.float32) for frame in self.frames[after - 1 : after + 1])
        return before + np.float32((t_ns - t0) / (t1 - t0)) * (here - before)

    def blended(self, parts: int) -> Iterator[tuple[int, NDArray[np.float32]]]:
        """Yield times [ns] and light of `parts` equal steps of each interval, linear in light."""
        yield int(self.times_ns[0]), self.frames[0].astype(np.float32)
        for t0, t1 in zip(self.times_ns[:-1].tolist(), self.times_ns[1:].tolist(), strict=True):
            for part in range(1, parts + 1):
                t_ns = t0 + (t1 - t0) * part // parts
                yield t_ns, self.at(t_ns)

    def even(self, parts: int) -> tuple[NDArray[np.float32], Fraction]:
        """Return light at even times, for tools that know a frame rate alone, and their rate [Hz].

        The rate is about `parts` times the usual one of the clip; both its ends are kept.
        """
        span = int(self.times_ns[-1] - self.times_ns[0])
        count = max(1, round(span * parts / float(np.median(np.diff(self.times_ns)))))
        times = [int(self.times_ns[0]) + span * k // count for k in range(count + 1)]
        return np.stack([self.at(t_ns) for t_ns in times]), Fraction(count * 10**9, span)


class Simulator(Protocol):
    """Turns clips into events.

    Attributes
    ----------
    name : str
        What tables call it.
    nature : str
        Whether it is the tool itself, its equations, its parameters in the pixel of adv2e, or
        events that it wrote.
    levels : (float, float), optional
        Its thresholds of ON and OFF, in its own unit; None where it cannot be simulated anew.
    """

    @property
    def name(self) -> str: ...  # noqa: D102 - above

    @property
    def nature(self) -> str: ...  # noqa: D102

    @property
    def levels(self) -> tuple[float, float] | None: ...  # noqa: D102

    def events(self, clip: Clip, seed: int) -> Events:
        """Return sorted events on the clock of the clip [us]; the same for the same seed."""

    def with_levels(self, on: float, off: float) -> Simulator:
        """Return it with other thresholds."""
