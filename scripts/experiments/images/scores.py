"""Recordings on which networks that reconstruct images are tested, and the measures."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from networks import torch_module
from networks.firenet import NETWORKS, Images, Network, grid_of, reconstructed
from networks.lpips import Lpips
from numpy.typing import NDArray

from adv2e.errors import DataError
from adv2e.events import Events, cut
from experiments.judge import similarity
from experiments.recordings import Recording, read

CUTS = {
    "boxes_6dof": (5.0, 20.0), "calibration": (5.0, 20.0), "dynamic_6dof": (5.0, 20.0),
    "office_zigzag": (5.0, 12.0), "poster_6dof": (5.0, 20.0), "shapes_6dof": (5.0, 20.0),
    "slider_depth": (1.0, 2.5),
}  # fmt: skip
"""Sequences of DAVIS240C and the part that is used [s], as EVREAL has it (config/dataset/ECD.json,
github.com/ercanburak/EVREAL)."""
MEASURES = {"MSE": False, "SSIM": True, "equalised MSE": False, "equalised SSIM": True,
            "LPIPS": False}  # fmt: skip
"""And whether larger is better."""
GREY = "one grey"


@dataclass(frozen=True)
class Part:
    """The part of a recording that is used.

    Attributes
    ----------
    name : str
    real : Recording
    spans : sequence of (int, int)
        Frame intervals [us].
    """

    name: str
    real: Recording
    spans: Sequence[tuple[int, int]]

    @cached_property
    def frames(self) -> Images:
        """The frames at the ends of the intervals, 0 black and 1 white."""
        ends = {stop for _, stop in self.spans}
        source = self.real.source
        scale = np.float32(1 / source.full_scale)
        return np.array(
            [
                scale * np.asarray(frame.image, np.float32)
                for frame, t_us in zip(source.frames(), self.real.times_us, strict=True)
                if int(t_us) in ends
            ]
        )

    def windows(self) -> Iterator[Events]:
        """Yield the events of each interval."""
        return (cut(self.real.events, *span) for span in self.spans)


def parts(data: Path) -> Iterator[Part]:
    """Yield the sequences of DAVIS240C in a folder with their cuts, or the recording that it is.

    Raises
    ------
    DataError
        It is neither, or a sequence has nothing in its cut.
    """
    there = {
        name: path for name in CUTS for path in (data / f"{name}.zip", data / name) if path.exists()
    }
    if not there:
        real = read(str(data))
        yield Part(real.name, real, real.windows.used)
    for name, path in there.items():
        real = read(str(path))
        begin, end = (round(1e6 * one) for one in CUTS[name])
        spans = [one for one in real.windows.used if begin <= one[0] and one[1] <= end]
        if not spans:
            raise DataError(f"{path}: no frame interval with events within {CUTS[name]} s")
        yield Part(name, real, spans)


def equalised(image: NDArray[Any]) -> NDArray[np.float64]:
    """Return an image whose histogram, of 256 values, is even."""
    return cv2.equalizeHist(np.rint(255 * image).astype(np.uint8)) / 255.0


def measures_of(images: Images, frames: Images, lpips: Lpips | None) -> dict[str, float]:
    """Return the means of all measures over images and frames between 0 and 1."""
    found: dict[str, list[float]] = {}
    for image, frame in zip(images, frames, strict=True):
        for kind, a, b in (("", image, frame), ("equalised ", equalised(image), equalised(frame))):
            found.setdefault(f"{kind}MSE", []).append(float(np.mean((a - b) ** 2)))
            found.setdefault(f"{kind}SSIM", []).append(similarity(a, b))
        if lpips is not None:
            torch = torch_module()
            pair = (
                torch.from_numpy(np.ascontiguousarray(one))[None, None] for one in (image, frame)
            )
            with torch.inference_mode():
                found.setdefault("LPIPS", []).append(float(lpips(*pair)))
    return {name: float(np.mean(each)) for name, each in found.items()}


def made_of(net: Any, part: Part) -> Images:
    """Return the images that a network makes."""
    return reconstructed(net, (grid_of(events, part.real.size) for events in part.windows()))


def references(
    part: Part, weights: Path | None, lpips: Lpips | None
) -> dict[str, dict[str, float]]:
    """Return the measures of one grey, the mean of each frame, and of published networks."""
    grey = np.broadcast_to(part.frames.mean((1, 2), keepdims=True), part.frames.shape)
    found = {GREY: measures_of(grey, part.frames, lpips)}
    if weights is not None:
        for name in NETWORKS:
            images = Network(name, weights).images(part.windows(), part.real.size)
            found[f"{name}, published"] = measures_of(images, part.frames, lpips)
    return found


def picture(part: Part, rows: Sequence[Images]) -> NDArray[np.uint8]:
    """Return the last frame, and beside it the last of each of several images."""
    line = np.hstack([part.frames[-1], *(one[-1] for one in rows)])
    return np.rint(255 * np.clip(line, 0, 1)).astype(np.uint8)
