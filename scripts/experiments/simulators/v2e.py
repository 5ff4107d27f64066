"""v2e, the tool itself, from a folder with its sources: the defaults of its command line."""

from __future__ import annotations

import sys
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from adv2e.errors import DataError
from adv2e.events import Events, make_events, sort_events
from experiments.simulators.clip import Clip

DEFAULTS = {
    "pos_thres": 0.2, "neg_thres": 0.2, "sigma_thres": 0.03, "cutoff_hz": 300.0,
    "leak_rate_hz": 0.01, "shot_noise_rate_hz": 0.001, "refractory_period_s": 0.0005,
}  # fmt: skip
"""Of its command line; those of its class differ."""


@dataclass(frozen=True)
class V2e:
    """v2e.

    Attributes
    ----------
    folder : Path
        Holds ``v2ecore/``.
    arguments : dict
        Of its ``EventEmulator``.
    parts : int
        Even steps of an interval.

    Raises
    ------
    DataError
        The folder does not hold its sources.
    """

    folder: Path
    arguments: dict[str, float] = field(default_factory=lambda: dict(DEFAULTS))
    parts: int = 10
    name: str = "v2e"
    nature: str = "the tool itself, from its sources"

    def __post_init__(self) -> None:
        if not (self.folder / "v2ecore" / "emulator.py").is_file():
            raise DataError(
                f"{self.folder}: no v2ecore/emulator.py in it; give a clone of"
                " github.com/SensorsINI/v2e"
            )

    def events(self, clip: Clip, seed: int) -> Events:
        """Return the events of a clip."""
        if (folder := str(self.folder.resolve())) not in sys.path:
            sys.path.insert(0, folder)
        from v2ecore.emulator import EventEmulator  # noqa: PLC0415 - known only now

        light, rate = clip.even(self.parts)
        # seed 0 means no seed there
        emulator = EventEmulator(device="cpu", **{**self.arguments, "seed": seed + 1})
        found = [
            emulator.generate_events(frame.astype(np.float32), k / float(rate))
            for k, frame in enumerate(light)
        ]
        # rows are time [s], column, row, polarity (1 or -1); None where a frame makes none
        rows = [np.asarray(part, np.float64)[:, :4] for part in found if part is not None]
        t, x, y, p = np.concatenate([np.empty((0, 4)), *rows]).T
        first_us = int(clip.times_ns[0]) // 1000
        return sort_events(make_events(np.rint(t * 1e6) + first_us, x, y, p > 0))

    @property
    def levels(self) -> tuple[float, float]:
        """Its thresholds of ON and OFF [ln]."""
        return self.arguments["pos_thres"], self.arguments["neg_thres"]

    def with_levels(self, on: float, off: float) -> V2e:
        """Return it with other thresholds [ln]."""
        return replace(self, arguments={**self.arguments, "pos_thres": on, "neg_thres": off})
