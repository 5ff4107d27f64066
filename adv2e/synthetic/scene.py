r"""A textured scene with high contrast that stops and goes, as a function of time.

A texture like clouds, with a power-law spectrum, pans and slowly turns; bright and dark disks with
soft edges move over it and hide it and each other.  Everything moves along one path length

.. math:: s(t) = \int_0^t v(\tau)\, d\tau, \qquad 0 \le v \le 1,

where v starts at 0, rises, stays at 1, falls and rests at 0, period after period, so that in each
rest nothing at all changes.  The light is a smooth function of position and time: the texture is a
cubic B-spline (twice differentiable, and never outside the range of its coefficients), filtered to
what the pixels of the picture asked for can show, and every edge is at least 1.5 pixels wide.
"""

from __future__ import annotations

from contextlib import closing
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.effects.frames.encoding import encode_light
from adv2e.rendering.films import VideoFile, replacing

DARKEST, BRIGHTEST = 4.5, 230.0
"""Range of the light [DN of 255, linear light]: a contrast of 51 to 1."""

_TEXELS = 1024  # size of the periodic texture
_PERIOD = 2.0  # its size in the scene [picture heights]
_SLOPE = 1.6  # fall of the amplitude with frequency: steeper than 1/f, so that shapes show
_EDGE = 1.5  # width of the edge of a disk [pixels], and at least _SOFT heights
_SOFT = 0.008

RAMP_S, GO_S, REST_S = 0.12, 0.40, 0.36
"""Times of starting (and of stopping), going at full speed and resting in a period [s]."""

PERIOD_S = 2 * RAMP_S + GO_S + REST_S


@dataclass(frozen=True, kw_only=True)
class _Disk:
    """A disk on a closed path about `centre`; lengths in picture heights."""

    centre: tuple[float, float]
    swing: tuple[float, float]
    turns: tuple[float, float]
    phase: tuple[float, float]
    radius: float
    light: float

    def place(self, s: float) -> tuple[float, float]:
        """Return column and row of the middle at path length `s`, from the picture's middle."""
        return (
            self.centre[0] + self.swing[0] * float(np.sin(self.turns[0] * s + self.phase[0])),
            self.centre[1] + self.swing[1] * float(np.sin(self.turns[1] * s + self.phase[1])),
        )


class Scene:
    """The scene of one `seed`.

    Its size is counted in picture heights, so that a larger picture shows the same thing finer.

    Parameters
    ----------
    seed : int
        Decides texture, disks and paths.
    speed : float
        Speed of the panning at v = 1 [picture heights/s].
    spin : float
        Speed of the turning at v = 1 [rad/s].
    """

    def __init__(self, seed: int = 0, *, speed: float = 0.25, spin: float = 0.15) -> None:
        self.seed = seed
        self.spin = spin
        self.pan = speed
        self._disks = _make_disks(np.random.default_rng([seed, 1]), speed)

    def speed(self, t_s: float) -> float:
        """Return v at `t_s` [s], in 0..1; 0 means that nothing moves."""
        phase = t_s % PERIOD_S
        if phase < RAMP_S:
            return 0.5 - 0.5 * float(np.cos(np.pi * phase / RAMP_S))
        if phase < RAMP_S + GO_S:
            return 1.0
        if phase < 2 * RAMP_S + GO_S:
            return 0.5 + 0.5 * float(np.cos(np.pi * (phase - RAMP_S - GO_S) / RAMP_S))
        return 0.0

    def path_s(self, t_s: float) -> float:
        """Return s(t), the time spent moving, counted at full speed [s]."""
        periods, phase = divmod(t_s, PERIOD_S)
        whole = GO_S + RAMP_S
        up = min(phase, RAMP_S)
        done = up / 2 - RAMP_S / (2 * np.pi) * float(np.sin(np.pi * up / RAMP_S))
        done += min(max(phase - RAMP_S, 0.0), GO_S)
        down = min(max(phase - RAMP_S - GO_S, 0.0), RAMP_S)
        done += down / 2 + RAMP_S / (2 * np.pi) * float(np.sin(np.pi * down / RAMP_S))
        return float(periods * whole + done)

    def light(self, t_s: float, width: int, height: int) -> NDArray[np.float32]:
        """Return the light at the instant `t_s` [s].

        Returns
        -------
        ndarray of float32, (height, width)
            Linear light [DN of 255], between ``DARKEST`` and ``BRIGHTEST``.
        """
        s = self.path_s(t_s)
        column = (np.arange(width) + 0.5 - width / 2) / height
        row = (np.arange(height) + 0.5 - height / 2)[:, None] / height
        picture = self._texture(s, column, row, height)
        edge = max(_EDGE / height, _SOFT)
        for disk in self._disks:
            x, y = disk.place(s)
            away = np.hypot(column - x, row - y) - disk.radius
            inside = np.clip(0.5 - away / edge, 0.0, 1.0)
            inside = inside * inside * (3.0 - 2.0 * inside)
            picture += inside * (disk.light - picture)
        return np.clip(picture, DARKEST, BRIGHTEST).astype(np.float32)

    def _texture(
        self, s: float, column: NDArray[np.float64], row: NDArray[np.float64], height: int
    ) -> NDArray[np.float64]:
        """Return the texture as seen at path length `s`."""
        cos, sin = np.cos(self.spin * s), np.sin(self.spin * s)
        x = cos * column - sin * row + self.pan * s
        y = sin * column + cos * row + 0.35 * self.pan * np.sin(1.7 * s)
        texels = _TEXELS / _PERIOD
        return _spline(_coefficients(self.seed, texels / height), x * texels, y * texels)


def _make_disks(rng: np.random.Generator, speed: float) -> list[_Disk]:
    """Return eight disks, dark and bright in turn, spread over a 4:3 picture."""
    disks = []
    for k in range(8):
        swing = rng.uniform(0.12, 0.30, 2)
        fast = rng.uniform(0.7, 1.6, 2) * speed  # [heights/s] where the path is fastest
        middle = ((k % 4 - 1.5) * 0.33, (k // 4 - 0.5) * 0.45)
        disks.append(
            _Disk(
                centre=(
                    middle[0] + float(rng.uniform(-0.08, 0.08)),
                    middle[1] + float(rng.uniform(-0.08, 0.08)),
                ),
                swing=(float(swing[0]), float(swing[1])),
                turns=(float(fast[0] / swing[0]), float(fast[1] / swing[1])),
                phase=(float(rng.uniform(0, 2 * np.pi)), float(rng.uniform(0, 2 * np.pi))),
                radius=float(rng.uniform(0.05, 0.12)),
                light=float(rng.uniform(150.0, BRIGHTEST) if k % 2 else rng.uniform(DARKEST, 14.0)),
            )
        )
    return disks


@lru_cache(maxsize=4)
def _coefficients(seed: int, pitch: float) -> NDArray[np.float64]:
    """Return the spline coefficients of the texture for pixels `pitch` texels apart.

    A logarithm with a power-law spectrum is pressed smoothly into the range of the light; light is
    then averaged over the pixel, as a photodiode does, so that no frequency is left to alias.
    """
    rng = np.random.default_rng([seed, 0])
    frequency = np.hypot(np.fft.fftfreq(_TEXELS)[:, None], np.fft.rfftfreq(_TEXELS)[None, :])
    frequency[0, 0] = np.inf
    draws = rng.standard_normal((2, *frequency.shape))
    noise = np.fft.irfft2((draws[0] + 1j * draws[1]) / frequency**_SLOPE, s=(_TEXELS, _TEXELS))
    low, high = np.log(DARKEST), np.log(BRIGHTEST)
    light = np.exp((low + high) / 2 + (high - low) / 2 * np.tanh(0.8 * noise / noise.std()))
    frequency[0, 0] = 0.0
    average = np.exp(-0.5 * (2 * np.pi * frequency * 0.5 * pitch) ** 2)
    light = np.fft.irfft2(np.fft.rfft2(light) * average, s=light.shape)
    return np.clip(light, DARKEST, BRIGHTEST)


def _spline(
    coefficients: NDArray[np.float64], x: NDArray[np.float64], y: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the periodic uniform cubic B-spline of `coefficients` at columns `x`, rows `y`."""
    size = coefficients.shape[0]
    left, top = np.floor(x), np.floor(y)
    wx, wy = _weights(x - left), _weights(y - top)
    column, row = left.astype(np.int64), top.astype(np.int64)
    flat = coefficients.ravel()
    total = np.zeros(np.broadcast_shapes(x.shape, y.shape))
    for j in range(4):
        start = ((row + (j - 1)) % size) * size
        line = np.zeros_like(total)
        for i in range(4):
            line += wx[i] * flat[start + (column + (i - 1)) % size]
        total += wy[j] * line
    return total


def _weights(u: NDArray[np.float64]) -> tuple[NDArray[np.float64], ...]:
    """Return the four weights of the cubic B-spline at fraction `u`; they add up to 1."""
    v = 1.0 - u
    first, last = v * v * v / 6.0, u * u * u / 6.0
    second = (4.0 - 6.0 * u * u + 3.0 * u * u * u) / 6.0
    return first, second, 1.0 - first - second - last, last


# ---- Clips of the made scene: 8-bit sRGB, as a video file.


def encode_srgb(light: NDArray[Any]) -> NDArray[np.uint8]:
    """Return 8-bit sRGB codes of linear light [DN of 255] (IEC 61966-2-1)."""
    value = encode_light(np.clip(light, 0.0, 255.0), "srgb")
    return np.rint(255.0 * value).astype(np.uint8)


def frame_times(fps: float, duration_s: float) -> list[float]:
    """Return the times of the frames [s]: 0, 1/fps, ... before `duration_s`, at least two."""
    return [k / fps for k in range(max(2, round(fps * duration_s)))]


def write_video(
    scene: Scene,
    path: str | Path,
    *,
    width: int = 346,
    height: int = 260,
    fps: float = 30.0,
    duration_s: float = 2.0,
    overwrite: bool = False,
) -> None:
    """Write the scene as a video file, 8-bit sRGB: .avi (lossless) or .mp4 (not).

    Raises
    ------
    OutputError
        `path` exists and may not be overwritten, or cannot be written.
    """
    with (
        replacing(Path(path), overwrite) as unfinished,
        closing(VideoFile(unfinished, fps)) as film,
    ):
        for t_s in frame_times(fps, duration_s):
            grey = encode_srgb(scene.light(t_s, width, height))
            film.add(np.repeat(grey[:, :, None], 3, axis=2))
        film.finish()
