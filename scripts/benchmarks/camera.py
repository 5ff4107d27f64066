#!/usr/bin/env python
"""How long a push of a camera in a loop takes: at rest, with an object that moves, and all moving.

Pushes grey frames of 8 bits, 240 a second of the camera's time, into an ``adv2e.Camera`` and counts
the time of each push; what is told are medians over runs of the percentiles of a run::

    python scripts/benchmarks/camera.py -o out/camera.md
    python scripts/benchmarks/camera.py --runs 3 --pushes 200 -c ideal -c davis346 --threads 2

Prints a table; ``-o FILE.md`` also writes it, with the raw numbers in ``FILE.json``.
"""

from __future__ import annotations

import os
import statistics
import sys
import time
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1]))

import click
import cv2
import numpy as np
from numpy.typing import NDArray
from writing import one_line_errors, output_option, table, threads_option, write_report

from adv2e import Camera, load_config
from adv2e.background import default_threads
from adv2e.geometry import Size

FPS = 240.0
"""Frames a second of the camera's time; 4.17 ms each."""

SPEED = 0.5
"""Pixels from frame to frame that what moves goes: 120 pixels a second."""

CONFIGS = (
    "ideal",
    "adv2e",
    "davis240c",
    "davis346",
    "davis346 sampling.L=1",
    "davis346 pixel.photoreceptor_noise=null",
    "davis346 sampling.L=1 pixel.photoreceptor_noise=null",
)
"""A shipped configuration, and values of it that are others."""

SCENES = ("at rest", "an object", "all moves")

ABOUT = (
    "Time of one push [ms], percentiles; grey frames of 8 bits and linear light, {size}, {threads}"
    " threads on {cores} cores, load {load:.1f} at the start. Medians of {runs} runs of {pushes}"
    " pushes behind warm() and 20 others. 240 frames a second leave 4.17 ms for each. An object: a"
    " window of a third of the height, with a texture in motion, in a still picture; all moves: the"
    " whole picture; both go 120 pixels a second. CPU: of all threads together, median: what a push"
    " takes where others run on the cores, too."
)


def texture(height: int, width: int, seed: int) -> NDArray[np.uint8]:
    """Return blurred noise from 10 to 245."""
    noise = np.random.default_rng(seed).integers(0, 256, (height, width), np.uint8)
    return cv2.normalize(cv2.GaussianBlur(noise, (0, 0), 4), None, 10, 245, cv2.NORM_MINMAX)


def frames_of(scene: str, size: Size, count: int) -> list[NDArray[np.uint8]]:
    """Return the frames of a scene."""
    far = int(count * SPEED) + 2
    ground = texture(size.height, size.width + far, 1)
    still = np.ascontiguousarray(ground[:, : size.width])
    if scene == "at rest":
        return [still] * count
    if scene == "all moves":
        return [seen(ground, k * SPEED, size) for k in range(count)]
    side = size.height // 3
    thing = texture(side, side + far, 2)
    made = [still.copy() for _ in range(count)]
    for k, frame in enumerate(made):
        frame[side : 2 * side, side : 2 * side] = seen(thing, k * SPEED, Size(side, side))
    return made


def seen(ground: NDArray[np.uint8], x: float, size: Size) -> NDArray[np.uint8]:
    """Return what lies at x, between the pixels where it must, so that no frame is as the last."""
    return cv2.warpAffine(ground, np.float32([[1, 0, -x], [0, 1, 0]]), size)


def measured(camera: Camera, frames: list[NDArray[np.uint8]]) -> dict[str, Any]:
    """Return percentiles of the time of a push [ms], and the events of one."""
    camera.reset()
    took, cpu, events = [], [], []
    for number, frame in enumerate(frames):
        began, worked = time.perf_counter(), time.process_time()
        found = camera.push(frame, number / FPS)
        took.append((time.perf_counter() - began) * 1e3)
        cpu.append((time.process_time() - worked) * 1e3)
        events.append(found.size)
    p50, p90, p99 = np.percentile(took[20:], [50, 90, 99]).tolist()
    worked = statistics.median(cpu[20:])
    return {
        "p50": p50,
        "p90": p90,
        "p99": p99,
        "cpu": worked,
        "events": np.mean(events[20:]).item(),
    }


@click.command(help=__doc__, context_settings={"max_content_width": 100})
@click.option("-c", "configs", multiple=True, default=CONFIGS, help="'NAME KEY=VALUE ...'")
@click.option("--size", default="346x260", show_default=True)
@click.option("--pushes", type=click.IntRange(min=10), default=300, show_default=True)
@click.option("--runs", type=click.IntRange(min=1), default=5, show_default=True)
@threads_option
@output_option
@one_line_errors()
def main(
    configs: tuple[str, ...],
    size: str,
    pushes: int,
    runs: int,
    threads: int | None,
    output: Path | None,
) -> None:
    width, height = map(int, size.split("x"))
    scenes = {one: frames_of(one, Size(width, height), pushes + 20) for one in SCENES}
    load, rows, found = os.getloadavg()[0], [], {}
    cameras = {}
    for text in configs:
        name, *sets = text.split()
        config = load_config(name, [*sets, "frames.encoding=linear"])
        cameras[text] = Camera((width, height), config, threads=threads)
        cameras[text].warm()
    for text, camera in cameras.items():
        for scene, frames in scenes.items():
            several = [measured(camera, frames) for _ in range(runs)]
            found[f"{text}, {scene}"] = several
            told = [statistics.median(one[key] for one in several) for key in several[0]]
            rows.append([f"`{text}`", scene, *(f"{ms:.2f}" for ms in told[:4]), f"{told[4]:,.0f}"])
    about = ABOUT.format(
        size=size, threads=threads or default_threads(), cores=default_threads(), load=load,
        runs=runs, pushes=pushes,
    )  # fmt: skip
    head = ("configuration", "scene", "p50", "p90", "p99", "CPU", "events a push")
    write_report("\n\n".join([about, table(head, rows)]), output, found)


if __name__ == "__main__":
    main()
