"""The configuration as frozen dataclasses, nested as the camera is.

The defaults here are those of the shipped ``adv2e.yaml``.
"""

from __future__ import annotations

from dataclasses import dataclass

from adv2e.effects.frames.encoding import check_encoding
from adv2e.effects.frames.flicker import Flicker
from adv2e.effects.pixel.dark_current import DarkCurrent
from adv2e.effects.pixel.dead_pixels import DeadPixels
from adv2e.effects.pixel.high_pass import HighPass
from adv2e.effects.pixel.hot_pixels import HotPixels
from adv2e.effects.pixel.initial_reference import REFERENCES, RUNNING
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
from adv2e.effects.readout.arbiter import Arbiter
from adv2e.effects.readout.double_read import DoubleRead
from adv2e.effects.readout.event_loss import EventLoss
from adv2e.effects.readout.frame_coupling import FrameCoupling
from adv2e.errors import ConfigError
from adv2e.geometry import MOST_PIXELS
from adv2e.kernel import rng
from adv2e.parameters import Fit, Section, parameter, subsection

INTERPOLATIONS = ("linear", "flow", "given", "onnx")
FITS = ("crop", "pad", "stretch", "none")
MOST_COLUMNS = 1 << 16
"""Columns, or rows, that the coordinates of events can name."""


@dataclass(frozen=True, kw_only=True)
class Frames(Section):
    """Decoding of frames to light, and their exposure, clock and position on the sensor."""

    encoding: str = parameter(
        "auto",
        unit="-",
        meaning="auto | linear | srgb | bt709 | pq | hlg | gamma:<g> (light = value^g); auto: what"
        " a video states, else srgb for it and all 8-bit pictures; linear for cameras' recordings,"
        " mosaics, 16 bits and floats",
    )
    full_scale: float | None = parameter(
        None,
        unit="-",
        meaning="number that means white; null: from the data type (255, 65535, 1.0)",
        above=0,
    )
    black_level_dn: float = parameter(
        0.0,
        unit="DN",
        meaning="light that the decoded frames lack at every brightness",
        fit=Fit(-100.0, 100.0, 1.5),
    )
    black_depth_dn: float = parameter(
        0.0,
        unit="DN",
        meaning="how far light falls on inside areas that the frames clip at 0",
        at_least=0,
        fit=Fit(0.01, 100.0, 3.0, log=True),
    )
    exposure_us: float = parameter(
        0.0,
        unit="us",
        meaning="time over which a frame averages the light, about its own time; 0: none",
        at_least=0,
        fit=Fit(100.0, 2e5, 4000.0, log=True),
    )
    clock_offset_us: float = parameter(
        0.0,
        unit="us",
        meaning="time on the camera's clock minus stamp of the frame",
        fit=Fit(-1e6, 1e6, 600.0),
    )
    clock_drift_ppm: float = parameter(
        0.0,
        unit="ppm",
        meaning="by how much the clock of the frames is slow, from the first frame on",
        above=-1e6,
        fit=Fit(-1e5, 1e5, 1500.0),
    )
    shift_px: tuple[float, float] = parameter(
        (0.0, 0.0),
        unit="px",
        meaning="[x, y]: how far the picture in the frames lies right of and below that of the"
        " events",
        fit=Fit(-20.0, 20.0, 0.3),
    )
    flicker: Flicker | None = subsection(
        None, meaning="light of lamps, of which the frames know nothing"
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        check_encoding(self.encoding)


@dataclass(frozen=True, kw_only=True)
class Sensor(Section):
    """The pixels that the frames are brought to, each the mean of the light on its area."""

    width: int = parameter(unit="px", meaning="columns", at_least=1, at_most=MOST_COLUMNS)
    height: int = parameter(unit="px", meaning="rows", at_least=1, at_most=MOST_COLUMNS)
    fit: str = parameter(
        "crop",
        unit="-",
        meaning="how frames of another shape come in; crop: they cover the sensor, and what is"
        " over at both ends is cut; pad: all of them is seen, and the rest is black; stretch: each"
        " axis by itself; none: they must have its size",
        choices=FITS,
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.width * self.height > MOST_PIXELS:
            raise ConfigError(
                f"width: {self.width}x{self.height} are {self.width * self.height:,} pixels; at"
                f" most {MOST_PIXELS:,} are simulated"
            )


@dataclass(frozen=True, kw_only=True)
class Sampling(Section):
    """Frames and samples made between the input frames."""

    L: int = parameter(
        10,
        unit="-",
        meaning="frames made of each input interval",
        at_least=1,
        at_most=1_000_000,
        source="ADV2E",
    )
    K: int = parameter(
        10,
        unit="-",
        meaning="continuity samples of each of those; exact does not depend on it",
        at_least=1,
        at_most=1_000_000,
        source="ADV2E",
    )
    interpolation: str = parameter(
        "linear",
        unit="-",
        meaning="how in-between frames are made: linear blends them, flow moves them along the"
        " motion, given along flow that lies beside the frames, onnx asks a network",
        choices=INTERPOLATIONS,
    )
    model: str | None = parameter(
        None, unit="-", meaning="ONNX file of the network that interpolation: onnx asks"
    )
    max_motion_px: float | None = parameter(
        None,
        unit="px",
        meaning="furthest that a pixel may move from one made frame to the next, if L of them are"
        " enough; null: always L",
        above=0,
    )
    last_interval: str = parameter(
        "corrected",
        unit="-",
        meaning="start of the last interpolated interval; printed: as in the paper's equation",
        choices=("corrected", "printed"),
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        network = self.interpolation == "onnx"
        if network and not self.model:
            raise ConfigError("model: interpolation: onnx needs the network's file, such as a.onnx")
        if self.model is not None and not network:
            raise ConfigError(
                f"model: {self.interpolation} interpolation asks no network: leave it out, or set"
                " interpolation: onnx"
            )
        if self.max_motion_px is not None and self.interpolation == "linear":
            raise ConfigError(
                "max_motion_px: linear interpolation knows of no motion: leave it out, or set"
                " interpolation: flow or onnx"
            )


@dataclass(frozen=True, kw_only=True)
class Pixel(Section):
    """The pixel, in signal order."""

    initial_reference: str = parameter(
        RUNNING,
        unit="-",
        meaning="reference at the first frame; running: where leak and noise have brought it, in a"
        " camera that was on before; settled: the signal; random: uniform between the thresholds",
        choices=REFERENCES,
    )
    dark_current: DarkCurrent | None = subsection(
        None, meaning="constant light that the frames lack"
    )
    log_response: LogResponse = subsection(LogResponse, meaning="light to log intensity")
    photoreceptor_noise: PhotoreceptorNoise | None = subsection(None, meaning="band-limited noise")
    low_pass: LowPass | None = subsection(LowPass, meaning="first pole, follows the light")
    slew_limit: SlewLimit | None = subsection(None, meaning="slew rate of the first pole")
    source_follower: SourceFollower | None = subsection(None, meaning="second pole")
    high_pass: HighPass | None = subsection(None, meaning="high-pass ahead of the comparator")
    thresholds: Thresholds = subsection(Thresholds, meaning="contrast thresholds")
    refractory: Refractory | None = subsection(Refractory, meaning="dead time")
    reset_overshoot: ResetOvershoot | None = subsection(None, meaning="reference after an event")
    leak: Leak | None = subsection(None, meaning="leak of the reference")
    shot_noise: ShotNoise | None = subsection(ShotNoise, meaning="Poisson background events")
    hot_pixels: HotPixels | None = subsection(None, meaning="pixels that fire by themselves")
    dead_pixels: DeadPixels | None = subsection(None, meaning="pixels that never fire")

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
    """Readout of events from the pixel to the file, and coupling of the frame readout to pixels."""

    frame_coupling: FrameCoupling | None = subsection(
        None, meaning="disturbance of the event pixels by the readout of frames"
    )
    arbiter: Arbiter | None = subsection(None, meaning="one channel for the events of all rows")
    double_read: DoubleRead | None = subsection(None, meaning="events that are read twice")
    loss: EventLoss | None = subsection(None, meaning="events lost at random")
    tick_us: float = parameter(
        0.0,
        unit="us",
        meaning="tick of the time stamps; 0: microseconds as they are",
        at_least=0,
        fit=Fit(1.0, 10000.0, 1.0, log=True),
    )


@dataclass(frozen=True, kw_only=True)
class Config(Section):
    """Everything that decides which events come out.

    :func:`adv2e.load_config` makes one, from the defaults, names, files, mappings and single keys,
    and changes one.  Values are attributes; ``adv2e config show`` tells what each key means.

    Examples
    --------
    >>> from adv2e import Config, load_config
    >>> Config() == load_config()
    True
    >>> config = load_config("davis346", "pixel.thresholds.on=0.3")
    >>> config.pixel.thresholds.on
    0.3
    """

    seed: int = parameter(
        0, unit="-", meaning="seed of all random numbers", at_least=0, at_most=rng.LARGEST_SEED
    )
    max_events: int = parameter(
        10_000_000_000,
        unit="-",
        meaning="a simulation that makes more events ends with an error",
        at_least=1,
    )
    frames: Frames = subsection(Frames, meaning="the input's numbers")
    sensor: Sensor | None = subsection(
        None, meaning="size of the sensor, and how frames come to it; null: as the frames are"
    )
    sampling: Sampling = subsection(Sampling, meaning="in-between frames and samples")
    pixel: Pixel = subsection(Pixel, meaning="the pixel")
    readout: Readout | None = subsection(None, meaning="the readout")
