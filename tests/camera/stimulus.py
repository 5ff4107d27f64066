"""A light that is the same everywhere and known at all times: what a lamp before the camera does.

Its course is a table of times [s] and light [DN]: lines between rows, leaps where two rows have the
same time.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from camera.scene import Flat

Rows = list[tuple[float, float]]

_LAST_S = 0.01
"""Rest at the end."""
LEVELS_DN = (4.0, 9.0, 20.0, 55.0, 150.0, 60.0, 25.0, 8.0)
"""What the lamp leaps between, in turn: by 0.8 to 1.1 ln, in the dark and in bright light."""


def bench(duration_s: float, seed: int) -> Rows:
    """Return what a bench does: leaps between levels, rests, and slow swings.

    Two thirds of the time are leaps, 20 to 60 ms apart; then the light rests dark and bright for a
    while, and swings once.
    """
    random = np.random.default_rng([seed, 41])
    rows = [(0.0, LEVELS_DN[0])]
    time, level = 0.0, 0
    while True:
        time = round(time + random.choice([0.02, 0.03, 0.045, 0.06]), 6)
        if time > 0.66 * duration_s:
            break
        level += 1
        rows += [(time, rows[-1][1]), (time, LEVELS_DN[level % len(LEVELS_DN)])]
    for dn in (6.0, 120.0):
        rows += [(time, rows[-1][1]), (time, dn)]
        time = round(time + 0.1 * duration_s, 6)
    rows += [(time, rows[-1][1])]
    swing = np.linspace(0.0, 1.0, 61)[1:]
    left = duration_s - time - _LAST_S
    rows += [
        (round(time + left * at, 6), float(120.0 * np.exp(-1.5 * np.sin(2 * np.pi * at) ** 2)))
        for at in swing.tolist()
    ]
    return [*rows, (duration_s, rows[-1][1])]


def stamped(rows: Rows, offset_us: float, drift_ppm: float) -> Rows:
    """Return the rows by a clock that is late and slow as that of frames is: see the shutter.

    The light rests at both ends, which stay where they are.
    """
    inner = [((time - 1e-6 * offset_us) / (1.0 + 1e-6 * drift_ppm), dn) for time, dn in rows[1:-1]]
    return [rows[0], *inner, rows[-1]]


def scene(rows: Rows) -> Flat:
    """Return what pixels see of such a light."""
    times, light = np.array(rows).T

    def course(at: NDArray[np.float64]) -> NDArray[np.float64]:
        # of a leap, what is after it
        after = np.searchsorted(times, at, "right").clip(1, len(times) - 1)
        whole = times[after] - times[after - 1]
        share = np.divide(at - times[after - 1], whole, out=np.ones_like(at), where=whole > 0.0)
        return light[after - 1] + np.minimum(share, 1.0) * (light[after] - light[after - 1])

    return Flat(course)


def write_table(path: Path, rows: Rows) -> None:
    """Write the table that a diagnosis reads."""
    lines = [f"{time:.9f},{light:.6f}\n" for time, light in rows]
    path.write_text("time_s,light_dn\n" + "".join(lines), "ascii")
