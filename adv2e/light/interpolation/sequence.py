"""A sequence of frames as its intervals, each with the frames beside it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Any

from numpy.typing import NDArray

from adv2e.background import worker_pool

Timed = tuple[int, NDArray[Any]]
"""Time [ns] and light [DN] of a frame."""


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


def neighbours(frames: Iterable[Timed]) -> Iterator[tuple[Timed, Timed, Beside]]:
    """Yield each pair of neighbours with what lies beside it; reads one frame ahead."""
    coming = iter(frames)
    before: Timed | None = None
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
