"""Clips of dark shapes on a bright wall that moves, with the class of every pixel.

Like ``shapes_6dof`` of DAVIS240C: polygons and ellipses, nothing else.  They are drawn once, four
times as fine, and moved as :mod:`experiments.images.textures` moves photographs, so that the light
is exact at any rate.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from experiments.images.textures import HZ, seen, times_ns, views
from experiments.simulators.clip import Clip

CLASSES = "wall", "shape"
_SIDE, _FINE = 384, 4
_SHAPES = 70


def wall(rng: np.random.Generator) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return the light [DN] of a wall with shapes, and how far each pixel is shape (0 to 1)."""
    place = np.linspace(-1, 1, _SIDE, dtype=np.float32)
    slope = rng.uniform(-15, 15, 2)
    bright = rng.uniform(120, 200) + slope[0] * place[:, None] + slope[1] * place[None]
    light, share = bright.astype(np.float32), np.zeros((_SIDE, _SIDE), np.float32)
    for _ in range(_SHAPES):
        centre, radius = rng.uniform(0, _SIDE, 2), rng.uniform(8, 24)
        first = np.floor(np.maximum(centre - radius, 0)).astype(int)
        last = np.ceil(np.minimum(centre + radius, _SIDE)).astype(int)
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


def moving(
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
