r"""Linear interpolation: light linear in time between two frames; a sequence as its intervals.

.. math:: I_l = a + (b - a)\, l / L, \qquad l = 1 \dots L

A pixel that an edge passes makes one long slope of it, over the whole interval and at both ends of
the path at once.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from adv2e.background import worker_pool
from adv2e.effects.hooks import LightFrame

# ---- A sequence of frames as its intervals, each with the frames beside it.


@dataclass(frozen=True)
class Beside:
    """The frames before and after an interval.

    Attributes
    ----------
    before, after : (rows, columns), or None
        Light [DN]; None: there is none.
    span_before, span_after : float
        Time from there to the interval and from the interval to there, in units of the interval.
    """

    before: NDArray[Any] | None = None
    after: NDArray[Any] | None = None
    span_before: float = 1.0
    span_after: float = 1.0


NOTHING = Beside()


def instant_ns(start_ns: int, stop_ns: int, step: int, count: int) -> int:
    """Return the time of a step of an interval of `count`, to the nearest ns."""
    return start_ns + ((stop_ns - start_ns) * step + count // 2) // count


def ordered(
    frame: Callable[[int], NDArray[Any]], count: int, threads: int
) -> Iterator[NDArray[Any]]:
    """Yield ``frame(step)`` of the steps 1 to `count` - 1, `threads` of them made at a time.

    No more are held than that, so that memory does not grow with `count`.
    """
    if threads == 1:
        yield from map(frame, range(1, count))
        return
    with worker_pool(threads) as pool:
        for start in range(1, count, threads):
            yield from pool.map(frame, range(start, min(start + threads, count)))


def neighbours(frames: Iterable[LightFrame]) -> Iterator[tuple[LightFrame, LightFrame, Beside]]:
    """Yield each pair of neighbours with what lies beside it; reads one frame ahead."""
    coming = iter(frames)
    before: LightFrame | None = None
    first, second = next(coming, None), next(coming, None)
    while first is not None and second is not None:
        after = next(coming, None)
        span = second[0] - first[0]
        yield (
            first,
            second,
            Beside(
                before=None if before is None else before[1],
                after=None if after is None else after[1],
                span_before=1.0 if before is None else (first[0] - before[0]) / span,
                span_after=1.0 if after is None else (after[0] - second[0]) / span,
            ),
        )
        before, first, second = first, second, after


def blend(a: NDArray[Any], difference: NDArray[Any], fraction: float) -> NDArray[Any]:
    """Return a + fraction difference, in one pass over memory.

    Where the difference is 0 this is `a` to the last bit, which (1 - w) a + w b is not: a pixel at
    rest must stay at rest.
    """
    blended: NDArray[Any] = cv2.scaleAdd(difference, fraction, a)
    return blended


def check_pair(a: NDArray[Any], b: NDArray[Any]) -> None:
    """Raise ValueError unless `a` and `b` are light frames of the same size and type."""
    if a.shape != b.shape or a.dtype != b.dtype:
        raise ValueError(f"two frames: {a.dtype} {a.shape} and {b.dtype} {b.shape}")
    if a.ndim != 2 or a.dtype not in (np.float32, np.float64):
        raise ValueError(f"light must be float32 or float64 (rows, columns): {a.dtype} {a.shape}")


class LinearUpsampler:
    """Makes `L` frames of each interval, linear in time."""

    def __init__(self, L: int) -> None:
        self.L = L

    def count(self, a: NDArray[Any], b: NDArray[Any], beside: Beside = NOTHING) -> int:
        del a, b, beside
        return self.L

    def between(
        self, a: NDArray[Any], b: NDArray[Any], beside: Beside = NOTHING
    ) -> Iterator[NDArray[Any]]:
        """Yield `L` frames, the last `b` itself; see :class:`.Upsampler`."""
        del beside  # a line through two points
        check_pair(a, b)
        difference = np.subtract(b, a)
        for step in range(1, self.L):
            yield blend(a, difference, step / self.L)
        yield b
