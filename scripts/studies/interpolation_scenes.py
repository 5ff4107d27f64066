"""Scenes of the study of interpolation: what moves, and how interpolation may go wrong on it."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from adv2e.synthetic import Scene
from adv2e.synthetic.scene import RAMP_S

Image = NDArray[np.float32]

Light = Callable[[float, int, int], Image]
"""Light (rows, columns) [DN] at a time [s], for a width and a height [pixels]."""

TRUE_HZ = 2000.0
"""Least rate at which the true light is rendered."""

TRUE_STEP_PX = 0.25
"""Most that anything may move from one true picture to the next."""

_TEXELS = 4  # texels a pixel: cubic look-ups between them are smooth far below a pixel
_SIZE_PX = 512


@dataclass(frozen=True)
class Case:
    """One scene, and the frames that a camera takes of it."""

    name: str
    light: Light
    speed: Callable[[int], float]
    """Fastest motion in a picture of a given height [pixels/s]."""
    duration_s: float = 0.5
    read_noise: float = 0.0
    """Noise of the frames [DN, rms]; with it they are rounded to whole DN."""
    exposure_s: float = 0.0
    """Time over which a frame averages the light, about its own."""
    declared: bool = True
    """Whether the simulator is told of the exposure."""

    def true_hz(self, height: int) -> float:
        """Return the rate at which the true light is rendered, a multiple of TRUE_HZ."""
        return TRUE_HZ * max(1, math.ceil(self.speed(height) / (TRUE_STEP_PX * TRUE_HZ)))


@lru_cache(maxsize=8)
def _texels(seed: int, mean: float, contrast: float) -> Image:
    """Return a periodic texture like clouds, nothing in it finer than about 4 pixels."""
    size = _SIZE_PX
    rng = np.random.default_rng([seed, 3])
    frequency = np.hypot(np.fft.fftfreq(size)[:, None], np.fft.rfftfreq(size))
    frequency[0, 0] = np.inf
    spectrum = np.fft.rfft2(rng.standard_normal((size, size)))
    spectrum *= frequency**-1.2 * np.exp(-((frequency / 0.2) ** 4))
    fine = np.zeros((_TEXELS * size, _TEXELS * size // 2 + 1), complex)
    half = size // 2
    fine[:half, : half + 1] = spectrum[:half]
    fine[-half:, : half + 1] = spectrum[half:]
    clouds = np.fft.irfft2(fine)
    light: Image = np.clip(mean * np.exp(contrast * clouds / clouds.std()), 2, 250)
    return light.astype(np.float32)


class Texture:
    """Light of a texture at any place."""

    def __init__(self, seed: int, mean: float = 80.0, contrast: float = 0.5) -> None:
        self._of = (seed, mean, contrast)

    def at(self, x: NDArray[np.float64], y: NDArray[np.float64]) -> Image:
        """Return the light at columns `x` and rows `y` [pixels]."""
        texels = _texels(*self._of)
        fine = [(_TEXELS * place % len(texels)).astype(np.float32) for place in (x, y)]
        light: Image = cv2.remap(texels, *fine, cv2.INTER_CUBIC, borderMode=cv2.BORDER_WRAP)
        return light


def _pixels(width: int, height: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    x, y = np.meshgrid(np.arange(width, dtype=float), np.arange(height, dtype=float))
    return x, y


def _over(ground: Image, figure: Image | float, away: NDArray[np.float64]) -> Image:
    """Return `figure` over `ground` where `away`, the distance from its edge [px], is negative."""
    inside = np.clip(0.5 - away, 0.0, 1.0)
    light: Image = (ground + inside * (figure - ground)).astype(np.float32)
    return light


def _pan(texture: Texture, speed: float, gain: float = 1.0) -> Light:
    def light(t_s: float, width: int, height: int) -> Image:
        x, y = _pixels(width, height)
        return np.float32(gain) * texture.at(x - speed * t_s, y - 0.2 * speed * t_s)

    return light


def _ball(seed: int, path: Callable[[float, int, int], tuple[float, float]]) -> Light:
    """Return a disk whose centre `path` gives, over a ground at rest."""
    ground, disk = Texture(seed), Texture(seed + 1, 30.0)

    def light(t_s: float, width: int, height: int) -> Image:
        x, y = _pixels(width, height)
        column, row = path(t_s, width, height)
        dx, dy = x - column, y - row
        return _over(ground.at(x, y), disk.at(dx + 64, dy + 64), np.hypot(dx, dy) - 0.2 * height)

    return light


def _swing(seed: int, reach: float, hz: float) -> Light:
    """Return a disk that swings as a pendulum does."""

    def path(t_s: float, width: int, height: int) -> tuple[float, float]:
        angle = math.sin(2.0 * math.pi * hz * t_s)
        return 0.5 * width + reach * angle, 0.5 * height - 0.2 * reach * angle * angle

    return _ball(seed, path)


def _bounce(seed: int, speed: float, every_s: float) -> Light:
    """Return a disk that turns back at once, every `every_s`."""

    def path(t_s: float, width: int, height: int) -> tuple[float, float]:
        return 0.4 * width + speed * abs(t_s % (2.0 * every_s) - every_s), 0.5 * height

    return _ball(seed, path)


def _disks(seed: int, speed: float, radius: float) -> Light:
    """Two disks that cross over a ground at rest, the second in front."""
    ground, first, second = Texture(seed), Texture(seed + 1, 140.0), Texture(seed + 2, 40.0)

    def light(t_s: float, width: int, height: int) -> Image:
        x, y = _pixels(width, height)
        picture = ground.at(x, y)
        for texture, start, way, row in (
            (first, 0.15 * width, speed * t_s, 0.45 * height),
            (second, 0.85 * width, -speed * t_s, 0.55 * height),
        ):
            # back at the start after as long as the picture is wide
            dx, dy = x - start - way, y - row
            dx = (dx + 0.5 * width) % width - 0.5 * width
            picture = _over(picture, texture.at(dx + 64, dy + 64), np.hypot(dx, dy) - radius)
        return picture

    return light


def _flicker(seed: int) -> Light:
    disks = _disks(seed, 100.0, 18.0)

    def light(t_s: float, width: int, height: int) -> Image:
        gain = 1.0 + 0.3 * math.sin(2.0 * math.pi * 5.0 * t_s)
        return np.float32(gain) * disks(t_s, width, height)

    return light


def _grating(speed: float, period: float) -> Light:
    def light(t_s: float, width: int, height: int) -> Image:
        x, _ = _pixels(width, height)
        wave = np.sin(2.0 * np.pi * (x - speed * t_s) / period)
        return (80.0 * (1.0 + 0.6 * wave)).astype(np.float32)

    return light


def _lines(seed: int, speed: float) -> Light:
    """Slanting lines, two pixels wide, one dark and one bright, against each other."""
    ground = Texture(seed)

    def light(t_s: float, width: int, height: int) -> Image:
        x, y = _pixels(width, height)
        picture = ground.at(x, y)
        for shade, start, way in ((230.0, 0.1, speed), (5.0, 0.9, -0.7 * speed)):
            across = 0.94 * (x - start * width - way * t_s) + 0.34 * (y - 0.5 * height)
            picture = _over(picture, shade, np.abs(across) - 1.0)
        return picture

    return light


def _scene(seed: int) -> Light:
    scene = Scene(seed, speed=0.6, spin=0.5)
    return lambda t_s, width, height: scene.light(RAMP_S / 2 + t_s, width, height)


def cases(seed: int) -> list[Case]:
    """Return all cases; the first is what flow is made for, the others are hard for it."""

    def constant(speed: float) -> Callable[[int], float]:
        return lambda height: speed

    short = 1.0 / 6.0
    return [
        Case("pan, turn, disks", _scene(seed), lambda height: 0.6 * height),
        Case("pan", _pan(Texture(seed), 150.0), constant(150.0)),
        Case("swing", _swing(seed, 15.0, 2.2), constant(2.0 * math.pi * 2.2 * 15.0)),
        Case("bounce", _bounce(seed, 150.0, 0.21), constant(150.0)),
        Case("exposed", _pan(Texture(seed), 150.0), constant(150.0), exposure_s=0.012),
        Case(
            "exposed, not told",
            _pan(Texture(seed), 150.0),
            constant(150.0),
            exposure_s=0.012,
            declared=False,
        ),
        Case("covering", _disks(seed, 240.0, 20.0), constant(240.0)),
        Case("thin lines", _lines(seed, 150.0), constant(150.0)),
        Case("brightness changes", _flicker(seed), constant(100.0)),
        Case("repeats every 12 px", _grating(240.0, 12.0), constant(240.0)),
        Case("fast pan", _pan(Texture(seed), 2000.0), constant(2000.0), short),
        Case("small and fast", _disks(seed, 800.0, 8.0), constant(800.0), short),
        Case("dim, noisy", _pan(Texture(seed), 60.0, 1 / 8), constant(60.0), read_noise=1.0),
    ]
