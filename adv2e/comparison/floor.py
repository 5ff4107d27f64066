"""The noise floor of the distances: what they come to where nothing but chance differs.

Each measured event goes to one of two halves by the toss of a coin.  If events were a Poisson
process, the difference of the halves would be as large as that of one full draw from its own
rate, so the distance between the halves, over the norm of the whole, is how near the true rate
itself would come (a second draw lies sqrt 2 times as far).  It needs no model.  Pixels fire more
regularly than Poisson's, so that a model may come nearer.

A configuration gives another floor: the distance of two of its simulations, which differ in seed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.comparison.distances import MEASURES, distances, pooled
from adv2e.comparison.windows import Windows
from adv2e.config.model import Config
from adv2e.conversion.simulation import events_from_light
from adv2e.effects.frames.encoding import LightDecoder
from adv2e.errors import DataError
from adv2e.events import Events
from adv2e.geometry import Size
from adv2e.light.decoding import decoder_for
from adv2e.light.sensor import Fitting, fitting_of
from adv2e.sources.frame import Frame

SPLITS = 4
"""Half splits whose distances are averaged."""

Floor = dict[str, float | None]
"""A value for each measure, None where it is not defined."""


def half_split(
    measured: Events, windows: Windows, width: int, height: int, *, splits: int = SPLITS
) -> Floor:
    """Return the distances between two halves of the measured events, mean over `splits`.

    The split draws from a generator of fixed seed: the same events give the same floor.
    """
    coin = np.random.default_rng(0)
    found = []
    for _ in range(splits):
        heads = coin.random(len(measured)) < 0.5
        halves = measured[heads], measured[~heads]
        found.append(distances(*halves, windows, width, height, whole=measured).values)
    return {name: pooled([one[name] for one in found], "mean") for name in MEASURES}


# ---- A configuration and frames as a function from a seed to events, for the floor of two seeds.


def resimulator(
    frames: Callable[[], Iterable[Frame]],
    config: Config,
    encoding: str,
    size: tuple[int, int],
    *,
    threads: int | None = None,
) -> Callable[[int], Events]:
    """Return a function that simulates `frames` with a seed and returns sorted events.

    `frames` starts reading them from the beginning, each time it is called; `encoding` is what
    ``frames.encoding: auto`` means for them; `size` is that of the events with which those made are
    compared, and DataError tells of frames that do not come to it.
    """

    def simulate_events(seed: int) -> Events:
        light = _light(frames(), config, encoding, size)
        chunks = events_from_light(light, replace(config, seed=seed), threads=threads)
        return np.concatenate(list(chunks))

    return simulate_events


def _light(
    frames: Iterable[Frame], config: Config, encoding: str, size: tuple[int, int]
) -> Iterator[tuple[int, NDArray[Any]]]:
    decoder: LightDecoder | None = None
    fitting: Fitting | None = None
    for frame in frames:
        if decoder is None:
            image = frame.image
            rows, columns = image.shape[:2]
            fitting = fitting_of(columns, rows, config.sensor, frame.label)
            seen = (columns, rows) if fitting is None else fitting.size
            if seen != size:
                raise DataError(
                    f"{frame.label}: {Size(*seen)} pixels, but the events are of {Size(*size)};"
                    " the configuration of the events has the sensor that brings frames to it"
                )
            decoder = decoder_for(
                config.frames, image.dtype, image.ndim == 3, auto=encoding, white=frame.white
            )
        if frame.odd_white and config.frames.full_scale is None:
            raise DataError(f"{frame.label}: {frame.odd_white}")
        light = decoder.decode(frame.image, frame.alpha)
        yield frame.t_ns, light if fitting is None else fitting.light(light, frame.label)
