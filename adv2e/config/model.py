"""The configuration as frozen dataclasses, nested as the camera is.

The defaults here are those of the shipped ``adv2e.yaml``.
"""

from __future__ import annotations

from dataclasses import dataclass

from adv2e.effects.frames.encoding import check_encoding
from adv2e.effects.pixel.hot_pixels import HotPixels
from adv2e.effects.pixel.leak import Leak
from adv2e.effects.pixel.log_response import LogResponse
from adv2e.effects.pixel.low_pass import LowPass
from adv2e.effects.pixel.photoreceptor_noise import PhotoreceptorNoise
from adv2e.effects.pixel.refractory import Refractory
from adv2e.effects.pixel.reset_overshoot import ResetOvershoot
from adv2e.effects.pixel.shot_noise import ShotNoise
from adv2e.effects.pixel.slew_limit import SlewLimit
from adv2e.effects.pixel.source_follower import SourceFollower
from adv2e.effects.pixel.thresholds import Thresholds
from adv2e.errors import ConfigError
from adv2e.parameters import Section, parameter, subsection

INTERPOLATIONS = ("linear", "flow")


def _off() -> None:
    return None


@dataclass(frozen=True, kw_only=True)
class Frames(Section):
    """How the numbers in the frames stand for light."""

    encoding: str = parameter(
        "auto",
        unit="-",
        meaning="auto | linear | srgb | gamma:<g> (light = value^g); auto: srgb for video files and"
        " 8-bit colour images, linear for everything else",
    )
    full_scale: float | None = parameter(
        None,
        unit="-",
        meaning="number that means white; null: from the data type (255, 65535, 1.0)",
        above=0,
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        check_encoding(self.encoding)


@dataclass(frozen=True, kw_only=True)
class Sampling(Section):
    """Frames and samples made between the input frames."""

    L: int = parameter(
        10, unit="-", meaning="frames made of each input interval", at_least=1, source="ADV2E"
    )
    K: int = parameter(
        10,
        unit="-",
        meaning="continuity samples of each of those; exact does not depend on it",
        at_least=1,
        source="ADV2E",
    )
    interpolation: str = parameter(
        "linear",
        unit="-",
        meaning="how in-between frames are made, in linear light",
        choices=INTERPOLATIONS,
    )
    last_interval: str = parameter(
        "corrected",
        unit="-",
        meaning="start of the last interpolated interval; printed: as in the paper's equation",
        choices=("corrected", "printed"),
    )


@dataclass(frozen=True, kw_only=True)
class Pixel(Section):
    """The pixel, in signal order."""

    initial_reference: str = parameter(
        "settled",
        unit="-",
        meaning="settled: reference = signal on the first frame; random: uniform between the"
        " thresholds",
        choices=("settled", "random"),
    )
    log_response: LogResponse = subsection(LogResponse, meaning="light to log intensity")
    photoreceptor_noise: PhotoreceptorNoise | None = subsection(
        _off, meaning="band-limited noise", optional=True
    )
    low_pass: LowPass | None = subsection(
        LowPass, meaning="first pole, follows the light", optional=True
    )
    slew_limit: SlewLimit | None = subsection(
        _off, meaning="slew rate of the first pole", optional=True
    )
    source_follower: SourceFollower | None = subsection(_off, meaning="second pole", optional=True)
    thresholds: Thresholds = subsection(Thresholds, meaning="contrast thresholds")
    refractory: Refractory | None = subsection(Refractory, meaning="dead time", optional=True)
    reset_overshoot: ResetOvershoot | None = subsection(
        _off, meaning="reference after an event", optional=True
    )
    leak: Leak | None = subsection(Leak, meaning="leak of the reference", optional=True)
    shot_noise: ShotNoise | None = subsection(
        ShotNoise, meaning="Poisson background events", optional=True
    )
    hot_pixels: HotPixels | None = subsection(
        _off, meaning="pixels that fire by themselves", optional=True
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.photoreceptor_noise is not None and self.low_pass is None:
            raise ConfigError(
                "photoreceptor_noise: is band-limited by low_pass, which is null; give both or none"
            )
        if self.slew_limit is not None and self.low_pass is None:
            raise ConfigError("slew_limit: limits low_pass, which is null; give both or none")


@dataclass(frozen=True, kw_only=True)
class Readout(Section):
    """What happens to events between pixel and file."""


@dataclass(frozen=True, kw_only=True)
class Config(Section):
    """Everything that decides which events come out."""

    seed: int = parameter(0, unit="-", meaning="seed of all random numbers", at_least=0)
    frames: Frames = subsection(Frames, meaning="the input's numbers")
    sampling: Sampling = subsection(Sampling, meaning="in-between frames and samples")
    pixel: Pixel = subsection(Pixel, meaning="the pixel")
    readout: Readout | None = subsection(_off, meaning="the readout", optional=True)
