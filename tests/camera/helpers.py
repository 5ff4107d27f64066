"""What the camera's own tests share: simple courses of light, and events pixel by pixel."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from camera.camera import Camera
from camera.readout import Stream
from camera.scene import AnyScene, Flat
from camera.settings import BENCH, Settings, merged

Array = NDArray[np.float64]

QUIET = merged(
    BENCH,
    {"pixel": {"thresholds": {"mismatch": 0.0}, "refractory": None, "leak": None}},
    {"pixel": {"shot_noise": None}},
)
"""A camera without noise, mismatch, leak and dead time."""

SHARP = merged(QUIET, {"pixel": {"low_pass": None}})
"""As QUIET, and without low-pass: the signal is the logarithm of the light."""


def still(dn: float) -> Flat:
    """Return a scene in which nothing happens."""
    return Flat(lambda t: np.full(t.shape, dn))


def step(low: float, high: float, at: float) -> Flat:
    """Return a scene that changes from `low` to `high` [DN] everywhere at the time `at` [s]."""
    return Flat(lambda t: np.where(t < at, low, high))


def ramp(start: float, per_s: float) -> Flat:
    """Return a scene whose logarithm grows from ln `start` by `per_s` a second."""
    return Flat(lambda t: start * np.exp(per_s * t))


def seen(scene: AnyScene, base: Settings = QUIET, **options: Any) -> Stream:
    """Return the events of a small camera; `options` go to it, ``hidden`` as its first."""
    given = {"size": (1, 1), "duration_s": 0.2, "fps": 100.0, "step_us": 50.0, **options}
    return Camera(scene, base, **given).events()


def of_pixel(stream: Stream, pixel: int = 0) -> tuple[Array, NDArray[np.int64]]:
    """Return times [s] and polarities of one pixel's events."""
    which = stream.pixel == pixel
    return stream.time[which], stream.polarity[which]


def intervals(stream: Stream) -> Array:
    """Return the times between successive events of the same pixel [s]."""
    order = np.lexsort((stream.time, stream.pixel))
    apart = np.diff(stream.time[order])
    return apart[np.diff(stream.pixel[order]) == 0]
