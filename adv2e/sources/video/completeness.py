"""Whether all pictures of a video came out of the decoder.

OpenCV leaves out what its decoder refuses, and says nothing.  Pictures that were expected and did
not come tell, but for those that no decoder shows: pictures before the first that can stand alone,
and second fields where each field is stored as a picture.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Sequence
from itertools import pairwise
from statistics import median

_NEAR_NS = 2000
"""By so much the two may differ."""


def lost_pictures(
    expected: int, stamps_ns: Sequence[int | None], shown_ns: Sequence[int], leading: int = 0
) -> int:
    """Return how many of the expected pictures are missing behind the first that came.

    `stamps_ns` are those of the pictures that came; FFmpeg has none for those that it held back to
    the end.  `shown_ns` are when all are shown on the same clock, as far as known, sorted;
    `leading` of them are before the first in the file, at which that clock may begin.
    """
    missing = expected - len(stamps_ns)
    if missing <= 0:
        return 0
    if abs(expected - 2 * len(stamps_ns)) <= 2 and _is_even(stamps_ns):
        return 0  # two fields a picture
    held = 0
    for stamp in reversed(stamps_ns):
        if stamp is not None:
            break
        held += 1
    first = next((stamp for stamp in stamps_ns if stamp is not None), 0)
    # the first comes out late by as many as are held back, and by those that could not be shown
    before = max(bisect_left(shown_ns, first - _NEAR_NS) - held, leading)
    return max(missing - before, 0)


def _is_even(stamps_ns: Sequence[int | None]) -> bool:
    steps = [b - a for a, b in pairwise(stamps_ns) if a is not None and b is not None]
    return len(steps) > 2 and max(steps) - min(steps) <= 0.05 * median(steps)
