"""Runs one measurement in a process of its own, as its only argument says.

That is JSON: see :class:`benchmarks.processes.Job`.  Prints one line of JSON.  Imports nothing of
adv2e unless the tool is adv2e, so that it runs in the Python of another tool.
"""

from __future__ import annotations

import gc
import hashlib
import importlib
import json
import sys
import time
from typing import Any

import numpy as np

from benchmarks.measuring import measured, peak_mib

WARM_UP_FRAMES = 4
"""Frames of the run before the one that counts: compiles, loads, and makes threads."""
PAUSE_S = 0.4
"""So long; the threads that BLAS starts with NumPy wait busily for the first fifth of a second."""


def simulate(spec: dict[str, Any]) -> dict[str, Any]:
    """Time frames in memory to sorted events in memory; return the line to print."""
    tool = importlib.import_module(f"benchmarks.tools.{spec['tool']}")
    frames = np.load(spec["clip"])[: spec["frames"] * spec["stride"] : spec["stride"]]
    frames = np.ascontiguousarray(frames)
    fps = spec["fps"] / spec["stride"]
    run = tool.simulator(spec["options"])
    run(frames[:WARM_UP_FRAMES], fps)
    gc.collect()  # what the imports left behind would be collected once, during the run
    time.sleep(PAUSE_S)
    events, cost = measured(lambda: run(frames, fps))
    peak = peak_mib()
    t, x, y, p = tool.columns(events)
    if spec["probe"]:
        _store_probe(spec["probe"], frames.shape[2], t, x, y, p)
    return {
        **cost.as_dict(),
        "peak_mib": peak,
        "events": int(t.size),
        "pixels": int(frames[0].size),
        "frames": len(frames),
        "versions": tool.versions(),
        "digest": _digest(t, x, y, p) if spec["digest"] else None,
    }


def _digest(*columns: Any) -> str:
    digest = hashlib.sha256()
    for column in columns:
        digest.update(np.ascontiguousarray(column).astype(np.int64).tobytes())
    return digest.hexdigest()


def _store_probe(probe: dict[str, Any], width: int, t: Any, x: Any, y: Any, p: Any) -> None:
    """Store the events of some pixels: time [us], place in the list of pixels, polarity."""
    place = np.full(width * (int(y.max(initial=0)) + 1), -1)
    chosen = np.asarray(probe["pixels"])
    there = chosen < place.size
    place[chosen[there]] = np.flatnonzero(there)
    index = place[y.astype(np.int64) * width + x]
    kept = index >= 0
    np.savez(probe["path"], t=t[kept], pixel=index[kept], p=p[kept])


def main() -> None:
    spec = json.loads(sys.argv[1])
    module, _, name = spec["action"].partition(":")
    action = getattr(importlib.import_module(module), name)
    print(json.dumps(action(spec)))


if __name__ == "__main__":
    main()
