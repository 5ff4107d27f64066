"""One of the small trainings of networks that make images, with its test."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
from networks.lpips import Lpips

from experiments.images import textures
from experiments.images.scores import made_of, measures_of, parts, picture
from experiments.images.sequences import Batches, Pair
from experiments.images.training import BUILD, LOSS, update_of
from experiments.simulators.clip import Simulator
from experiments.trainings.jobs import identity
from experiments.trainings.training import Training

LENGTH = 11
"""Windows of a run."""
EVERY = 8
"""Frames of a window."""


@dataclass(frozen=True)
class Small:
    """One training on moving textures, and its test on a recording."""

    simulator: Simulator
    seed: int
    recording: Path
    network: str
    steps: int
    rate: float
    clips: int
    side: int
    features: Path | None

    @property
    def settings(self) -> dict[str, Any]:
        """All that decides its numbers."""
        return {
            **self._training, "steps": self.steps, "recording": self.recording.resolve().name,
            "LPIPS": self.features is not None,
        }  # fmt: skip

    @property
    def _training(self) -> dict[str, Any]:
        return {
            **identity(self.simulator), "seed": self.seed, "network": self.network,
            "rate": self.rate, "batch": 2, "length": LENGTH,
            "clips": self.clips, "side": self.side, "loss": LOSS,
        }  # fmt: skip

    def run(self, folder: Path) -> dict[str, Any]:
        """Train in a folder, and test."""
        side = (self.side, self.side)
        first = 1000 * self.seed
        clips = (
            textures.moving(k, EVERY * LENGTH + 1, side) for k in range(first, first + self.clips)
        )
        pairs = [Pair.simulated(clip, self.simulator, self.seed, EVERY) for clip in clips]
        step = update_of(Batches(pairs, 2, LENGTH, side), LENGTH, "cpu")
        training = Training(BUILD[self.network], step, self._training)
        net, curve = training.run(folder, self.steps)
        lpips = None if self.features is None else Lpips(self.features)
        (part,) = parts(self.recording)
        images = made_of(net, part)
        cv2.imwrite(str(folder / "last.png"), picture(part, [images]))
        return {
            "measures": measures_of(images, part.frames, lpips),
            **curve.summary(),
            "events": sum(len(pair.events) for pair in pairs),
        }
