"""Configurations of adv2e: its own, and the parameters of other tools in its pixel."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

from adv2e.comparison.resimulation import resimulator
from adv2e.config import Config
from adv2e.effects.pixel.thresholds import FLOOR
from adv2e.events import Events
from adv2e.sources import Frame
from experiments.simulators.clip import Clip

OWN = "a configuration of adv2e"
OF_A_TOOL = "its parameters in the pixel of adv2e, not the tool"


@dataclass(frozen=True)
class Pixel:
    """The pixel of adv2e.

    Attributes
    ----------
    name, nature : str
    config : Config
        Its seed and sensor do not count.
    threads : int, optional
        Default: all cores.
    """

    name: str
    nature: str
    config: Config
    threads: int | None = None

    def events(self, clip: Clip, seed: int) -> Events:
        """Return the events of a clip."""

        def frames() -> Iterator[Frame]:
            for t_ns, image in zip(clip.times_ns.tolist(), clip.frames, strict=True):
                yield Frame(t_ns, image, white=255.0)

        # the clip is on the sensor already, whatever camera the configuration is of
        config = replace(self.config, sensor=None)
        return resimulator(frames, config, "linear", clip.size, threads=self.threads)(seed)

    @property
    def levels(self) -> tuple[float, float]:
        """Its thresholds of ON and OFF [ln]."""
        return self.config.pixel.thresholds.on, self.config.pixel.thresholds.off

    def with_levels(self, on: float, off: float) -> Pixel:
        """Return it with other thresholds [ln], the smallest that the pixel has at least."""
        levels = self.config.pixel.thresholds
        thresholds = replace(levels, on=max(on, FLOOR), off=max(off, FLOOR))
        pixel = replace(self.config.pixel, thresholds=thresholds)
        return replace(self, config=replace(self.config, pixel=pixel))

    def from_random_references(self) -> Pixel:
        """Return it with pixels that begin anywhere between their thresholds."""
        pixel = replace(self.config.pixel, initial_reference="random")
        return replace(self, config=replace(self.config, pixel=pixel))
