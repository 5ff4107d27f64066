"""Frames: what a shutter of its own sees of the scene.

Sources: Brandli et al. 2014 (frames and events of one sensor); El Gamal, Eltoukhy, "CMOS image
sensors", 2005 (integration over the exposure, pedestal); IEC 61966-2-1 (sRGB).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from camera.scene import AnyScene, View
from camera.settings import Settings, find, section

Array = NDArray[np.float64]

LONGEST_S = 125e-6
"""Longest time between two instants of an exposure that are added up [s]."""


class Frame(NamedTuple):
    """One frame: time on the camera's clock, stamp on the frames' clock [s], and numbers."""

    time: float
    stamp: float
    image: NDArray[Any]


def exposed(view: View, middle: float, exposure_s: float, lamp: Callable[[Array], Array]) -> Array:
    r"""Return the mean light over an exposure, (pixels,); an instant if `exposure_s` is 0.

    .. math:: \frac{1}{T} \int_{t - T/2}^{t + T/2} I(\tau)\, d\tau

    by the midpoint rule; `lamp` is a factor on all light at times [s].
    """
    parts = max(1, int(np.ceil(exposure_s / LONGEST_S)))
    times = middle + exposure_s * ((np.arange(parts) + 0.5) / parts - 0.5)
    light = view.light(times) * lamp(times)[:, None]
    return np.asarray(light.mean(axis=0))


def encoded(light: Array, encoding: str) -> Array:
    """Return the value, 0 to 1, that stands for `light`, 0 to 1: the inverse of the encoding."""
    if encoding == "linear":
        return light
    if encoding == "srgb":
        return np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)
    name, _, exponent = encoding.partition(":")
    assert name == "gamma", f"frames.encoding: must be linear, srgb or gamma:<g>, got {encoding!r}"
    return np.asarray(light ** (1.0 / float(exponent)))


def frames_of(
    scene: AnyScene,
    settings: Settings,
    size: tuple[int, int],
    times: Array,
    lamp: Callable[[Array], Array],
) -> Iterator[Frame]:
    r"""Yield the frames taken at `times` [s] (the middle of each exposure).

    ``frames.shift_px``: the picture in the frames lies that far to the right of, and below, where
    the event pixels see it.  ``frames.black_level_dn``: b is missing in the frames, which show
    max(DN - b, 0), so that it has to be added to have the light.  ``frames.flicker.in_frames``:
    ``averaged`` frames know nothing of the lamp's flicker, as with exposures of whole periods;
    with ``shutter`` they see what the exposure leaves of it.  Clock: the stamps s of the frames
    follow from the camera's time t by t = s (1 + rho) + d, rho = ``clock_drift_ppm``,
    d = ``clock_offset_us``; frames with stamps below zero are not kept.
    """
    width, height = size
    dx, dy = find(settings, "frames.shift_px", (0.0, 0.0))
    view = scene.view(np.arange(width) - dx, np.arange(height) - dy)
    exposure = find(settings, "frames.exposure_us", 0.0) * 1e-6
    black = find(settings, "frames.black_level_dn", 0.0)
    white = find(settings, "frames.full_scale", 65535)
    encoding = find(settings, "frames.encoding", "linear")
    offset = find(settings, "frames.clock_offset_us", 0.0) * 1e-6
    drift = find(settings, "frames.clock_drift_ppm", 0.0) * 1e-6
    blinking = find(settings, "frames.flicker.in_frames", "averaged") == "shutter"
    if section(settings, "frames.flicker") is None or not blinking:
        lamp = np.ones_like
    kind = np.uint8 if white <= 255 else np.uint16
    for time in times:
        stamp = (float(time) - offset) / (1.0 + drift)
        if stamp < 0:
            continue
        light = exposed(view, float(time), exposure, lamp) - black
        value = encoded(np.clip(light / 255.0, 0.0, 1.0), encoding)
        image = np.rint(white * value).astype(kind).reshape(height, width)
        yield Frame(float(time), stamp, image)
