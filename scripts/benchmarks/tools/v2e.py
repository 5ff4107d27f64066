"""v2e, from a folder with its sources (``v2ecore/``): its emulator, frames and events in memory.

Its rows are time [s], column, row, polarity (1 or -1), None where a frame makes none.
"""

from __future__ import annotations

import platform
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import torch


def simulator(options: dict[str, Any]) -> Callable[[Any, float], Any]:
    """Return a function of (frames, fps).

    Options: ``folder`` of the sources, ``arguments`` of ``EventEmulator``, ``threads``.
    """
    folder = str(Path(options["folder"]).resolve())
    if folder not in sys.path:
        sys.path.insert(0, folder)
    from v2ecore.emulator import EventEmulator  # noqa: PLC0415 - known only now

    if options["threads"]:
        torch.set_num_threads(options["threads"])

    def run(frames: Any, fps: float) -> Any:
        emulator = EventEmulator(device="cpu", **{"seed": 1, **options["arguments"]})
        found = [
            emulator.generate_events(frame.astype(np.float32), k / fps)
            for k, frame in enumerate(frames)
        ]
        return [part for part in found if part is not None]

    return run


def columns(events: Any) -> tuple[Any, ...]:
    """Return times [us], columns, rows and polarities."""
    parts = [np.asarray(part, np.float64)[:, :4] for part in events]
    table = np.concatenate([np.empty((0, 4)), *parts])
    t, x, y, p = table.T
    whole = (column.astype(np.int64) for column in (np.rint(t * 1e6), x, y, p > 0))
    return tuple(whole)


def versions() -> dict[str, str]:
    """Return what ran."""
    return {"torch": torch.__version__, "Python": platform.python_version()}
