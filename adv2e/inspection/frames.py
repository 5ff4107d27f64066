"""What a sequence of frames holds."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


def describe_times(times_ns: NDArray[np.int64]) -> dict[str, Any]:
    """Return count, span, rate and intervals of frames; None for what one frame cannot tell.

    Parameters
    ----------
    times_ns : array of int64, (frames,)
        Times of the frames [ns], increasing.
    """
    steps_ms = np.diff(times_ns) / 1e6
    count = len(times_ns)
    duration_s = (int(times_ns[-1]) - int(times_ns[0])) / 1e9 if count else None
    return {
        "count": count,
        "first_ns": int(times_ns[0]) if count else None,
        "last_ns": int(times_ns[-1]) if count else None,
        "duration_s": duration_s,
        "rate_hz": (count - 1) / duration_s if duration_s else None,
        "shortest_interval_ms": float(steps_ms.min()) if len(steps_ms) else None,
        "longest_interval_ms": float(steps_ms.max()) if len(steps_ms) else None,
    }
