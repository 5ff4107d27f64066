#!/usr/bin/env python
"""How far each update form is from the circuit it stands for, on edges and a ramp.

Prints, for each form and K, the ratio of event counts to the exact solution's and the mean
distance in time between events of the same number, in Markdown.  Corner proportional to light (300
Hz at white), pure logarithm, threshold 0.2, 24 frames a second, L = 10, no noise.  The exact form
is itself held to a dense ODE by the tests.

    python scripts/studies/updates.py
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1]))

import click
import numpy as np
from numpy.typing import NDArray
from writing import table

from adv2e.config.model import LogResponse, LowPass, Pixel, Sampling, Thresholds
from adv2e.kernel import per_pixel
from adv2e.pixel.array import PixelArray

INTERVAL_NS = round(1e9 / 240)
FORMS = ("paper", "zero_order_hold", "euler", "first_order_hold", "exact")
KS = (1, 2, 5, 10, 20, 50, 100)


def edge(low: float, high: float) -> NDArray[Any]:
    """Return the light of one pixel that goes from `low` to `high` DN in one sub-frame."""
    return np.array([low] * 4 + [high] * 61)[:, None]


def ramp() -> NDArray[Any]:
    """Return the light of one pixel that rises from 100 to 200 DN over five frames, then rests."""
    return np.concatenate([np.full(3, 100.0), np.linspace(100, 200, 51), np.full(60, 200.0)])[
        :, None
    ]


STIMULI = {
    "ON edge 10 to 255 DN in one sub-frame": edge(10.0, 255.0),
    "OFF edge 255 to 10 DN in one sub-frame": edge(255.0, 10.0),
    "slow ramp 100 to 200 DN over five frames": ramp(),
}


def solve(light: NDArray[Any], update: str, K: int) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return times [us] and polarities of the events; `paper` starts at its own fixed point."""
    pixel = Pixel(
        log_response=LogResponse(linear_below=0),
        low_pass=LowPass(dark_cutoff_hz=0, update=update),
        thresholds=Thresholds(mismatch=0),
        refractory=None,
        leak=None,
        shot_noise=None,
    )
    times = [k * INTERVAL_NS for k in range(len(light))]
    array = PixelArray(pixel, Sampling(K=K), 0, light[0][None], 0, threads=1, exact_times=True)
    if update == "paper":
        a = 2 * np.pi * 300 * light[0] / 255 * INTERVAL_NS * 1e-9 / K
        array.state[per_pixel.LAG] = (a / -np.expm1(-a) - 1) * array.state[per_pixel.X]
        array.state[per_pixel.REFERENCE] += array.state[per_pixel.LAG]
    events = array.advance(light[:, None, :], times, np.zeros(len(light), np.bool_))
    return array.last_times, events["p"]


@click.command()
def main() -> None:
    """Measure how far each form of the filter's update is from the circuit."""
    for name, light in STIMULI.items():
        truth, _ = solve(light, "exact", 1)
        print(f"\n{name} ({len(truth)} events): events, relative to exact / mean time error [us]\n")
        rows = []
        for form in FORMS:
            cells = [f"`{form}`"]
            for K in KS:
                times, _ = solve(light, form, K)
                shared = min(len(times), len(truth))
                error = np.abs(times[:shared] - truth[:shared]).mean()
                cells.append(f"{len(times) / len(truth):.2f} / {error:.0f}")
            rows.append(cells)
        print(table(["form", *(f"K = {K}" for K in KS)], rows))


if __name__ == "__main__":
    main()
