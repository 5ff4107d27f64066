#!/usr/bin/env python
r"""How far interpolated frames are from the truth, as events: linear, flow and networks.

Scenes are rendered as a camera of 24, 30 and 60 frames a second would take them.  The frames go
through the interpolation and the default pixel (background noise off) to events.  The truth is the
same pixel, with the same thresholds, fed with the scene itself at 2000 pictures a second or more,
so that nothing moves by more than a quarter of a pixel between two.

Beside ``linear`` and ``flow`` stands ``perfect``: frames rendered at the L times of each interval.
What it lacks is due to L, not to interpolation.  ``--model`` adds networks, ``--max-motion`` flow
with as few frames as keep pixels from moving further than that between two.

    python scripts/studies/interpolation.py [--quick] [--model FILE.onnx] [-o FILE.md]

prints the tables; ``-o`` also writes them, with a figure in ``FILE.png``.
"""

from __future__ import annotations

import math
import os
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

import click
import numpy as np
from numpy.typing import NDArray
from writing import load_pyplot, one_line_errors, output_option, write_report

from adv2e.comparison.windows import frame_windows
from adv2e.config.model import Config, Frames, Pixel, Sampling
from adv2e.conversion.simulation import events_from_light
from adv2e.events import Events, cut
from adv2e.light.interpolation import make_upsampler
from adv2e.light.interpolation.sequence import neighbours
from adv2e.representations.voxel_grid import Grid, smoothed, voxel_grid
from studies.interpolation_report import Cost, Row, Score, draw, report
from studies.interpolation_scenes import Case, Image, cases

RATES = (24.0, 30.0, 60.0)
"""Frames a second."""

EXPOSURE_PARTS = 33
"""Pictures that are averaged to an exposed frame."""

BINS = 5
"""Temporal bins of a frame interval, as in ``adv2e compare``."""


Methods = Mapping[str, Sampling | None]
"""What makes the frames, by its name in the tables; None: the scene itself."""


@dataclass(frozen=True)
class Setup:
    """Size of the pictures, length of the clips, and what seeds everything."""

    width: int
    height: int
    longest_s: float
    seed: int
    L: int = 10

    def duration_s(self, case: Case) -> float:
        """Return the length of the clips of a case, a whole number of frames at every rate."""
        return min(self.longest_s, case.duration_s)


def configuration(setup: Setup, sampling: Sampling) -> Config:
    """Return the default pixel without background noise."""
    return Config(
        seed=setup.seed,
        sampling=sampling,
        pixel=replace(Pixel(), leak=None, shot_noise=None),
    )


def frame_times_ns(duration_s: float, rate: float) -> list[int]:
    return [round(k * 1e9 / rate) for k in range(round(duration_s * rate) + 1)]


def exposed(case: Case, setup: Setup, rate: float) -> Iterator[tuple[int, Image]]:
    """Yield frames that average the light over their exposures."""
    middles = (np.arange(EXPOSURE_PARTS) + 0.5) / EXPOSURE_PARTS - 0.5
    for t_ns in frame_times_ns(setup.duration_s(case), rate):
        times = t_ns * 1e-9 + case.exposure_s * middles
        parts = [case.light(float(t_s), setup.width, setup.height) for t_s in times]
        yield t_ns, np.mean(parts, axis=0, dtype=np.float32)


def rendered(case: Case, setup: Setup, rate: float) -> Iterator[tuple[int, Image]]:
    for t_ns in frame_times_ns(setup.duration_s(case), rate):
        yield t_ns, case.light(t_ns * 1e-9, setup.width, setup.height)


def filmed(case: Case, setup: Setup, rate: float) -> Iterator[tuple[int, Image]]:
    """Yield the frames as a camera gives them: with read noise and rounded, where the case says."""
    rng = np.random.default_rng([setup.seed, 4])
    frames = exposed if case.exposure_s else rendered
    for t_ns, light in frames(case, setup, rate):
        if case.read_noise:
            noisy = np.rint(light + case.read_noise * rng.standard_normal(light.shape))
            yield t_ns, np.clip(noisy, 0, 255).astype(np.float32)
        else:
            yield t_ns, light


def events(light: Iterator[tuple[int, Image]], config: Config) -> Events:
    return np.concatenate(list(events_from_light(light, config, threads=1)))


def true_events(case: Case, setup: Setup) -> Events:
    light = rendered(case, setup, case.true_hz(setup.height))
    return events(light, configuration(setup, Sampling(L=1)))


def methods_of(setup: Setup, models: Sequence[Path], max_motion: float | None) -> Methods:
    """Return what makes the frames, by the name in the tables."""
    L = setup.L
    found = {"linear": Sampling(L=L), "flow": Sampling(L=L, interpolation="flow")}
    if max_motion is not None:
        name = f"flow, {max_motion:g} px"
        found[name] = Sampling(L=L, interpolation="flow", max_motion_px=max_motion)
    for model in models:
        found[model.stem] = Sampling(L=L, interpolation="onnx", model=str(model))
    return {**found, "perfect": None}


def made_events(case: Case, setup: Setup, rate: float, sampling: Sampling | None) -> Events:
    """Return the events of one method; None: of the scene itself, rendered L times an interval."""
    if sampling is None:
        light = rendered(case, setup, rate * setup.L)
        return events(light, configuration(setup, Sampling(L=1)))
    config = configuration(setup, sampling)
    if case.declared:
        config = replace(config, frames=Frames(exposure_us=1e6 * case.exposure_s))
    return events(filmed(case, setup, rate), config)


def distance(true: Events, made: Events, times_ns: list[int], setup: Setup) -> float:
    """Return the distance of signed grids of five bins an interval, smoothed in space.

    Over the norm of the true grids; all intervals at once.
    """
    edges = np.array(times_ns)
    apart = norm = 0.0
    for window in frame_windows(edges, [(0, times_ns[-1] // 1000 + 1)]).used:
        a, b = (_grid(stream, window, setup) for stream in (true, made))
        apart += float(np.square(a - b).sum())
        norm += float(np.square(a).sum())
    return math.sqrt(apart / norm)


def _grid(stream: Events, window: tuple[int, int], setup: Setup) -> Grid:
    return smoothed(voxel_grid(cut(stream, *window), BINS, (setup.width, setup.height), window))


def nearest_ms(of: Events, among: Events, width: int) -> float:
    """Return the median time from an event to the nearest of the same pixel and polarity [ms].

    Infinite where half of the events have none.
    """
    stride = 1 << 40
    places, others = (_places(stream, width) * stride + stream["t"] for stream in (of, among))
    others.sort()
    after = np.searchsorted(others, places)
    nearest = np.full(places.size, np.inf)
    for index in (after - 1, after):
        there = (index >= 0) & (index < others.size)
        gap = np.abs(others[index[there]] - places[there]).astype(float)
        same = others[index[there]] // stride == places[there] // stride
        nearest[there] = np.minimum(nearest[there], np.where(same, gap, np.inf))
    return float(np.median(nearest)) * 1e-3


def _places(stream: Events, width: int) -> NDArray[np.int64]:
    places: NDArray[np.int64] = 2 * (stream["y"].astype(np.int64) * width + stream["x"])
    places += stream["p"]
    return places


def score(true: Events, made: Events, times_ns: list[int], setup: Setup) -> Score:
    if not made.size:
        return Score(0.0, 1.0, math.inf, math.inf)
    return Score(
        ratio=made.size / true.size,
        distance=distance(true, made, times_ns, setup),
        made_to_true_ms=nearest_ms(made, true, setup.width),
        true_to_made_ms=nearest_ms(true, made, setup.width),
    )


def frames_made(case: Case, setup: Setup, rate: float, sampling: Sampling | None) -> float:
    """Return how many frames an interval gets, in the mean."""
    if sampling is None or sampling.max_motion_px is None:
        return setup.L
    upsampler = make_upsampler(sampling)
    pairs = neighbours(filmed(case, setup, rate))
    return float(np.mean([upsampler.count(a, b, beside) for (_, a), (_, b), beside in pairs]))


def study(case: Case, setup: Setup, methods: Methods) -> list[Row]:
    """Return the rows of one case, one a frame rate."""
    true = true_events(case, setup)
    found = []
    for rate in RATES:
        times_ns = frame_times_ns(setup.duration_s(case), rate)
        scores = {
            name: score(true, made_events(case, setup, rate, sampling), times_ns, setup)
            for name, sampling in methods.items()
        }
        made = {name: frames_made(case, setup, rate, one) for name, one in methods.items()}
        step_px = case.speed(setup.height) / rate
        found.append(Row(case.name, rate, step_px, true.size, scores, made))
    return found


def costs(seed: int, sizes: list[tuple[int, int]], methods: Methods) -> list[Cost]:
    """Return what ten frames of an interval of the pan cost on one thread, the best of three."""
    found = []
    for width, height in sizes:
        a, b = (cases(seed)[1].light(t_s, width, height) for t_s in (0.0, 1 / 30))
        for method, sampling in methods.items():
            if sampling is None:
                continue
            took = []
            for _ in range(4):  # the first also compiles
                upsampler = make_upsampler(sampling)  # which keeps the motion it found
                start = time.perf_counter()
                for _ in upsampler.between(a, b):
                    pass
                took.append(time.perf_counter() - start)
            found.append(Cost(width, height, method, 1e3 * min(took[1:])))
    return found


def run(setup: Setup, methods: Methods, tell: Callable[[str], None]) -> list[Row]:
    """Return all rows, in the order of the cases."""
    with ThreadPoolExecutor(os.cpu_count() or 1) as pool:
        rows = []
        for found in pool.map(lambda case: study(case, setup, methods), cases(setup.seed)):
            tell(f"done: {found[0].case}")
            rows += found
    return rows


@click.command()
@click.option("--quick", is_flag=True, help="Small pictures and short clips.")
@click.option(
    "--seed",
    type=click.IntRange(min=0),
    default=0,
    show_default=True,
    help="Of textures, paths and thresholds.",
)
@click.option(
    "--model",
    "models",
    type=click.Path(exists=True, dir_okay=False, path_type=Path),
    metavar="FILE.onnx",
    multiple=True,
    help="A network to measure, too; may be given again.",
)
@click.option(
    "--max-motion", type=click.FloatRange(min=0, min_open=True), metavar="PX",
    help="Measure flow with sampling.max_motion_px, too.",
)  # fmt: skip
@output_option
@one_line_errors()
def main(
    quick: bool, seed: int, models: tuple[Path, ...], max_motion: float | None, output: Path | None
) -> None:
    """Measure how far interpolated frames are from the truth, as events."""
    if output:
        load_pyplot()  # before the work, so that a missing package costs no time
    size = (128, 96, 1 / 6) if quick else (240, 180, 0.5)
    setup = Setup(*size, seed)
    methods = methods_of(setup, models, max_motion)
    rows = run(setup, methods, partial(click.echo, err=True))
    sizes = [(240, 180)] if quick else [(240, 180), (346, 260), (640, 480)]
    write_report(report(rows, costs(seed, sizes, methods)), output)
    if output:
        draw(rows, output.with_suffix(".png"))


if __name__ == "__main__":
    main()
