"""Events of the edges without adv2e: by a dense solution of the circuit, and by a camera.

Both are those of the tests (``tests/reference``, ``tests/camera``), which share no code with adv2e.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.errors import MissingExtraError
from adv2e.events import Events, make_events, sort_events
from experiments.clip import Clip
from experiments.edges import Edges, Values

CIRCUIT: dict[str, Any] = {
    "linear_below": 0.0,  # the logarithm everywhere, as in a photoreceptor
    "cutoff_hz": 300.0,  # the rest: defaults of v2e
    "dark_cutoff_hz": 21.8,
    "dead_time_us": 500.0,
}
LEVEL, MISMATCH = 0.2, 0.03
"""Thresholds of the circuit, and their deviation over pixels [ln]."""

AS_THE_CIRCUIT = ("pixel.log_response.linear_below=0",)
"""What the configurations of adv2e with v2e's numbers lack to be the circuit."""

EFFECTS = (
    "threshold_mismatch", "low_pass", "dark_current", "source_follower", "refractory",
    "reset_overshoot", "leak", "photo_leak", "shot_noise", "photoreceptor_noise", "hot_pixels",
    "dead_pixels",
)  # fmt: skip
"""Of the camera, each in its middle size in ``tests/camera/catalogue.py``."""

KNOTS_S = np.unique(
    np.round(np.concatenate([np.arange(-0.008, 0.01, 1e-4), np.geomspace(0.01, 0.27, 40)]), 6)
)
"""Light is a straight line, in its logarithm, between these times about a passage [s]: events are
moved by less than 10 us, by 60 us where the stop lies between two."""


def of_the_tests(name: str) -> Any:
    """Return a module of the tests.

    Raises
    ------
    MissingExtraError
        SciPy is not installed.
    """
    folder = str(Path(__file__).parents[3] / "tests")
    if folder not in sys.path:
        sys.path.append(folder)
    try:
        return import_module(name)
    except ImportError as error:
        raise MissingExtraError("the truth", "studies") from error


@dataclass(frozen=True)
class Dense:
    """The dense solution of the circuit for every pixel that an edge comes near to.

    A pixel sees the same light as all others of its band, at another time, unless the edge stops
    before it is past: such pixels share one solution.
    """

    edges: Edges

    @cached_property
    def _pixels(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        rows, columns = self.edges.pixels()
        near = self.edges.near()
        return rows[near], columns[near]

    @cached_property
    def _paths(self) -> list[Any]:
        """The filtered signal of each pixel."""
        edges = self.edges
        rows, columns = self._pixels
        passage = edges.passage(rows, columns)
        # how long the edge still moves after its passage; long enough is all the same
        left = np.minimum(edges.stop_s - passage, -KNOTS_S[0])
        courses, which = np.unique(
            np.stack([edges.band_of(rows), np.round(1e7 * left).astype(np.int64)]),
            axis=1, return_index=True, return_inverse=True,
        )[1:]  # fmt: skip
        of = rows[courses], columns[courses]
        light = edges.light(*of, passage[courses] + KNOTS_S[:, None])
        solve = of_the_tests("reference.dense_signal").solve_signal
        paths = solve(light, KNOTS_S, self._circuit(LEVEL, LEVEL))
        return [paths[k] for k in which.ravel()]

    def _circuit(self, on: Any, off: Any) -> Any:
        return of_the_tests("reference.circuit").Circuit(**CIRCUIT, on=on, off=off)

    def events(self, seed: int) -> Events:
        """Return the events of pixels whose thresholds the seed draws; times to a microsecond."""
        rows, columns = self._pixels
        random = np.random.default_rng([seed, 29])
        on, off = np.maximum(0.01, LEVEL + MISMATCH * random.standard_normal((2, len(rows))))
        find = of_the_tests("reference.dense_ode").find_events
        parts = []
        for k, one in enumerate(find(self._paths, self._circuit(on, off))):
            if len(one.events):
                t_us = 1e6 * (one.events[:, 0] + self.edges.passage(rows[k], columns[k]))
                at = np.full(len(t_us), columns[k]), np.full(len(t_us), rows[k])
                parts.append(make_events(np.rint(t_us), *at, one.events[:, 1] > 0))
        events = np.concatenate(parts)
        return sort_events(events[events["t"] <= 1e6 * self.edges.end_s])


@dataclass(frozen=True)
class Camera:
    """The camera by brute force before the edges, with noise, mismatch, and two poles.

    Its corner, thresholds and dead time are not those that simulators have by default.
    """

    edges: Edges
    rate: float

    @property
    def hidden(self) -> Mapping[str, Any]:
        """Its effects, in the keys of the configuration."""
        catalogue = of_the_tests("camera.catalogue")
        cases = list(catalogue.cases(*EFFECTS, size="middle"))
        merged: Mapping[str, Any] = of_the_tests("camera.settings").merged(
            *(case.hidden for case in cases)
        )
        return merged

    def _made(self, seed: int) -> Any:
        return of_the_tests("camera").Camera(
            _Scene(self.edges), hidden=self.hidden, size=self.edges.size,
            duration_s=self.edges.end_s, fps=self.rate, seed=seed,
        )  # fmt: skip

    def clip(self) -> Clip:
        """Return its frames, of 16 bits."""
        frames = list(self._made(0).frames())
        light = np.stack([frame.image for frame in frames]) * np.float32(255.0 / 65535.0)
        times = np.rint(1e9 * np.array([frame.stamp for frame in frames])).astype(np.int64)
        return Clip(light, times)

    def events(self, seed: int) -> Events:
        """Return what it records."""
        stream = self._made(seed).events()
        rows, columns = np.divmod(stream.pixel, self.edges.columns)
        t_us = np.rint(1e6 * stream.time)
        return sort_events(make_events(t_us, columns, rows, stream.polarity > 0))

    def told(self) -> list[str]:
        """Return its pixel as ``KEY=VALUE`` of a configuration."""
        made, settings = self._made(0), of_the_tests("camera.settings")
        return [
            f"{key}={json.dumps(value)}"
            for key, value in settings.paths(made.truth)
            if key.startswith("pixel.")
        ]


@dataclass(frozen=True)
class _Scene:
    """The edges as the camera of the tests asks for light."""

    edges: Edges

    def view(self, columns: Values, rows: Values) -> _View:
        """Return the light on a grid, seen from (columns, rows)."""
        return _View(
            self.edges,
            np.repeat(rows.astype(np.int64), len(columns)),
            np.tile(columns, len(rows)),
        )


@dataclass(frozen=True)
class _View:
    edges: Edges
    rows: NDArray[np.int64]
    columns: Values

    def light(self, times: Values) -> Values:
        """Return the light [DN] at times [s], (times, pixels)."""
        return self.edges.light(self.rows, self.columns, times[:, None])
