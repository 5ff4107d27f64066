"""The ESIM simulator of evlib (PyPI ``evlib``), which needs PyTorch; no filter, no interpolation.

Every event has the time of the frame that made it.
"""

from __future__ import annotations

import platform
from collections.abc import Callable
from importlib import metadata
from typing import Any

import numpy as np
import torch
from evlib.simulation.config import ESIMConfig
from evlib.simulation.esim import ESIMSimulator


def simulator(options: dict[str, Any]) -> Callable[[Any, float], Any]:
    """Return a function of (frames, fps); options: ``arguments`` of ``ESIMConfig``, ``threads``."""
    if options["threads"]:
        torch.set_num_threads(options["threads"])

    def run(frames: Any, fps: float) -> Any:
        esim = ESIMSimulator(ESIMConfig(device="cpu", **options["arguments"]))
        return [esim.process_frame(frame, k / fps) for k, frame in enumerate(frames)]

    return run


def columns(events: Any) -> tuple[Any, ...]:
    """Return times [us], columns, rows and polarities."""
    x, y, t, p = (np.concatenate([part[k] for part in events]) for k in range(4))
    whole = (column.astype(np.int64) for column in (np.rint(t * 1e6), x, y, p > 0))
    return tuple(whole)


def versions() -> dict[str, str]:
    """Return what ran."""
    return {
        "evlib": metadata.version("evlib"),
        "torch": torch.__version__,
        "Python": platform.python_version(),
    }
