"""Two results of digests, and what differs between them."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]

MOST = 8
"""Keys that are told of one case."""


def kept(path: Path, name: str) -> Path:
    """Return where the events of a case of the results in `path` are kept."""
    return path.with_suffix("") / (re.sub(r"\W+", "_", name) + ".npz")


def difference(name: str, a: Path, b: Path) -> str:
    """Return how many events are the same ones, and how far their times are apart."""
    if not (kept(a, name).is_file() and kept(b, name).is_file()):
        return "events not kept"
    before, after = (np.load(kept(path, name))["events"] for path in (a, b))
    keys, polarities, instants = zip(
        *(_numbered(events) for events in (before, after)), strict=True
    )
    _, i, j = np.intersect1d(*keys, assume_unique=True, return_indices=True)
    same = polarities[0][i] == polarities[1][j]
    apart = np.abs(instants[0][i] - instants[1][j])[same]
    return (
        f"{same.sum()} the same, {np.count_nonzero(apart)} of them at other times,"
        f" at most {apart.max(initial=0)} us apart"
    )


def _numbered(events: Array) -> tuple[Array, ...]:
    """Return (pixel, number of the event in the pixel) as one integer, polarity and time."""
    pixels = events["y"].astype(np.int64) << 16 | events["x"]
    order = np.argsort(pixels, kind="stable")
    pixels = pixels[order]
    first = np.flatnonzero(np.diff(pixels, prepend=-1))
    number = np.arange(pixels.size) - np.repeat(first, np.diff(first, append=pixels.size))
    return pixels << 31 | number, events["p"][order], events["t"][order]


def changed(x: Mapping[str, Any], y: Mapping[str, Any]) -> str:
    """Return the keys that differ, the first of them with what they hold."""
    a, b = ({key: json.dumps(value) for key, value in z.items()} for z in (x, y))
    keys = [key for key in {**a, **b} if a.get(key) != b.get(key)]
    told = [
        f"{key} {' -> '.join(_cut(z[key]) if key in z else 'none' for z in (a, b))}"
        for key in keys[:MOST]
    ]
    more = [f"{len(keys) - MOST} more keys"] if len(keys) > MOST else []
    return "; ".join(told + more) or "the same in another order"


def _cut(text: str) -> str:
    return text if len(text) <= 80 else f"{text[:60]}...{text[-15:]}"


def comparison(a: Path, b: Path, wanted: Callable[[str], bool] = lambda name: True) -> list[str]:
    """Return a line for each case that differs, of those whose name is wanted."""
    before, after = (json.loads(path.read_text()) for path in (a, b))
    lines = []
    for name in filter(wanted, {**before, **after}):
        x, y = before.get(name), after.get(name)
        if json.dumps(x) == json.dumps(y):  # which tells 1 from 1.0 and true, and tells an order
            continue
        if x is None or y is None:
            lines.append(f"{name}: only in {b if x is None else a}")
        elif "error" in x or "error" in y:
            lines.append(f"{name}: {x.get('error', 'ran')} -> {y.get('error', 'runs')}")
        elif "holds" in x:
            lines.append(f"{name}: {changed(x['holds'], y['holds'])}")
        else:
            counts = " -> ".join(f"{z['events']} ({z['on']} ON)" for z in (x, y))
            lines.append(f"{name}: {counts}; {difference(name, a, b)}")
    return lines
