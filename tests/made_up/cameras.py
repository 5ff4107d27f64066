"""One scene as three cameras recorded it, and simulations beside them."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from camera import SCENES, Camera

from adv2e import load_config
from adv2e.diagnosis.data.evidence import read_evidence
from adv2e.diagnosis.data.scene import Scene
from adv2e.diagnosis.statistics.summary import BOTH

CAMERAS = 3


class Recorded:
    """Recordings (32x24 px) that differ by chance: their frames, scene and declared model.

    All but the first are made when they are first measured.
    """

    def __init__(self, folder, seed, *, hidden=None, duration_s, fps):
        self._folder, self._seed = folder, seed
        self._how = {"hidden": hidden or {}, "duration_s": duration_s, "fps": fps}
        self.evidence = self._record(0)
        self.declared = load_config([folder / "0.declared.yaml"])
        light = self.evidence.light(self.declared)
        self.scene = Scene.of(light, self.evidence.times_s, 0.0)

    def _record(self, number):
        path, size = self._folder / f"{number}.zip", (32, 24)
        scene = SCENES["patchwork"](size, seed=self._seed)
        Camera(scene, size=size, seed=number, **self._how).record(path)
        return read_evidence(path)

    @cached_property
    def recordings(self):
        return [self.evidence, *map(self._record, range(1, CAMERAS))]

    def measured(self, statistics):
        """Return the mean statistics of both parts of the data, over the recordings."""
        return np.mean([statistics.measure(one.stream)[BOTH] for one in self.recordings], axis=0)


@dataclass
class Apart:
    """How far recordings are from simulations, in their deviations, (statistics,).

    `plain`, and `corrected` by the bias of an error; `doubt` is what chance and the error leave.
    """

    plain: np.ndarray
    corrected: np.ndarray
    chance: float
    doubt: np.ndarray

    @classmethod
    def of(cls, measured, sample, error, least):
        sd = np.maximum(sample.std(axis=0), least)
        plain = np.clip((measured - sample.mean(axis=0)) / sd, -20.0, 20.0)
        chance = np.sqrt(1.0 / CAMERAS + 1.0 / len(sample))
        doubt = np.hypot(chance, error.sd[BOTH] / sd)
        return cls(plain, plain + error.bias[BOTH] / sd, chance, doubt)

    def squares(self):
        """Return the mean squares of both beyond chance."""
        return [np.mean(one**2) - self.chance**2 for one in (self.plain, self.corrected)]
