"""EventCV, the tool itself (PyPI ``eventcv``), with its defaults or without its noise.

It undoes the coding of sRGB, so it is given light coded so; and it knows a frame rate alone, so it
is given light at even times.
"""

from __future__ import annotations

import importlib.util
from dataclasses import dataclass, field, replace
from importlib import metadata
from typing import Any

import numpy as np
from benchmarks.worker import TOOLS

from adv2e.effects.frames.encoding import encode_light
from adv2e.errors import MissingExtraError
from adv2e.events import Events, make_events, sort_events
from experiments.simulators.clip import Clip

QUIET = {"leak_rate_hz": 0.0, "shot_noise_rate_hz": 0.0}
THRESHOLDS = {"pos_thres": 0.2, "neg_thres": 0.2}
"""Its defaults [ln]."""


@dataclass(frozen=True)
class EventCV:
    """EventCV.

    Attributes
    ----------
    arguments : dict
        Of ``eventcv.simulate``.
    parts : int
        Even steps of an interval.

    Raises
    ------
    MissingExtraError
        It is not installed.
    """

    name: str = "eventcv"
    arguments: dict[str, Any] = field(default_factory=dict)
    parts: int = 10

    def __post_init__(self) -> None:
        if importlib.util.find_spec("eventcv") is None:
            raise MissingExtraError("simulator eventcv", "experiments")

    @property
    def nature(self) -> str:
        """The tool and its version."""
        how = ", without its noise" if QUIET.items() <= self.arguments.items() else ""
        return f"the tool itself, EventCV {metadata.version('eventcv')}{how}"

    def events(self, clip: Clip, seed: int) -> Events:
        """Return the events of a clip."""
        light, rate = clip.even(self.parts)
        coded = encode_light(np.clip(light, 0.0, 255.0), "srgb").astype(np.float32)
        tool = TOOLS["eventcv"]
        run = tool.simulator({"arguments": {**THRESHOLDS, **self.arguments, "seed": seed}}, None)
        t, x, y, p = tool.columns(run(coded, float(rate)))
        return sort_events(make_events(t + int(clip.times_ns[0]) // 1000, x, y, p))

    @property
    def levels(self) -> tuple[float, float]:
        """Its thresholds of ON and OFF [ln]."""
        held = {**THRESHOLDS, **self.arguments}
        return held["pos_thres"], held["neg_thres"]

    def with_levels(self, on: float, off: float) -> EventCV:
        """Return it with other thresholds [ln]."""
        return replace(self, arguments={**self.arguments, "pos_thres": on, "neg_thres": off})
