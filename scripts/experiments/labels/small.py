"""One of the small trainings of networks that tell classes of pixels, with its test."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
from networks.unet import unet

from experiments.labels.labelled import Sample, rendered
from experiments.labels.scores import confusion, last_and_best, picture, scores_of
from experiments.labels.training import update_of
from experiments.simulators.clip import Simulator
from experiments.trainings.jobs import identity
from experiments.trainings.training import Training

WINDOWS = 8
"""Pictures of each clip."""
EPOCH = 50
"""Steps between tests."""


@dataclass(frozen=True)
class Small:
    """One training on rendered shapes, and its tests on pictures that are given."""

    simulator: Simulator
    seed: int
    tested: tuple[Sample, ...]
    tested_on: str
    steps: int
    rate: float
    clips: int
    side: int

    @property
    def settings(self) -> dict[str, Any]:
        """All that decides its numbers."""
        return {**self._training, "steps": self.steps}

    @property
    def _training(self) -> dict[str, Any]:
        return {
            **identity(self.simulator), "seed": self.seed,
            "network": "unet", "rate": self.rate, "batch": 4, "clips": self.clips,
            "side": self.side, "tested on": self.tested_on, "pictures tested": len(self.tested),
        }  # fmt: skip

    def run(self, folder: Path) -> dict[str, Any]:
        """Train in a folder, and test."""
        first = 1000 * self.seed
        samples = rendered(
            range(first, first + self.clips), self.simulator, (self.side, self.side), WINDOWS
        )

        def check(net: Any) -> dict[str, float]:
            return scores_of(confusion(net, self.tested, 2, "cpu"))

        made = Training(
            lambda: unet(2), update_of(samples, 4, "cpu", False), self._training, EPOCH, check,
            "mIoU",
        )  # fmt: skip
        net, curve = made.run(folder, self.steps)
        cv2.imwrite(str(folder / "last.png"), picture(net, self.tested[-1]))
        return {
            "measures": last_and_best(curve.checks),
            **curve.summary(),
        }
