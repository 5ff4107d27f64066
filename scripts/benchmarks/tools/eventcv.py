"""EventCV (PyPI ``eventcv``), whose pixel follows v2e's.

It takes 8-bit frames as sRGB and removes that coding itself, so its frames are the clip coded so.
Its corner is 0.1 + 0.9 light of ``cutoff_hz``; between frames its log intensity is linear.
"""

from __future__ import annotations

import platform
from collections.abc import Callable
from importlib import metadata
from typing import Any

import eventcv
import numpy as np


def simulator(options: dict[str, Any]) -> Callable[[Any, float], Any]:
    """Return a function of (frames, fps); options: arguments of ``eventcv.simulate``."""

    def run(frames: Any, fps: float) -> Any:
        return eventcv.simulate(frames, fps=fps, **options["arguments"])

    return run


def columns(events: Any) -> tuple[Any, ...]:
    """Return times [us], columns, rows and polarities."""
    table = events.numpy()
    assert events.columns == ("x", "y", "t", "p"), events.columns
    assert events.timestamp_scale_ms == 0.001, "times are not in microseconds"
    x, y, t, p = (table[:, k].astype(np.int64) for k in range(4))
    return t, x, y, p


def versions() -> dict[str, str]:
    """Return what ran."""
    return {
        "eventcv": metadata.version("eventcv"),
        "numpy": metadata.version("numpy"),
        "Python": platform.python_version(),
    }
