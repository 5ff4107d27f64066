"""Writers of sample clips: the scene as 8-bit sRGB, as a video file or a folder of images."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
from numpy.typing import NDArray

from adv2e.errors import OutputError
from adv2e.rendering.films import VideoFile
from adv2e.rendering.output import replacing
from adv2e.sinks.staging import Staging

if TYPE_CHECKING:
    from adv2e.synthetic.scene import Scene


def encode_srgb(light: NDArray[Any]) -> NDArray[np.uint8]:
    """Return 8-bit sRGB codes of linear light [DN of 255] (IEC 61966-2-1)."""
    value = np.clip(np.asarray(light) / 255.0, 0.0, 1.0)
    code = np.where(value <= 0.0031308, 12.92 * value, 1.055 * value ** (1 / 2.4) - 0.055)
    return np.rint(255.0 * code).astype(np.uint8)


def frame_times(fps: float, duration_s: float) -> list[float]:
    """Return the times of the frames [s]: 0, 1/fps, ... before `duration_s`, at least two."""
    return [k / fps for k in range(max(2, round(fps * duration_s)))]


def _frames(
    scene: Scene, width: int, height: int, fps: float, duration_s: float
) -> Iterator[tuple[float, NDArray[np.uint8]]]:
    for t_s in frame_times(fps, duration_s):
        yield t_s, encode_srgb(scene.light(t_s, width, height))


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
    with replacing(Path(path), overwrite) as unfinished, VideoFile(unfinished, fps) as film:
        for _, image in _frames(scene, width, height, fps, duration_s):
            film.add(_colour(image))


def write_images(
    scene: Scene,
    folder: str | Path,
    *,
    width: int = 346,
    height: int = 260,
    fps: float = 30.0,
    duration_s: float = 2.0,
) -> None:
    """Write the scene as ``images/frame_%08d.png`` (8-bit sRGB) and ``images.txt`` in `folder`.

    The images are colour images (of equal channels), so that they are read as sRGB.

    Raises
    ------
    OutputError
        `folder` exists or cannot be written.
    """
    staging = Staging(overwrite=False)
    unfinished = staging.folder(Path(folder), lambda old: None)
    try:
        staging.prepare()
        (unfinished / "images").mkdir(parents=True)
        _fill(unfinished, _frames(scene, width, height, fps, duration_s))
        staging.commit()
    except BaseException:
        staging.discard()
        raise


def _fill(folder: Path, frames: Iterator[tuple[float, NDArray[np.uint8]]]) -> None:
    lines = []
    for number, (t_s, image) in enumerate(frames):
        name = f"images/frame_{number:08d}.png"
        if not cv2.imwrite(str(folder / name), _colour(image)):
            raise OutputError(f"{folder.parent}: cannot write pictures there")
        lines.append(f"{t_s:.9f} {name}\n")
    (folder / "images.txt").write_text("".join(lines), encoding="ascii", newline="\n")


def _colour(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    return np.repeat(image[:, :, None], 3, axis=2)
