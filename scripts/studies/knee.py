#!/usr/bin/env python
r"""Chooses the knee of the log map, ``pixel.log_response.linear_below``, for 8-bit sRGB video.

The map is x = DN ln(k)/k below the knee k and ln DN above it, DN being linear light (255 at white);
k = 0 means ln max(DN, floor) everywhere.  On the foot a contrast counts DN ln(k)/k times what it
should: ln(k) times at the knee, less and less below it.  A high knee therefore distorts the
contrast of all that is dark; without one, and with a low floor, the rounding to 8 bits and the read
noise of dark video become events.

Reference
    The chosen one: the events of a pixel with a purely logarithmic photoreceptor, x = ln max(DN,
    0.1), for the unrounded light of a made scene.
Video
    The same frames as 8-bit sRGB codes, with normal read noise added to the code before it is
    rounded, decoded again and given to the pixel with the map under test.

Both take the same frames at the same rate through the same linear interpolation, so that its error
cancels.  Noise events, leak and mismatch of thresholds are off; low-pass and dead time are those of
the default configuration.  All maps see the same noise, so that their differences are surer than
the scores themselves.

    python scripts/studies/knee.py [--quick] [-o FILE.md] [--fps F] [--encoding srgb|linear]

prints the tables; ``-o`` also writes them, with a figure in ``FILE.png``.
"""

from __future__ import annotations

import math
import os
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

import click
import numpy as np
from numpy.typing import NDArray
from writing import load_pyplot, one_line_errors, output_option, write_report

from adv2e.comparison.smoothed_error import smoothed_errors
from adv2e.comparison.windows import frame_windows
from adv2e.config.model import Config, Pixel, Sampling
from adv2e.conversion.simulation import events_from_light
from adv2e.effects.frames.encoding import LightDecoder, encode_light
from adv2e.effects.pixel.log_response import LogResponse
from adv2e.effects.pixel.thresholds import Thresholds
from adv2e.events import Events, cut
from adv2e.representations.voxel_grid import Grid, voxel_grid
from adv2e.synthetic import Scene
from adv2e.synthetic.scene import GO_S, PERIOD_S, RAMP_S
from studies.knee_report import Score, Scores, draw, report

Light = NDArray[np.float32]
"""(frames, rows, columns) [DN of 255, linear light]."""

MAPS = {
    **{f"0, floor {dn:g}": LogResponse(linear_below=0.0, floor=dn) for dn in (0.1, 0.3, 0.5, 1.0)},
    **{
        "e = 2.72" if knee == math.e else f"{knee:g}": LogResponse(linear_below=knee)
        for knee in (1.2, 1.5, 2.0, math.e, 4.0, 5.0, 7.0, 10.0, 15.0, 20.0)
    },
}
"""The maps compared; the logarithm with a higher floor is the other way to quieten the dark."""

TRUTH = LogResponse(linear_below=0.0, floor=0.1)
"""The map of the reference."""

NOISES = (0.0, 0.5, 1.0)
"""Read noise [8-bit codes, rms]."""

BINS = 5
"""Temporal bins of a frame interval, as in ``adv2e compare``."""

REST_START_S = 2 * RAMP_S + GO_S + 0.1
"""From here on nothing moves, and the low-pass has settled [s]."""


def as_rendered(light: Light) -> Light:
    return light


def underexposed(light: Light) -> Light:
    return (light / 8.0).astype(np.float32)


def half_in_shadow(light: Light) -> Light:
    """Darken the left part 40 times; the border is soft, across the middle fifth."""
    place = (np.arange(light.shape[2]) + 0.5) / light.shape[2]
    share = np.clip((0.6 - place) / 0.2, 0.0, 1.0)
    share = share * share * (3.0 - 2.0 * share)
    darkened: Light = (light * np.exp(-math.log(40.0) * share)).astype(np.float32)
    return darkened


SCENES: dict[str, Callable[[Light], Light]] = {
    "as rendered": as_rendered,
    "1/8 of the light": underexposed,
    "half in 1/40 shadow": half_in_shadow,
}


@dataclass(frozen=True)
class Setup:
    """What is simulated, and on how many threads."""

    width: int
    height: int
    seeds: int
    fps: float
    encoding: str
    threads: int

    @property
    def times_ns(self) -> list[int]:
        """Times of the frames of one period of going and resting [ns]."""
        return [round(k * 1e9 / self.fps) for k in range(round(self.fps * PERIOD_S) + 1)]


def configuration(response: LogResponse) -> Config:
    pixel = Pixel(
        log_response=response,
        thresholds=Thresholds(on=0.2, off=0.2, mismatch=0.0),
        leak=None,
        shot_noise=None,
    )
    return Config(sampling=Sampling(L=10), pixel=pixel)


def codes_of(light: Light, encoding: str) -> NDArray[np.float64]:
    """Return the code of `light` before rounding: linear, or sRGB (IEC 61966-2-1)."""
    return 255.0 * encode_light(np.clip(light.astype(np.float64), 0.0, 255.0), encoding)


def filmed(light: Light, noise: float, seed: int, encoding: str) -> Light:
    """Return the light as decoded from 8-bit video with read noise [codes, rms]."""
    draws = np.random.default_rng([seed, 2]).standard_normal(light.shape)
    codes = np.clip(np.rint(codes_of(light, encoding) + noise * draws), 0, 255).astype(np.uint8)
    decoder = LightDecoder(encoding, 255.0, np.uint8, colour=False)
    return np.stack([decoder.decode(image) for image in codes])


def events_of(light: Light, setup: Setup, response: LogResponse) -> Events:
    frames = zip(setup.times_ns, light, strict=True)
    return np.concatenate(list(events_from_light(frames, configuration(response), threads=1)))


class Reference:
    """The events that the video should have given, and how far others are from them."""

    def __init__(self, light: Light, setup: Setup) -> None:
        self.setup = setup
        self.light = light
        self.events = events_of(light, setup, TRUTH)
        times_ns = np.array(setup.times_ns)
        self.windows = frame_windows(times_ns, [(0, round(setup.times_ns[-1] / 1000))]).used
        self.grids = [self._grid(self.events, k) for k in range(len(self.windows))]
        self.norm = math.sqrt(sum(float(np.square(grid).sum()) for grid in self.grids))
        self.levels = np.quantile(light, (1 / 3, 2 / 3))
        self.counts = self._counts(self.events)

    def score(self, events: Events) -> Score:
        """Return the scores of a stream."""
        errors = smoothed_errors(self.events, events, self.setup.width)
        assert errors is not None, "every scene moves"
        return Score(
            distance=self._distance(events),
            error=float(np.mean(errors)),
            rest=self._rest_rate(events),
            ratio=self._counts(events) / self.counts,
        )

    def _grid(self, events: Events, window: int) -> Grid:
        edges = self.windows[window]
        return voxel_grid(cut(events, *edges), BINS, (self.setup.width, self.setup.height), edges)

    def _distance(self, events: Events) -> float:
        """Return the distance of all windows at once: false events at rest count, too."""
        apart = (self._grid(events, k) - grid for k, grid in enumerate(self.grids))
        return math.sqrt(sum(float(np.square(grid).sum()) for grid in apart)) / self.norm

    def _counts(self, events: Events) -> NDArray[np.int64]:
        """Return counts of all events, and of those in each third of the scene's light."""
        frame = np.rint(events["t"] * (self.setup.fps * 1e-6)).astype(np.int64)
        frame = np.minimum(frame, len(self.light) - 1)
        third = np.searchsorted(self.levels, self.light[frame, events["y"], events["x"]])
        return np.concatenate([[events.size], np.bincount(third, minlength=3)])

    def _rest_rate(self, events: Events) -> float:
        """Return the events a pixel a second while nothing moves [Hz]."""
        count = np.count_nonzero(events["t"] >= REST_START_S * 1e6)
        still_s = self.setup.times_ns[-1] * 1e-9 - REST_START_S
        return count / (still_s * self.setup.width * self.setup.height)


def score(reference: Reference, video: Light, response: LogResponse) -> Score:
    """Return the scores of one map on one video."""
    return reference.score(events_of(video, reference.setup, response))


def run(setup: Setup, tell: Callable[[str], None]) -> tuple[Scores, dict[str, Light]]:
    """Return the scores of all maps, and the first seed's light of each scene."""
    scores = Scores.empty(tuple(SCENES), NOISES, setup.seeds, tuple(MAPS))
    lights: dict[str, Light] = {}
    with ThreadPoolExecutor(setup.threads) as pool:
        for seed in range(setup.seeds):
            scene = Scene(seed)
            times_s = [t * 1e-9 for t in setup.times_ns]
            rendered = np.stack([scene.light(t, setup.width, setup.height) for t in times_s])
            for s, (name, change) in enumerate(SCENES.items()):
                tell(f"seed {seed + 1} of {setup.seeds}, scene: {name}")
                light = change(rendered)
                lights.setdefault(name, light)
                reference = Reference(light, setup)
                videos = [filmed(light, noise, seed, setup.encoding) for noise in NOISES]
                found = {
                    (n, m): pool.submit(score, reference, video, response)
                    for n, video in enumerate(videos)
                    for m, response in enumerate(MAPS.values())
                }
                for (n, m), future in found.items():
                    scores.put((s, n, seed, m), future.result())
    return scores, lights


@click.command()
@click.option("--quick", is_flag=True, help="A small picture and two seeds.")
@click.option(
    "--fps", type=click.FloatRange(10, 1000), default=30.0, show_default=True,
    help="Rate of the video [1/s].",
)  # fmt: skip
@click.option(
    "--encoding", type=click.Choice(["srgb", "linear"]), default="srgb", show_default=True
)
@click.option(
    "--seeds", type=click.IntRange(min=2), help="Scenes made.  [default: 4, with --quick 2]"
)
@output_option
@one_line_errors()
def main(quick: bool, fps: float, encoding: str, seeds: int | None, output: Path | None) -> None:
    """Compare knees of the log map for 8-bit video."""
    if output:
        load_pyplot()  # before the work, so that a missing package costs no time
    width, height, usual = (64, 48, 2) if quick else (173, 130, 4)
    setup = Setup(width, height, seeds or usual, fps, encoding, os.cpu_count() or 1)
    scores, lights = run(setup, partial(click.echo, err=True))
    write_report(report(scores, lights), output)
    if output:
        draw(scores, output.with_suffix(".png"))


if __name__ == "__main__":
    main()
