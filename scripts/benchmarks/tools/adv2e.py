"""adv2e itself, through its public interface."""

from __future__ import annotations

import platform
from collections.abc import Callable
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np

import adv2e


def simulator(options: dict[str, Any]) -> Callable[[Any, float], Any]:
    """Return a function of (frames, fps); options: ``sets``, ``threads``."""
    config = adv2e.load_config([], options["sets"])
    threads = options["threads"]

    def run(frames: Any, fps: float) -> Any:
        times = np.arange(len(frames)) / fps
        return list(adv2e.simulate(frames, times, config, threads=threads))

    return run


def columns(events: Any) -> tuple[Any, ...]:
    """Return times [us], columns, rows and polarities."""
    joined = np.concatenate(events)
    return joined["t"], joined["x"], joined["y"], joined["p"].astype(np.int64)


def versions() -> dict[str, str]:
    """Return what ran."""
    return {
        "adv2e": adv2e.__version__,
        "from": str(Path(adv2e.__file__).parent),
        "numba": metadata.version("numba"),
        "numpy": metadata.version("numpy"),
        "Python": platform.python_version(),
    }
