"""Events of all tiles into order: slice of time by slice, in threads."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray

from adv2e.causes import CAUSE_BITS, CAUSED_DTYPE, with_cause
from adv2e.events import EVENT_DTYPE, Events, empty_events
from adv2e.kernel import packing as order

_SORTED = 1 << 15
"""Events that are sorted at a time."""

_YIELDED = 1 << 20
"""Events that are yielded at a time, or one slice of time's."""


class Parted:
    """Events of a tile, slice of time by slice: the first `count` of `keys`, in any order.

    `times` are their unrounded times, where these are kept; there are `per_us` slices a us.
    """

    def __init__(
        self, keys: NDArray[np.int64], times: NDArray[np.float64], count: int, per_us: float
    ) -> None:
        self.keys = np.empty(count, np.int64)
        self.ends = np.empty(order.SLICES + 1, np.int64)
        order.part_by_time(keys, count, per_us, self.ends, self.keys)
        self.times = times[:count].copy()
        # as they came, for the unrounded times that go with them
        self.raw = keys[: self.times.size].copy()

    def of(self, first: int, last: int) -> NDArray[np.int64]:
        """Return the events of the slices first..last, the last one not counted."""
        return self.keys[self.ends[first] : self.ends[last]]


def polarity_bits(causes: bool) -> int:
    """Return the number of the last bits of a packed event, for polarity and cause."""
    return 1 + CAUSE_BITS if causes else 1


def in_order(
    parted: Sequence[Parted],
    columns: int,
    t0_us: int,
    pool: ThreadPoolExecutor | None,
    causes: bool = False,
) -> Iterator[Events]:
    """Yield the events of all tiles, sorted, not many more than a million at a time.

    Packed times count from `t0_us`.  With `causes`, their numbers are the last bits.
    """
    ends = np.sum([tile.ends for tile in parted], axis=0)
    first = 0
    while first < order.SLICES:
        last = first + 1
        while last < order.SLICES and ends[last + 1] - ends[first] <= _YIELDED:
            last += 1
        yield _sorted_slices(parted, columns, t0_us, ends, first, last, pool, causes)
        first = last


def _sorted_slices(
    parted: Sequence[Parted],
    columns: int,
    t0_us: int,
    ends: NDArray[np.int64],
    first: int,
    last: int,
    pool: ThreadPoolExecutor | None,
    causes: bool,
) -> Events:
    begin = ends[first]
    events = np.empty(int(ends[last] - begin), CAUSED_DTYPE if causes else EVENT_DTYPE)
    # as many slices at a time as sort in cache
    borders = [first]
    for s in range(first + 1, last + 1):
        if s == last or ends[s + 1] - ends[borders[-1]] > _SORTED:
            borders.append(s)

    what = polarity_bits(causes)

    def sort(lo: int, hi: int) -> None:
        made = np.concatenate([tile.of(lo, hi) for tile in parted])
        keys = np.sort(made)
        place = keys >> what
        if np.any((place[1:] == place[:-1]) & (keys[1:] != keys[:-1])):
            # a pixel that fires both ways within a microsecond does so as it happened
            keys = made[np.argsort(made >> what, kind="stable")]
        of = slice(ends[lo] - begin, ends[hi] - begin)
        if causes:
            plain = empty_events(keys.size)
            order.unpack(keys >> CAUSE_BITS, columns, t0_us, plain)
            events[of] = with_cause(plain, keys & ((1 << CAUSE_BITS) - 1))
        else:
            order.unpack(keys, columns, t0_us, events[of])

    list((pool.map if pool else map)(sort, borders[:-1], borders[1:]))
    return events
