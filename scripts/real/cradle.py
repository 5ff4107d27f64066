"""Noise rates of the still pixels of a recording with frames, against their grey value."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from real.recording import read

EDGES_DN = (0.5, 2, 5, 10, 20, 40, 80)
FINE_EDGES_DN = (0.5, 2, 4, 7, 10, 15, 20, 40, 80)
FEWEST = 200
"""Still pixels that a bin of grey values needs."""
BLOCK = 8
"""Sides of the blocks of pixels that halves of the picture alternate by."""


@dataclass(frozen=True)
class Still:
    """The still pixels: grey values and numbers of ON and OFF events, (pixels,) each."""

    grey: NDArray[np.float64]
    counts: dict[str, NDArray[np.int64]]
    half: NDArray[np.int64]
    duration_s: float


def still_pixels(folder: Path) -> Still:
    """Return the still pixels of a recording."""
    real = read(str(folder))
    images = [np.asarray(frame.image, dtype=np.float64) for frame in real.source.frames()]
    grey = np.mean(images, axis=0)
    events = real.events
    counts = {}
    for polarity, value in (("on", 1), ("off", 0)):
        part = events[events["p"] == value]
        at = part["y"].astype(np.int64) * grey.shape[1] + part["x"]
        number = np.bincount(at, minlength=grey.size).reshape(grey.shape)
        counts[polarity] = number[real.still]
    rows, columns = np.indices(grey.shape) // BLOCK
    half = ((rows + columns) % 2)[real.still]
    return Still(grey[real.still], counts, half, 1e-6 * float(events["t"][-1] - events["t"][0]))


def still_rates(folder: Path) -> list[dict[str, float]]:
    """Return a row for each bin of grey values that has enough still pixels."""
    still = still_pixels(folder)
    rows = []
    for low, high in itertools.pairwise(EDGES_DN):
        inside = (still.grey >= low) & (still.grey < high)
        if inside.sum() < FEWEST:
            continue
        row = {"light_dn": float(still.grey[inside].mean()), "pixels": float(inside.sum())}
        row["duration_s"] = still.duration_s
        for polarity, counts in still.counts.items():
            row[f"{polarity}_rate_hz"] = float(counts[inside].mean()) / still.duration_s
            row[f"{polarity}_top"] = top_share(counts[inside])
        rows.append(row)
    return rows


def top_share(counts: np.ndarray) -> float:
    """Return the share of all events that the busiest pixel in a hundred makes."""
    ordered = np.sort(counts)[::-1]
    total = float(ordered.sum())
    return float(ordered[: max(1, ordered.size // 100)].sum()) / total if total else 0.0
