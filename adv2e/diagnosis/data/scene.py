"""Brightness and speed classes of each pixel in each frame interval, from the frames."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.config import Config
from adv2e.diagnosis.data.evidence import Evidence
from adv2e.diagnosis.data.splits import Split, Stream
from adv2e.diagnosis.data.stimulus import Leaps
from adv2e.reports.quantities import short_text

STILL = 0
SPEEDS = 4
BRIGHTNESSES = 3
SPEED_NAMES = ("still", "slow", "moving", "fast")
LIGHT_NAMES = ("dark", "medium", "bright")
STILL_PER_S = 0.3
"""Change of log light below which a pixel counts as still [1/s]."""
_MEMORY_S = 0.05


@dataclass(frozen=True)
class Scene:
    """Log light of the frames, and classes made of it; the same for every stream.

    Attributes
    ----------
    times_us : (frames,)
        Stamps of the frames.
    slope : (frames - 1, pixels) float32
        Change of log light [1/s] in each frame interval.
    speed : (frames - 1, pixels) uint8
        0: still for a while; 1 to 3: thirds of what moves.
    brightness : (frames - 1, pixels) uint8
        Thirds of what moves.
    speed_borders, brightness_borders : (2,)
        Between the thirds, [ln/s] and [DN].
    leaps : Leaps, optional
        Of known light; None: what there is are frames.
    """

    times_us: NDArray[np.float64]
    slope: NDArray[np.float32]
    speed: NDArray[np.uint8]
    brightness: NDArray[np.uint8]
    speed_borders: NDArray[np.float64]
    brightness_borders: NDArray[np.float64]
    split: Split
    width: int
    height: int
    leaps: Leaps | None = None

    @classmethod
    def of(
        cls, light: NDArray[np.float32], times_s: NDArray[np.float64], quantum_dn: float
    ) -> Scene:
        """Return the scene of frames: their light [DN], (frames, rows, columns), and times.

        `quantum_dn`: step of the frames' numbers [DN], below which a change means nothing.
        """
        frames, height, width = light.shape
        floor = max(quantum_dn, 0.1)
        x = np.log(np.maximum(light, floor)).reshape(frames, -1).astype(np.float32)
        seconds = np.diff(times_s).astype(np.float32)
        slope = np.diff(x, axis=0) / seconds[:, None]
        uncertain = 1.5 * quantum_dn * np.exp(-np.minimum(x[1:], x[:-1])) / seconds[:, None]
        speed, weight, per_s = _speeds(slope, seconds, np.maximum(STILL_PER_S, uncertain))
        edges = _weighted_quantiles(x[1:], weight, BRIGHTNESSES)
        brightness = np.digitize(x[1:], edges).astype(np.uint8)
        split = Split.of(width, height, times_s[0] * 1e6, times_s[-1] * 1e6)
        borders = per_s, np.exp(edges)
        return cls(times_s * 1e6, slope, speed, brightness, *borders, split, width, height)

    @classmethod
    def of_evidence(cls, evidence: Evidence, declared: Config) -> Scene:
        """Return the scene of a recording's frames, as the declared model reads them."""
        light, quantum_dn = evidence.light(declared), evidence.quantum_dn(declared)
        scene, known = cls.of(light, evidence.times_s, quantum_dn), evidence.stimulus
        return scene if known is None else replace(scene, leaps=known.leaps)

    @property
    def bounds_of_speed(self) -> tuple[str, ...]:
        """Name of each class of speed, with its bounds: of the change of log light."""
        low, high = (short_text(border, 2) for border in self.speed_borders.tolist())
        bounds = f"below {low} ln/s", f"{low} to {high} ln/s", f"from {high} ln/s"
        still, *others = SPEED_NAMES
        return still, *map("{} ({})".format, others, bounds)

    @property
    def bounds_of_light(self) -> tuple[str, ...]:
        """Name of each class of brightness, with its bounds; 255 DN is white."""
        low, high = (short_text(border, 3) for border in self.brightness_borders.tolist())
        bounds = f"below {low} DN", f"{low} to {high} DN", f"from {high} DN"
        return tuple(map("{} ({})".format, LIGHT_NAMES, bounds))

    @property
    def intervals(self) -> int:
        return len(self.slope)

    @cached_property
    def seconds(self) -> NDArray[np.float64]:
        return np.diff(self.times_us) * 1e-6

    @property
    def pixels(self) -> int:
        return self.width * self.height

    def interval_of(self, t_us: NDArray[np.int64], late_us: float = 0.0) -> NDArray[np.int64]:
        """Return the frame interval of sorted times [us], `late_us` before them."""
        inner = np.searchsorted(t_us, self.times_us[1:-1] + late_us)
        return np.repeat(np.arange(self.intervals), np.diff(np.r_[0, inner, len(t_us)]))

    def phase_of(self, t_us: NDArray[np.int64], interval: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return the phase of times [us] in frame intervals: 0 at one frame, 1 at the next."""
        begin = self.times_us[interval]
        return np.asarray((t_us - begin) / (self.times_us[interval + 1] - begin))


def _speeds(
    slope: NDArray[np.float32], seconds: NDArray[np.float32], still: NDArray[np.float32]
) -> tuple[NDArray[np.uint8], NDArray[np.float32], NDArray[np.float64]]:
    """Return classes of speed, weights (change of log light), and borders of the classes [1/s].

    The borders are those between the thirds of what moves.
    """
    change = np.abs(slope)
    change[change < still] = 0.0
    recent = change.copy()
    for k in range(1, len(recent)):
        fading = recent[k - 1] * np.float32(np.exp(-seconds[k] / _MEMORY_S))
        # what rings down below the least speed is still
        fading[fading < STILL_PER_S] = 0.0
        np.maximum(recent[k], fading, out=recent[k])
    weight = change * seconds[:, None]
    edges = _weighted_quantiles(recent, weight, SPEEDS - 1)
    speed = (1 + np.digitize(recent, edges)).astype(np.uint8)
    speed[recent == 0.0] = STILL
    return speed, weight, edges


def _weighted_quantiles(
    values: NDArray[np.float32], weight: NDArray[np.float32], classes: int
) -> NDArray[np.float64]:
    """Return the borders of `classes` that have the same weight."""
    stride = max(1, values.size // 200_000)
    v, w = values.ravel()[::stride], weight.ravel()[::stride].astype(np.float64)
    if not w.sum() > 0.0:
        w = np.ones_like(w)
    order = np.argsort(v)
    total = np.cumsum(w[order])
    places = np.searchsorted(total, total[-1] * np.arange(1, classes) / classes)
    return np.asarray(v[order][np.minimum(places, len(v) - 1)], np.float64)


@dataclass(frozen=True)
class Placed:
    """A stream, and where each of its events lies in the scene, (n,).

    Frame interval, segment of time, part of the data, and classes of speed and brightness; and what
    several statistics need, made once, by whoever makes it.
    """

    stream: Stream
    interval: NDArray[np.int64]
    segment: NDArray[np.int64]
    part: NDArray[np.int64]
    speed: NDArray[np.int64]
    brightness: NDArray[np.int64]
    made: dict[Any, Any] = field(default_factory=dict, compare=False)

    @classmethod
    def of(cls, stream: Stream, scene: Scene) -> Placed:
        interval = scene.interval_of(stream.t)
        segment = scene.split.segment_of(stream.t)
        seen, known = (one * scene.pixels + stream.pixel for one in (interval, segment))
        return cls(
            stream=stream,
            interval=interval,
            segment=segment,
            part=scene.split.label.take(known).astype(np.int64),
            speed=scene.speed.take(seen).astype(np.int64),
            brightness=scene.brightness.take(seen).astype(np.int64),
        )
