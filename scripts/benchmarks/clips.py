r"""Synthetic clips for benchmarks: the same frames for the same recipe, on any machine.

A periodic texture with an amplitude spectrum :math:`f^{-1.25}` and log-normal grey values pans and
turns; disks with soft edges cross it.  Frames are 8-bit grey values and stand for video that is
interpolated already, so that no interpolation takes part in a comparison.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from adv2e.synthetic.scene import encode_srgb

Array = NDArray[np.float64]

_PERIOD = 1024  # pixels after which the texture repeats
_SLOPE = 1.25  # of the amplitude spectrum
_DARKEST, _BRIGHTEST = 6.0, 250.0
_SPIN = 0.12  # rad/s
_SPEED = 80.0  # px/s
_CONTRAST = 0.75  # standard deviation of the logarithm of the texture, before clipping


@dataclass(frozen=True, kw_only=True)
class Clip:
    """A recipe, with `fps` frames a second.

    Anything moves only in the share `moving` of the rows, around the middle; the rest keeps its
    first frame.  Grey values are linear light, or of the same frames a code of it (`encoding`:
    linear, srgb); decoded, contrast is twice as high, and about a fifth of the pixels have an event
    from one frame to the next.
    """

    width: int
    height: int
    frames: int
    fps: float = 240.0
    seed: int = 20260
    moving: float = 1.0
    encoding: str = "linear"

    @property
    def times(self) -> Array:
        """Time of each frame [s]."""
        return np.arange(self.frames) / self.fps

    @property
    def name(self) -> str:
        """A file name that tells all frames from all others."""
        parts = [f"{self.width}x{self.height}x{self.frames}", f"{self.fps:g}fps"]
        for name, usual in (("seed", 20260), ("moving", 1.0)):
            if getattr(self, name) != usual:
                parts.append(f"{name}{getattr(self, name):g}")
        return "_".join(parts)

    def render(self) -> Iterator[NDArray[np.uint8]]:
        """Yield the frames, uint8 (rows, columns)."""
        rng = np.random.default_rng(self.seed)
        texture = _texture(rng)
        disks = _Disks.draw(rng, self)
        rows, columns = np.mgrid[: self.height, : self.width].astype(np.float32)
        u, v = columns - self.width / 2, rows - self.height / 2
        still: NDArray[np.uint8] | None = None
        for time in self.times:
            image = _panned(texture, u, v, float(time))
            disks.paint(image, float(time))
            frame = np.clip(np.rint(image), 0, 255).astype(np.uint8)
            if self.moving < 1.0:
                still = frame if still is None else still
                frame = _moving_rows(still, frame, self.moving)
            yield frame


def _texture(rng: np.random.Generator) -> NDArray[np.float32]:
    """Return periodic noise of grey values, (1024, 1024)."""
    across, down = np.fft.rfftfreq(_PERIOD), np.fft.fftfreq(_PERIOD)
    frequency = np.hypot(down[:, None], across[None, :])
    frequency[0, 0] = np.inf
    shape = frequency.shape
    spectrum = (rng.standard_normal(shape) + 1j * rng.standard_normal(shape)) / frequency**_SLOPE
    noise = np.fft.irfft2(spectrum, s=(_PERIOD, _PERIOD))
    noise /= noise.std()
    bright = np.exp(_CONTRAST * noise - 2.2 * _CONTRAST)  # 1 at 2.2 standard deviations
    grey = _DARKEST + (_BRIGHTEST - _DARKEST) * bright
    return np.clip(grey, _DARKEST, _BRIGHTEST).astype(np.float32)


def _panned(texture: NDArray[np.float32], u: Any, v: Any, t: float) -> NDArray[np.float64]:
    """Return the texture as seen at `t`: panned on a winding path, turned about the centre."""
    angle = _SPIN * t
    right = _SPEED * t + 30 * np.sin(2.1 * t)
    down = 0.6 * _SPEED * np.sin(1.3 * t)
    x = (np.cos(angle) * u - np.sin(angle) * v + right).astype(np.float32) % _PERIOD
    y = (np.sin(angle) * u + np.cos(angle) * v + down).astype(np.float32) % _PERIOD
    return cv2.remap(texture, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_WRAP).astype(float)


@dataclass(frozen=True)
class _Disks:
    """Disks that cross the picture, each at its own velocity."""

    centre: Array
    velocity: Array
    radius: Array
    grey: Array

    @classmethod
    def draw(cls, rng: np.random.Generator, clip: Clip) -> _Disks:
        count = max(4, clip.width * clip.height // 60000)
        return cls(
            centre=rng.uniform(0, 1, (count, 2)) * (clip.width, clip.height),
            velocity=rng.normal(0, 1.2 * _SPEED, (count, 2)),
            radius=rng.uniform(0.02, 0.06, count) * min(clip.height, 400),
            grey=rng.choice([12.0, 40.0, 190.0, 240.0], count),
        )

    def paint(self, image: Array, time: float) -> None:
        """Paint the disks, with an edge 1.5 pixels wide, over `image`."""
        height, width = image.shape
        path = self.centre + self.velocity * time
        for (x, y), radius, grey in zip(
            path % (width + 40, height + 40) - 20, self.radius, self.grey, strict=True
        ):
            reach = radius + 1
            left, right = max(0, int(x - reach)), max(0, int(x + reach) + 2)
            top, bottom = max(0, int(y - reach)), max(0, int(y + reach) + 2)
            part = image[top:bottom, left:right]
            below, beside = np.mgrid[top : top + part.shape[0], left : left + part.shape[1]]
            distance = np.hypot(beside - x, below - y) - radius
            cover = np.clip(0.5 - distance / 1.5, 0, 1)
            part *= 1 - cover
            part += grey * cover


def _moving_rows(
    still: NDArray[np.uint8], frame: NDArray[np.uint8], share: float
) -> NDArray[np.uint8]:
    """Return `frame` in a band of that share of the rows around the middle, `still` elsewhere."""
    band = round(share * len(still))
    top = (len(still) - band) // 2
    mixed = still.copy()
    mixed[top : top + band] = frame[top : top + band]
    return mixed


MIDDLE = 60.0
"""Grey value that the flicker swings around."""

FLIPPED = 0.1
"""Share of the pixels that flicker against the rest, drawn anew for each frame."""


@dataclass(frozen=True, kw_only=True)
class Burst:
    """Recipe of a clip in which the whole field flickers, with noise: bright and dark in turn.

    `swing` is between dark and bright [ln units].
    """

    width: int
    height: int
    frames: int
    fps: float
    swing: float
    seed: int = 20260

    @property
    def name(self) -> str:
        """A file name that tells every recipe from every other."""
        size = f"{self.width}x{self.height}x{self.frames}"
        return f"burst_{size}_{self.fps:g}fps_swing{self.swing:g}_seed{self.seed}"

    def render(self) -> Iterator[NDArray[np.uint8]]:
        """Yield the frames, uint8 (rows, columns)."""
        rng = np.random.default_rng(self.seed)
        levels = MIDDLE * np.exp(0.5 * self.swing * np.array([-1.0, 1.0]))
        dark, bright = np.clip(np.rint(levels), 0, 255).astype(np.uint8)
        for k in range(self.frames):
            flipped = rng.random((self.height, self.width), np.float32) < FLIPPED
            yield np.where(flipped ^ (k % 2 == 1), bright, dark)


def default_folder() -> Path:
    """Return the folder for clips: in the user's cache folder."""
    base = os.environ.get("XDG_CACHE_HOME")
    return (Path(base) if base else Path.home() / ".cache") / "adv2e-benchmarks"


def stored(clip: Clip | Burst, folder: Path) -> Path:
    """Return the ``.npy`` file of the clip, (frames, rows, columns); make it if need be."""
    path = folder / f"{clip.name}.npy"
    if not path.exists():
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile(dir=folder, suffix=".part", delete=False) as part:
            np.save(part, np.stack(list(clip.render())))
        Path(part.name).replace(path)  # whole, or not there
    return path


def encoded(source: Path, fps: float) -> Path:
    """Return the clip as MP4 (codec mp4v) beside its ``.npy`` file; make it if need be."""
    path = source.with_suffix(".mp4")
    if not path.exists():
        frames = np.load(source, mmap_mode="r")
        part = path.with_suffix(".part.mp4")
        size = frames.shape[2], frames.shape[1]
        codec = cv2.VideoWriter.fourcc(*"mp4v")
        writer = cv2.VideoWriter(str(part), codec, fps, size, isColor=True)
        if not writer.isOpened():
            raise OSError(f"{part}: OpenCV cannot encode mp4v here")
        for frame in frames:
            writer.write(cv2.cvtColor(np.asarray(frame), cv2.COLOR_GRAY2BGR))
        writer.release()
        part.replace(path)
    return path


def as_srgb(clip: Clip, folder: Path) -> Path:
    """Return the ``.npy`` file of the clip with its light coded as 8-bit sRGB; make it if need be.

    That of a linear clip lies beside it.
    """
    path = stored(clip, folder)
    if clip.encoding == "srgb":
        return path
    target = path.with_name(f"{path.stem}_srgb.npy")
    if not target.exists():
        part = target.with_suffix(".part")
        with part.open("wb") as file:
            np.save(file, encode_srgb(np.arange(256))[np.load(path)])
        part.replace(target)
    return target
