"""A configuration and frames as a function from a seed to events, for the floor of two seeds."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace

import numpy as np

from adv2e.config.model import Config
from adv2e.conversion.simulation import events_from_light
from adv2e.effects.frames.encoding import LightDecoder
from adv2e.effects.hooks import Frames
from adv2e.errors import DataError
from adv2e.events import Events
from adv2e.geometry import Size
from adv2e.light.decoding import decoder_for
from adv2e.light.sensor import Fitting, fitting_of
from adv2e.sources.frame import Frame


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


def _light(frames: Iterable[Frame], config: Config, encoding: str, size: tuple[int, int]) -> Frames:
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
