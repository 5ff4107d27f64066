"""Judges streams of events by what frozen networks see in them, by distance and by still pixels.

What each measure is stands in :mod:`experiments.frozen`.

References
----------
.. [1] Z. Wang et al., "Image Quality Assessment: From Error Visibility to Structural Similarity",
   IEEE Transactions on Image Processing 13(4), 2004, doi:10.1109/TIP.2003.819861.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import cv2
import numpy as np
from networks.firenet import NETWORKS, Images, Network
from numpy.typing import NDArray

from adv2e.comparison.distances import distances
from adv2e.comparison.floor import half_split
from adv2e.comparison.windows import Windows
from adv2e.errors import DataError
from adv2e.events import Events, cut, empty_events, sort_events
from experiments.clip import Simulator
from experiments.recordings import SCORE, Recording, halves

JITTER_MS = 2.0
"""Standard deviation of the times of the third floor [ms]."""
DARK_DN = 10.0
"""Still pixels are judged below and above this grey value [DN of 255]."""
LEAST = 3.0
"""Events that are added to counts of still pixels before their logarithm is taken."""
MARGINS = {
    **dict.fromkeys(NETWORKS, 0.01),
    "distance": 0.02,
    "ON share": 0.01,
    "events": 0.05,
    **dict.fromkeys(("dark ON", "dark OFF", "bright ON", "bright OFF"), 0.2),
}
"""By how much a measure must be worse than the reference's to count."""


@dataclass(frozen=True)
class Still:
    """The still pixels of a recording, by name of the part of the picture, and time recorded."""

    parts: dict[str, NDArray[np.bool_]]
    duration_s: float

    @classmethod
    def of(cls, measured: Recording, windows: Windows) -> Still:
        """Return those of a recording; parts without still pixels are left out."""
        still, dark = measured.still, measured.clip.frames.mean(axis=0) < DARK_DN
        parts = {"dark": still & dark, "bright": still & ~dark}
        silent = sum(
            max(0, min(stop, windows.stop) - max(start, windows.start))
            for start, stop in measured.silences
        )
        used = {name: mask for name, mask in parts.items() if mask.any()}
        return cls(used, windows.duration_s - 1e-6 * silent)

    def counts(self, events: Events) -> dict[str, float]:
        """Return numbers of events by part and polarity."""
        found = {}
        for name, mask in self.parts.items():
            there = mask[events["y"], events["x"]]
            for sign, value in (("ON", 1), ("OFF", 0)):
                found[f"{name} {sign}"] = float(np.count_nonzero(there & (events["p"] == value)))
        return found

    def exposure(self, name: str) -> float:
        """Return how many pixel seconds a count is of."""
        return self.duration_s * float(np.count_nonzero(self.parts[name.split(maxsplit=1)[0]]))


@dataclass(frozen=True)
class Row:
    """One simulator, or the measured events, by name of the measure.

    Attributes
    ----------
    label : str
    values : mapping
        None where there is nothing to tell.
    floors : mapping
        Between seeds.
    images : mapping of network to images
    """

    label: str
    values: dict[str, float | None]
    floors: dict[str, float | None]
    images: dict[str, Images]

    def error(self, measured: Row, name: str, exposure: float = 1.0) -> float | None:
        """Return how far a measure is from the measured value, larger for farther."""
        value, goal = self.values.get(name), measured.values.get(name)
        if value is None:
            return None
        if name in NETWORKS:
            return 1.0 - value
        if name == "distance" or goal is None:
            return value
        if name == "ON share":
            return abs(value - goal)
        if name == "events":
            return abs(float(np.log(max(value, 1e-9))))
        return abs(float(np.log((value * exposure + LEAST) / (goal * exposure + LEAST))))


class Judge:
    """Judges streams against the second half of a recording.

    Parameters
    ----------
    real : Recording
    networks : sequence of Network
    """

    def __init__(self, real: Recording, networks: Sequence[Network]) -> None:
        self.real, self.networks = real, networks
        self.first, self.test = halves(self.real.windows)
        self.still = Still.of(real, self.test)
        self.events = cut(self.real.events, self.test.start, self.test.stop)
        self.images = self.reconstructed(self.events)

    def reconstructed(self, events: Events) -> dict[str, Images]:
        """Return what the networks make of a stream, an image a frame interval."""
        parts = [cut(events, *window) for window in self.test.used]
        return {one.name: one.images(parts, self.real.size) for one in self.networks}

    def simulated(self, simulator: Simulator, label: str, seeds: int) -> Row:
        """Return how near a simulator is, means over seeds."""
        streams = self.real.made(simulator, self.test, range(seeds))
        judged = self.real.against(streams, self.test)
        images = [self.reconstructed(one) for one in streams]
        values = _means([self._of_stream(*one) for one in zip(streams, images, strict=True)])
        values["distance"] = judged.values[SCORE]
        floors = {name: alike(images[0][name], images[-1][name]) for name in self.images}
        return Row(label, values, {**floors, "distance": judged.floor[SCORE]}, images[0])

    def of_the_camera(self) -> Row:
        """Return the measured events as a row."""
        return Row("measured", self._of_stream(self.events, self.images), {}, self.images)

    @cached_property
    def half(self) -> Row:
        """Return a half of the measured events, by the toss of a coin, against all of them."""
        chosen = np.random.default_rng(0).random(len(self.events)) < 0.5
        images = self.reconstructed(self.events[chosen])
        values: dict[str, float | None] = self._alike(images)
        values["distance"] = half_split(self.events, self.test, *self.real.size)[SCORE]
        return Row("half of the measured events", values, {}, images)

    @cached_property
    def jittered(self) -> Row:
        """Return the measured events with times that jitter, against themselves."""
        events = self.events.copy()
        apart = np.random.default_rng(0).normal(0.0, 1e3 * JITTER_MS, len(events))
        last = self.test.stop - 1
        events["t"] = np.clip(np.rint(events["t"] + apart), self.test.start, last)
        events = sort_events(events)
        images = self.reconstructed(events)
        found = distances(self.events, events, self.test, *self.real.size).values[SCORE]
        values = {**self._alike(images), "distance": found}
        return Row(f"measured, times jittered by {JITTER_MS:g} ms", values, {}, images)

    @cached_property
    def nothing(self) -> Row:
        """Return what no events at all come to."""
        images = self.reconstructed(empty_events())
        return Row("no events at all", {**self._alike(images), "distance": 1.0}, {}, images)

    def loaded(self) -> Iterator[str]:
        """Yield how a network's images of the measured events resemble the frames.

        Raises
        ------
        DataError
            Not more than the frames mirrored: the weights are not read as they are meant.
        """
        stops = [stop for _, stop in self.test.used]
        frames = self.real.clip.frames[np.isin(self.real.times_us, stops)]
        for name, images in self.images.items():
            pairs = list(zip(images, frames, strict=True))
            like = float(np.mean([likeness(*pair) for pair in pairs]))
            chance = float(np.mean([likeness(a, b[:, ::-1]) for a, b in pairs]))
            if like <= chance:
                raise DataError(
                    f"{self.real.name}: images of {name} resemble the frames ({like:.2f}) no more"
                    f" than mirrored ones ({chance:.2f}): are these its weights?"
                )
            yield f"{name} {like:.2f} (mirrored {chance:.2f})"

    def _of_stream(self, events: Events, images: dict[str, Images]) -> dict[str, float | None]:
        counts = self.still.counts(events)
        return {
            **self._alike(images),
            **{name: count / self.still.exposure(name) for name, count in counts.items()},
            "ON share": float(np.mean(events["p"])) if len(events) else None,
            "events": len(events) / len(self.events),
        }

    def _alike(self, images: dict[str, Images]) -> dict[str, float | None]:
        return {name: alike(images[name], self.images[name]) for name in self.images}

    def behind(self, row: Row, reference: Row, measured: Row) -> list[str]:
        """Return the measures in which a row is farther than the reference beyond the margin."""
        names = []
        for name, margin in MARGINS.items():
            exposure = self.still.exposure(name) if name in self._still_names() else 1.0
            mine, other = (one.error(measured, name, exposure) for one in (row, reference))
            if mine is not None and other is not None and mine > other + margin:
                names.append(name)
        return names

    def _still_names(self) -> list[str]:
        return [f"{part} {sign}" for part in self.still.parts for sign in ("ON", "OFF")]


def similarity(a: NDArray[Any], b: NDArray[Any]) -> float:
    """Return the mean structural similarity of two images between 0 and 1.

    As [1]_: means, variances and covariance under a Gaussian of 1.5 pixels (11 x 11), constants
    0.01**2 and 0.03**2.  1 for equal images.
    """
    a, b = np.asarray(a, np.float64), np.asarray(b, np.float64)

    def mean(image: NDArray[Any]) -> NDArray[Any]:
        return cv2.GaussianBlur(image, (11, 11), 1.5)

    at_a, at_b = mean(a), mean(b)
    spread = mean(a * a) - at_a**2 + mean(b * b) - at_b**2
    both = mean(a * b) - at_a * at_b
    light = (2 * at_a * at_b + 1e-4) / (at_a**2 + at_b**2 + 1e-4)
    return float(np.mean(light * (2 * both + 9e-4) / (spread + 9e-4)))


def likeness(image: NDArray[Any], frame: NDArray[Any]) -> float:
    """Return the correlation of an image with a frame's light [DN], under a logarithm of DN + 5."""
    return float(np.corrcoef(np.ravel(image), np.log(np.ravel(frame) + 5.0))[0, 1])


def alike(images: Images, others: Images) -> float:
    """Return the mean similarity of images one by one."""
    return float(np.mean([similarity(*pair) for pair in zip(images, others, strict=True)]))


def _means(found: Sequence[dict[str, float | None]]) -> dict[str, float | None]:
    means = {}
    for name in found[0]:
        values = [one[name] for one in found]
        there = [value for value in values if value is not None]
        means[name] = float(np.mean(there)) if there else None
    return means
