"""Clips of the made scene: 8-bit sRGB, as a video file."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from adv2e.effects.frames.encoding import encode_light
from adv2e.rendering.films import VideoFile, replacing

if TYPE_CHECKING:
    from adv2e.synthetic.scene import Scene


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
