"""One scene as three cameras recorded it, and simulations beside them."""

from dataclasses import dataclass

import numpy as np
from camera import SCENES, Camera

from adv2e import load_config
from adv2e.diagnosis.data.evidence import read_evidence
from adv2e.diagnosis.data.scene import Scene
from adv2e.diagnosis.statistics.summary import BOTH

CAMERAS = 3


class Recorded:
    """Recordings (32x24 px) that differ by chance: their frames, scene and declared model."""

    def __init__(self, folder, seed, *, hidden=None, duration_s, fps):
        paths = [folder / f"{number}.zip" for number in range(CAMERAS)]
        size = (32, 24)
        for number, path in enumerate(paths):
            scene = SCENES["patchwork"](size, seed=seed)
            how = {"hidden": hidden or {}, "duration_s": duration_s, "fps": fps, "seed": number}
            Camera(scene, size=size, **how).record(path)
        self.declared = load_config([folder / "0.declared.yaml"])
        self.recordings = [read_evidence(path) for path in paths]
        self.evidence = self.recordings[0]
        light = self.evidence.light(self.declared)
        self.scene = Scene.of(light, self.evidence.times_s, 0.0)

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
