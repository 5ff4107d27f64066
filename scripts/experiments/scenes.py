"""Clips of textures that move by smooth homographies: the light is exact at any frame rate.

Textures are the photographs that scikit-image brings along, in linear light.  Each is taken for the
coefficients of a cubic B-spline, so that the light is twice differentiable in place and time and
never outside the range of the photograph; beyond its edges it is mirrored.  The view shifts, turns,
grows and tilts, each as the sum of two slow waves.
"""

from __future__ import annotations

import importlib
from collections.abc import Iterator
from functools import lru_cache
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from adv2e.effects.frames.encoding import LightDecoder
from adv2e.errors import MissingExtraError
from experiments.clip import Clip

NAMES = (
    "astronaut", "brick", "camera", "chelsea", "coffee", "coins", "grass", "gravel",
    "immunohistochemistry", "moon", "page", "retina", "rocket",
)  # fmt: skip
"""Photographs whose files are inside the package: nothing is downloaded."""
SPEEDS = 15.0, 150.0
"""Largest speed of the shift of a clip [pixels/s], drawn evenly in the logarithm."""
SCALES = 0.7, 1.6
"""Pixels of the photograph to one of the clip, drawn in the same way."""
HZ = 240
View = tuple[NDArray[np.float64], NDArray[np.float64]]
"""Rows and columns of a picture, a pixel each."""


@lru_cache(maxsize=len(NAMES))
def photograph(name: str) -> NDArray[np.float32]:
    """Return the light [DN of 255] of a photograph, (rows, columns)."""
    image = getattr(_late("skimage.data"), name)()
    return LightDecoder("srgb", 255.0, image.dtype, image.ndim == 3).decode(image)


def _late(module: str) -> Any:
    try:
        return importlib.import_module(module)
    except ImportError as error:
        raise MissingExtraError("textures", "experiments") from error


def texture_clip(seed: int, frames: int, size: tuple[int, int], hz: float = HZ) -> Clip:
    """Return the clip of a seed.

    Parameters
    ----------
    seed : int
        Decides photograph, place, and way.
    frames : int
    size : (int, int)
        Columns and rows.
    hz : float
        Frames a second.
    """
    rng = np.random.default_rng([seed, 41])
    light = photograph(NAMES[rng.integers(len(NAMES))])
    made = [seen(light, view) for view in views(rng, light.shape, frames, size, hz)]
    return Clip(np.stack(made), times_ns(frames, hz))


def times_ns(frames: int, hz: float) -> NDArray[np.int64]:
    """Return the times of frames at a rate [ns]."""
    return np.rint(1e9 * np.arange(frames) / hz).astype(np.int64)


def seen(light: NDArray[np.float32], view: View, order: int = 3) -> NDArray[np.float32]:
    """Return what a view shows of a picture, by a spline of an order; mirrored beyond its edges."""
    made = np.empty(view[0].shape, np.float32)
    spline = _late("scipy.ndimage").map_coordinates
    spline(light, view, made, order=order, mode="mirror", prefilter=False)
    return made


def views(
    rng: np.random.Generator, shape: tuple[int, ...], frames: int, size: tuple[int, int], hz: float
) -> Iterator[View]:
    """Yield the rows and columns of a picture of a shape that the pixels see, frame by frame."""
    speed, scale = (np.exp(rng.uniform(*np.log(span))) for span in (SPEEDS, SCALES))
    times = np.arange(frames) / hz
    # waves of 0.4 to 2 s; the amplitude that gives the speed
    waves = rng.uniform(0.4, 2.0, (6, 2)), rng.uniform(0, 2 * np.pi, (6, 2))
    pace = 2 * np.pi / waves[0]
    ways = np.sin(pace * times[:, None, None] + waves[1])
    reach = np.array([speed, speed, 0.5, 0.15, 0.05, 0.05])[:, None] / pace / 2
    centre = rng.uniform(0.25, 0.75, 2) * shape
    columns, rows = size
    x = (np.arange(columns) - (columns - 1) / 2)[None]
    y = (np.arange(rows) - (rows - 1) / 2)[:, None]
    for shift_x, shift_y, turn, grow, tilt_x, tilt_y in (reach * ways).sum(2):
        away = 1 + (tilt_x * x + tilt_y * y) / max(size)
        factor = scale * np.exp(grow) / away
        at_x = centre[1] + factor * (np.cos(turn) * x - np.sin(turn) * y) + scale * shift_x
        at_y = centre[0] + factor * (np.sin(turn) * x + np.cos(turn) * y) + scale * shift_y
        yield at_y, at_x


_WALL_SIDE, _FINE = 384, 4
_SHAPES = 70


def wall(rng: np.random.Generator) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return the light [DN] of a wall with shapes, and how far each pixel is shape (0 to 1)."""
    place = np.linspace(-1, 1, _WALL_SIDE, dtype=np.float32)
    slope = rng.uniform(-15, 15, 2)
    bright = rng.uniform(120, 200) + slope[0] * place[:, None] + slope[1] * place[None]
    light, share = bright.astype(np.float32), np.zeros((_WALL_SIDE, _WALL_SIDE), np.float32)
    for _ in range(_SHAPES):
        centre, radius = rng.uniform(0, _WALL_SIDE, 2), rng.uniform(8, 24)
        first = np.floor(np.maximum(centre - radius, 0)).astype(int)
        last = np.ceil(np.minimum(centre + radius, _WALL_SIDE)).astype(int)
        columns, rows = last - first
        drawn = np.zeros((rows * _FINE, columns * _FINE), np.uint8)
        middle = _FINE * (centre - first)
        corners = int(rng.integers(3, 9))
        if corners == 8:
            axes = np.rint(_FINE * radius * rng.uniform(0.5, 1, 2)).astype(int).tolist()
            at = np.rint(middle).astype(int).tolist()
            cv2.ellipse(drawn, at, axes, rng.uniform(0, 180), 0, 360, 255, cv2.FILLED)
        else:
            angles = rng.uniform(0.6, 1, corners).cumsum()
            angles *= 2 * np.pi / angles[-1]
            angles += rng.uniform(0, 2 * np.pi)
            reach = _FINE * radius * rng.uniform(0.55, 1, corners)
            points = middle + reach[:, None] * np.stack([np.cos(angles), np.sin(angles)], 1)
            cv2.fillPoly(drawn, [np.rint(points).astype(np.int32)], 255)
        part = cv2.resize(drawn, (int(columns), int(rows)), interpolation=cv2.INTER_AREA)
        covered = part / np.float32(255)
        there = slice(first[1], last[1]), slice(first[0], last[0])
        light[there] += covered * (np.float32(rng.uniform(8, 60)) - light[there])
        share[there] = np.maximum(share[there], covered)
    return light, share


def shape_clip(
    seed: int, frames: int, size: tuple[int, int], hz: float = HZ
) -> tuple[Clip, NDArray[np.uint8]]:
    """Return the clip of a seed, and the class of each pixel (frames, rows, columns).

    Parameters
    ----------
    seed : int
        Decides the wall and its way.
    frames : int
    size : (int, int)
        Columns and rows.
    hz : float
        Frames a second.
    """
    rng = np.random.default_rng([seed, 43])
    light, share = wall(rng)
    ways = list(views(rng, light.shape, frames, size, hz))
    labels = [seen(share, view, order=1) > 0.5 for view in ways]
    images = np.stack([seen(light, view) for view in ways])
    return Clip(images, times_ns(frames, hz)), np.array(labels, np.uint8)
