"""Strips handed out to whoever is free: the threads that advance a part take one after the other.

What a strip costs depends on what moves in it, up to a hundred times as much as at rest, and what
moves lies together.  Tiles cut beforehand are either so large that one of them holds most of the
work, or so small that calling the kernel costs as much as pixels at rest do.
"""

from __future__ import annotations

import threading

import numpy as np
from numpy.typing import NDArray

from adv2e.compiled import extension, kernel

STRIP = 2048
"""Pixels that are handed out together: their scratch rows fit the first two levels of cache."""

_LOCK = threading.Lock()


def _count_up(counter):
    """Add one to the only entry of an array of int64, as one step among threads.

    Returns what it was before.
    """
    with _LOCK:
        counter[0] += 1
        return int(counter[0]) - 1


@extension
def _compile_count_up():
    from numba import types  # noqa: PLC0415 - for the compiler only
    from numba.extending import intrinsic, overload  # noqa: PLC0415

    @intrinsic
    def add_atomically(_, counter):
        def generate(context, builder, signature, arguments):
            entry = context.make_array(signature.args[0])(context, builder, arguments[0]).data
            one = context.get_constant(types.int64, 1)
            # nothing but the count passes between the threads: no order of other memory is needed
            return builder.atomic_rmw("add", entry, one, "monotonic")

        return types.int64(counter), generate

    @overload(_count_up)
    def count_up(counter):
        return lambda counter: add_atomically(counter)  # noqa: PLW0108 - Numba wants a function


def nothing_claimed() -> NDArray[np.int64]:
    """Return the count of strips claimed so far, for all who share the work; (1,)."""
    return np.zeros(1, np.int64)


@kernel
def claim(claimed, pixels):
    """Return the range of `pixels` of a strip that nobody else gets; an empty one: none is left."""
    lo = min(_count_up(claimed) * STRIP, pixels)
    return lo, min(lo + STRIP, pixels)
