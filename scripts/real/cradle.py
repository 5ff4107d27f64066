"""Noise rates of the still pixels of a recording with frames, against their grey value."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np

from real.recording import read

EDGES_DN = (0.5, 2, 5, 10, 20, 40, 80)
FEWEST = 200
"""Still pixels that a bin of grey values needs."""


def still_rates(folder: Path) -> list[dict[str, float]]:
    """Return a row for each bin of grey values that has enough still pixels."""
    real = read(str(folder))
    images = [np.asarray(frame.image, dtype=np.float64) for frame in real.source.frames()]
    grey = np.mean(images, axis=0)
    events = real.events
    duration = 1e-6 * float(events["t"][-1] - events["t"][0])
    counts = {}
    for polarity, value in (("on", 1), ("off", 0)):
        part = events[events["p"] == value]
        at = part["y"].astype(np.int64) * grey.shape[1] + part["x"]
        counts[polarity] = np.bincount(at, minlength=grey.size).reshape(grey.shape)
    rows = []
    for low, high in itertools.pairwise(EDGES_DN):
        inside = real.still & (grey >= low) & (grey < high)
        if inside.sum() < FEWEST:
            continue
        row = {"light_dn": float(grey[inside].mean()), "pixels": float(inside.sum())}
        row["duration_s"] = duration
        for polarity in ("on", "off"):
            row[f"{polarity}_rate_hz"] = float(counts[polarity][inside].mean()) / duration
            row[f"{polarity}_top"] = top_share(counts[polarity][inside])
        rows.append(row)
    return rows


def top_share(counts: np.ndarray) -> float:
    """Return the share of all events that the busiest pixel in a hundred makes."""
    ordered = np.sort(counts)[::-1]
    total = float(ordered.sum())
    return float(ordered[: max(1, ordered.size // 100)].sum()) / total if total else 0.0
