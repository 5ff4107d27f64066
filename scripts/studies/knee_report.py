"""Scores of the study of the knee, as Markdown tables and a figure."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from writing import load_pyplot, save_figure, table

THIRDS = ("dark", "middle", "bright")

TOLERANCE = 0.02
"""Distances that are this near to the least one [share of it] count as equal."""

_DEFINITIONS = """\
distance: norm of the difference between the signed grids of five bins a frame interval of the
video's events and of the reference's, over all intervals, over the norm of the reference's grids.
above least: the same less that of the best map, seed by seed. error: the time-smoothed distance of
`adv2e compare`. Events: counts over those of the reference, in all and in each third of the scene's
light. At rest: false events a pixel a second where nothing moves. ±: standard error over seeds."""


@dataclass(frozen=True)
class Score:
    """Scores of one map on one video; see `_DEFINITIONS`."""

    distance: float
    error: float
    rest: float
    ratio: NDArray[np.float64]


@dataclass(frozen=True)
class Scores:
    """Scores by (scene, noise, seed, map)."""

    scenes: tuple[str, ...]
    noises: tuple[float, ...]
    maps: tuple[str, ...]
    distance: NDArray[np.float64]
    error: NDArray[np.float64]
    rest: NDArray[np.float64]
    """False events a pixel a second at rest [Hz]."""
    ratio: NDArray[np.float64]
    """Events over those of the reference; last axis: all light, then its thirds."""

    @classmethod
    def empty(
        cls,
        scenes: tuple[str, ...],
        noises: tuple[float, ...],
        seeds: int,
        maps: tuple[str, ...],
    ) -> Scores:
        """Return scores that are still to be put in."""
        shape = (len(scenes), len(noises), seeds, len(maps))
        distance, error, rest = (np.full(shape, np.nan) for _ in range(3))
        return cls(scenes, noises, maps, distance, error, rest, np.full((*shape, 4), np.nan))

    def put(self, place: tuple[int, int, int, int], score: Score) -> None:
        """Put in the scores at (scene, noise, seed, map)."""
        self.distance[place] = score.distance
        self.error[place] = score.error
        self.rest[place] = score.rest
        self.ratio[place] = score.ratio

    def by_seed(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return `values` averaged over scenes and noise levels, (seeds, maps)."""
        return values.mean(axis=(0, 1))


def mean_and_error(by_seed: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return mean and standard error of the mean over seeds (first axis)."""
    return by_seed.mean(axis=0), by_seed.std(axis=0, ddof=1) / math.sqrt(len(by_seed))


def least(scores: Scores) -> int:
    """Return the map of the least mean distance."""
    return int(scores.by_seed(scores.distance).mean(axis=0).argmin())


def recommended(scores: Scores) -> int:
    """Return the map with the fewest events at rest among those of (nearly) the least distance."""
    distance = scores.by_seed(scores.distance).mean(axis=0)
    rest = scores.by_seed(scores.rest).mean(axis=0)
    near = distance <= (1.0 + TOLERANCE) * distance.min()
    return int(np.where(near, rest, np.inf).argmin())


def report(scores: Scores, lights: Mapping[str, NDArray[Any]]) -> str:
    """Return all tables and the choice, as Markdown."""
    parts = [_scene_table(lights), _main_table(scores), _DEFINITIONS, _case_table(scores)]
    return "\n\n".join([*parts, _choice(scores)])


def _scene_table(lights: Mapping[str, NDArray[Any]]) -> str:
    head = ("scene", "light [DN]", "median", "below 2.72 DN", "below 20 DN")
    rows = []
    for name, light in lights.items():
        shares = [f"{100 * float((light < knee).mean()):.0f} %" for knee in (math.e, 20.0)]
        span = f"{light.min():.2g} to {light.max():.3g}"
        rows.append([name, span, f"{np.median(light):.3g}", *shares])
    return table(head, rows)


def _main_table(scores: Scores) -> str:
    by_seed = scores.by_seed(scores.distance)
    distance = mean_and_error(by_seed)
    above = mean_and_error(by_seed - by_seed[:, [least(scores)]])
    error = scores.by_seed(scores.error).mean(axis=0)
    ratio = scores.ratio.mean(axis=(0, 1, 2))
    rest = scores.rest.mean(axis=(0, 2))
    head = [
        *("knee [DN]", "distance", "above least", "error", "events, all", *THIRDS),
        *(f"at rest, noise {noise:g}" for noise in scores.noises),
    ]
    rows = [
        [
            name,
            *(f"{mean[k]:.3f} ± {se[k]:.3f}" for mean, se in (distance, above)),
            f"{error[k]:.3f}",
            *(f"{value:.2f}" for value in ratio[k]),
            *(f"{value:.2f}" for value in rest[:, k]),
        ]
        for k, name in enumerate(scores.maps)
    ]
    return table(head, rows)


def _case_table(scores: Scores) -> str:
    """Return the distance by scene and noise, the least of each in bold."""
    distance = scores.distance.mean(axis=2)
    smallest = distance.min(axis=2, keepdims=True)
    head = [
        "distance at knee [DN]",
        *(f"{scene}, noise {noise:g}" for scene in scores.scenes for noise in scores.noises),
    ]
    rows = []
    for k, name in enumerate(scores.maps):
        cells = [
            f"**{value:.3f}**" if value < low + 5e-4 else f"{value:.3f}"
            for value, low in zip(distance[..., k].ravel(), smallest.ravel(), strict=True)
        ]
        rows.append([name, *cells])
    return table(head, rows)


def _choice(scores: Scores) -> str:
    mean = scores.by_seed(scores.distance).mean(axis=0)
    error = scores.by_seed(scores.error).mean(axis=0)
    best, chosen, name = least(scores), recommended(scores), scores.maps
    near = "; ".join(name[k] for k in np.flatnonzero(mean <= (1 + TOLERANCE) * mean[best]))
    return (
        f"Least distance at {name[best]}. Within {100 * TOLERANCE:g} % of it: {near}. Of these"
        f" {name[chosen]} makes the fewest false events at rest, at"
        f" {100 * (mean[chosen] / mean[best] - 1):.1f} % more distance: recommended."
        f" Least error at {name[int(error.argmin())]}."
    )


def draw(scores: Scores, path: Path) -> None:
    """Write the figure: distance, events by third of the light, and false events at rest."""
    figure, axes = load_pyplot().subplots(1, 3, figsize=(13.5, 4.2), layout="constrained")
    place = np.arange(len(scores.maps))
    for scene, values in zip(scores.scenes, scores.distance.mean(axis=(1, 2)), strict=True):
        axes[0].plot(place, values, "o-", ms=3, lw=1, label=scene)
    mean, se = mean_and_error(scores.by_seed(scores.distance))
    axes[0].errorbar(place, mean, se, fmt="ks-", ms=4, capsize=3, label="mean, ± standard error")
    axes[0].set(title="Distance from the reference's events", ylabel="relative distance")
    ratio = scores.ratio.mean(axis=(0, 1, 2))
    for third, values in zip(THIRDS, ratio[:, 1:].T, strict=True):
        axes[1].plot(place, values, "o-", ms=3, label=f"{third} third of the light")
    axes[1].axhline(1.0, color="grey", lw=0.8)
    axes[1].set(title="Events over those of the reference", ylabel="ratio")
    for noise, values in zip(scores.noises, scores.rest.mean(axis=(0, 2)), strict=True):
        axes[2].plot(place, values, "o-", ms=3, label=f"noise {noise:g} codes")
    axes[2].set_yscale("symlog", linthresh=0.1)
    axes[2].set_ylim(bottom=0.0)
    axes[2].set(title="False events where nothing moves", ylabel="events a pixel a second")
    for one in axes:
        one.axvline(recommended(scores), color="grey", ls=":", lw=1)
        one.set_xticks(place, scores.maps, rotation=60, ha="right", fontsize=8)
        one.set_xlabel("knee [DN of 255, linear light]; 0: logarithm")
        one.grid(alpha=0.3)
        one.legend(fontsize=8)
    save_figure(figure, path)
