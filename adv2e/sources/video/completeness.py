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


def lost_by_time(
    expected_ns: Sequence[int], stamps_ns: Sequence[int], tick_ns: int, leading: int = 0
) -> list[int]:
    """Return those of the expected times at which no picture came, from the first that came on.

    `expected_ns` are when pictures are shown, sorted, `leading` of them before the first in the
    file; `stamps_ns` when those that came are, from zero where FFmpeg begins to count: at the first
    expected one, the first in the file, or the first that came.  The two may differ by `tick_ns`.
    """
    if not expected_ns:
        return []
    if not stamps_ns:
        return list(expected_ns)
    came = sorted(stamps_ns)
    within = max(tick_ns, 2000)
    first = expected_ns[0]
    offsets = (first, 0, first - came[0], expected_ns[leading] - came[0])
    attempts = (
        _lost(expected_ns, [stamp + offset for stamp in came], within) for offset in offsets
    )
    return min(attempts, key=len)


def _lost(expected_ns: Sequence[int], came: Sequence[int], within: int) -> list[int]:
    if not _near(came[0], expected_ns, within):
        return list(expected_ns)
    lost = [t for t in expected_ns if t > came[0] + within and not _near(t, came, within)]
    if len(came) > 2 and lost and _are_second_fields(lost, came):
        return []
    return lost


def _near(t: int, times: Sequence[int], within: int) -> bool:
    place = bisect_left(times, t)
    return any(abs(t - times[n]) <= within for n in (place - 1, place) if 0 <= n < len(times))


def _are_second_fields(lost: Sequence[int], came: Sequence[int]) -> bool:
    """Tell whether one picture is missing in the middle of each step, all of one length."""
    steps = [after - before for before, after in pairwise(came)]
    usual = median(steps)
    if any(abs(step - usual) > 0.05 * usual for step in steps):
        return False
    middles = {bisect_left(came, t) for t in lost}
    return len(middles) == len(lost) and len(lost) >= len(came) - 1


def lost_by_count(expected: int, stamps_ns: Sequence[int | None], known_ns: Sequence[int]) -> int:
    """Return how many of the expected pictures are missing where times are those of decoding.

    FFmpeg has no stamps for those that it held back to the end; `known_ns` are those of all, as far
    as known, sorted.
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
    leading = max(bisect_left(known_ns, first) - held, 0)
    return max(missing - leading, 0)


def _is_even(stamps_ns: Sequence[int | None]) -> bool:
    steps = [b - a for a, b in pairwise(stamps_ns) if a is not None and b is not None]
    return len(steps) > 2 and max(steps) - min(steps) <= 0.05 * median(steps)
