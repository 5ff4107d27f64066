"""Options of inputs, outputs and runs, each declared once for the command line and for Python.

A group of options is a ``TypedDict`` whose annotations hold an :class:`Option` each.  ``adv2e.cli``
makes Click's options of it.  A function takes the same options by name::

    @takes(InputOptions)
    def open_source(path, **options: Unpack[InputOptions]): ...

:func:`takes` refuses names and values that are wrong, and hands it all options, with defaults for
those that were left out.  :func:`show_options` gives public functions the signature and the
documentation that the declarations say.
"""

import difflib
import functools
import inspect
import math
import re
import textwrap
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from decimal import Decimal
from numbers import Real
from typing import (
    TYPE_CHECKING,
    Annotated,
    Any,
    ForwardRef,
    SupportsIndex,
    TypedDict,
    TypeVar,
    get_args,
)

from adv2e.errors import UsageError
from adv2e.geometry import Rectangle, Size, parse_rectangle, parse_size

if TYPE_CHECKING:
    from collections.abc import Sequence
    from fractions import Fraction
    from pathlib import Path

Function = TypeVar("Function", bound=Callable[..., Any])
Options = TypeVar("Options")

UNITS = ("s", "ms", "us", "ns")
"""Units of time, by name."""

BAYER = ("RGGB", "BGGR", "GRBG", "GBRG")
"""Mosaics: colours of the first two pixels of the first row, then of the second."""

PIXEL_FORMATS = (
    *("gray", "gray10le", "gray12le", "gray14le", "gray16le", "rgb24", "bgr24", "rgb48le"),
)
"""Raw video that is read, by FFmpeg's names."""

MOST_PICTURES = 36_000
"""Most pictures of a film."""

MOST_EMPTY = 1000
"""Most windows in a row without an event."""

SET_BACK = ("continue", "sort")
"""Readings of events whose times go back."""


MOST_SHARE = 0.9
"""Largest share of what is kept for validation."""


def _number(what: str, fits: Callable[[Any], bool]) -> Callable[[Any], Any]:
    """Return a check of numbers that are finite and fit, which `what` says in words."""

    def checked(value: Any) -> Any:
        is_number = isinstance(value, (Real, Decimal))
        if not (is_number and math.isfinite(value) and fits(value)):
            raise ValueError(f"must be {what}, got {value!r}")
        return value if isinstance(value, (int, float)) else float(value)

    return checked


def _count(value: int) -> int:
    if not (isinstance(value, SupportsIndex) and value >= 1):
        raise ValueError(f"must be a whole number from 1 on, got {value!r}")
    return value


_CHECKS: dict[str, Callable[[Any], Any]] = {
    "size": parse_size,
    "rectangle": parse_rectangle,
    "seconds": _number("seconds from the beginning, 0 or more", lambda value: value >= 0),
    "positive": _number("a number above 0", lambda value: value > 0),
    "share": _number(f"a share from 0 to {MOST_SHARE}", lambda value: 0 <= value <= MOST_SHARE),
    "time": _count,
    "count": _count,
}
_METAVARS = {
    **{"size": "WxH", "rectangle": "X,Y,W,H", "seconds": "S", "share": "SHARE", "time": "TIME"},
    **{"count": "N", "rate": "F", "path": "FILE"},
}
_UNIT = re.compile("_(s|ms|us|px)$")
"""Unit at the end of a name in Python, which a text on the command line states, or its help."""


@dataclass(frozen=True, kw_only=True)
class Option:
    """Declaration of one option.

    Attributes
    ----------
    help : str
        Meaning, in the words of the command line; ``--size`` in it is ``size`` in Python.
    default : object
        False makes it a flag, () an option that may be repeated.
    usual : str
        Effect of leaving it out, if the default value does not tell.
    kind : str
        Type on the command line: text, path, rate, size, rectangle, seconds, positive, share,
        time, or count.
    choices : tuple of str
        Values, if there are only few.
    flags : tuple of str
        Names on the command line, if there is not the one that Python has, without its unit.
    metavar : str
        Value in the help of the command line, if its kind does not tell.
    most : int, optional
        Largest value of a number.
    completes : str
        Names that a shell completes: of files, formats, or layouts.
    """

    help: str
    usual: str = ""
    default: Any = None
    kind: str = "text"
    choices: tuple[str, ...] = ()
    flags: tuple[str, ...] = ()
    metavar: str = ""
    most: int | None = None
    completes: str = ""

    def flag_of(self, name: str) -> str:
        """Return the name on the command line of the option that Python calls `name`."""
        return self.flags[0] if self.flags else "--" + _UNIT.sub("", name).replace("_", "-")

    @property
    def shown(self) -> str | None:
        """What stands for its value in the help of the command line."""
        return self.metavar or _METAVARS.get(self.kind)

    def checked(self, name: str, value: Any) -> Any:
        """Return a value as the code takes it.

        Raises
        ------
        UsageError
            It is impossible.
        """
        if value is None or self.default == ():
            return value
        try:
            if self.choices and value not in self.choices:
                *first, last = self.choices
                raise ValueError(f"must be {', '.join(first)} or {last}, got {value!r}")
            found = _CHECKS[self.kind](value) if self.kind in _CHECKS else value
            if self.most is not None and found > self.most:
                raise ValueError(f"must be at most {self.most}, got {value!r}")
            return found
        except (ValueError, TypeError) as error:
            raise UsageError(f"{name}: {error}") from None


_flag = functools.partial(Option, default=False)
"""Declares an option that is given, or not."""


class AnyInput(TypedDict, total=False):
    """Options of any input, be it frames or events."""

    time_unit: Annotated[
        "str | None",
        Option(
            help="Unit of the times in lists and event files.",
            usual="what the file says; else a guess, and a line that tells it",
            choices=UNITS,
        ),
    ]
    rotate180: Annotated[
        bool,
        _flag(
            help="Turn frames and events by 180 degrees, first of all: the camera was mounted"
            " upside down, as for DDD17 and DDD20."
        ),
    ]
    track: Annotated[
        "str | int | None",
        Option(
            help="Which one to read of several video tracks, streams or topics: its number from 0,"
            " or its name.",
            usual="the usual one of them, and a line that tells all",
            flags=("--track", "--stream", "--topic"),
            metavar="N|NAME",
        ),
    ]
    size: Annotated[
        "str | tuple[int, int] | None",
        Option(
            help="Size of the sensor, such as 346x260. Frames are scaled and cut to it; sensor.fit"
            " says how. Of raw video it is the size of the frames, too.",
            usual="as the frames are, or as the file of events says",
            kind="size",
        ),
    ]


class EventOrder(TypedDict, total=False):
    """Option of events out of order."""

    set_back: Annotated[
        "str | None",
        Option(
            help="Where times of events go back by more than 0.1 s. continue: from the time"
            " before, as where a clock was reset. sort: by time.",
            usual="an error",
            choices=SET_BACK,
        ),
    ]


StartS = Annotated[
    "float | None",
    Option(
        help="Begin S seconds after the first frame; where events are read, after the first event.",
        kind="seconds",
    ),
]

StopS = Annotated[
    "float | None",
    Option(help="Stop S seconds after the same.", kind="seconds"),
]


class Part(TypedDict, total=False):
    """Options that choose a part of an input."""

    start_s: StartS
    stop_s: StopS
    crop: Annotated[
        "str | tuple[int, int, int, int] | None",
        Option(
            help="Take a part of each frame or sensor only, before anything else: first column,"
            " first row, columns, rows.",
            kind="rectangle",
        ),
    ]


class EventInput(AnyInput, EventOrder, Part, total=False):
    """Options of the reading of events."""

    crop_events: Annotated[
        bool,
        _flag(
            help="Leave out events outside the sensor, however many.",
            usual="more than 1 % are an error",
        ),
    ]


class AnyFrames(AnyInput, total=False):
    """Options of the reading of frames, of one input or of many."""

    fps: Annotated[
        "float | Fraction | str | None",
        Option(
            help="Take the frames at F a second, such as 240 or 30000/1001, whatever the input"
            " says.",
            kind="rate",
        ),
    ]
    allow_damaged: Annotated[
        bool,
        _flag(help="Take what can be decoded of a damaged video, and say what is missing."),
    ]
    bayer: Annotated[
        "str | None",
        Option(
            help="Frames are raw mosaics, with these colours in the first two rows: make them"
            " colour.",
            choices=BAYER,
        ),
    ]


class FrameInput(AnyFrames, total=False):
    """Options of the reading of the frames of one input."""

    timestamps: Annotated[
        "str | Path | None",
        Option(help="Read the times of the frames from FILE, one a line.", kind="path"),
    ]
    pixel_format: Annotated[
        "str | None",
        Option(
            help="Raw video comes through standard input (the input is -), in frames of the --size"
            " given.",
            choices=PIXEL_FORMATS,
        ),
    ]
    network: Annotated[
        bool,
        _flag(help="INPUT may be an address, such as rtsp://CAMERA/stream, that FFmpeg opens."),
    ]


class Clock(TypedDict, total=False):
    """Option of the clock of what is made."""

    t0: Annotated[
        str,
        Option(
            help="Where times begin. zero: at the first frame converted. keep, auto: as on the"
            " input's own clock; if it has none, at the input's first frame.",
            default="auto",
            choices=("auto", "zero", "keep"),
        ),
    ]


class MotionOptions(TypedDict, total=False):
    """Options of pictures before which the sensor moves."""

    motion: Annotated[
        "str | None",
        Option(
            help="The input is one picture, before which the sensor moves: in three saccades, as"
            " N-MNIST was recorded, as a hand shakes, or to the right.",
            choices=("saccade", "shake", "pan"),
        ),
    ]
    extent_px: Annotated[
        "float | None",
        Option(
            help="How far it moves, in pixels of the sensor.",
            usual="6, 8 or 32",
            kind="positive",
            most=1_000_000,
            metavar="PX",
        ),
    ]
    duration_s: Annotated[
        "float | None",
        Option(
            help="How long that takes, in seconds.",
            usual="0.3, 1 or 1",
            kind="positive",
            most=1_000_000,
            metavar="S",
        ),
    ]


class SourceOptions(FrameInput, Part, Clock, MotionOptions, total=False):
    """Options of an input with frames that are simulated."""


Overwrite = Annotated[bool, _flag(help="Replace an output that exists.")]


class Content(TypedDict, total=False):
    """Options of what a file of events holds beside them."""

    with_frames: Annotated[
        bool,
        _flag(help="Store the frames, too, in an HDF5 output. DAVIS240C outputs always hold them."),
    ]
    causes: Annotated[
        bool,
        _flag(
            help="Also store what made each event: the light, leak or a kind of noise. HDF5 holds"
            " it as events/causes, .npz and .csv as a column; beside other formats it is"
            " OUT.causes.txt."
        ),
    ]


class SideInput(TypedDict, total=False):
    """Option of what an input has beside frames and events."""

    side: Annotated[
        "str | Path | None",
        Option(
            help="Take poses, IMU, calibration, boxes, masks, depth and flow from this folder or"
            " zip. none: carry none along.",
            usual="from the input itself, or INPUT.side beside it",
            metavar="FOLDER|none",
            completes="files",
        ),
    ]


class Blurred(TypedDict, total=False):
    """Option of the frames that are written beside events."""

    blurred_frames: Annotated[
        "int | None",
        Option(
            help="Also write blurred frames, for sets of deblurring: each is the mean of the light"
            " from a frame to the N-th behind it.",
            kind="count",
        ),
    ]


class Strictness(TypedDict, total=False):
    """Option of guesses."""

    strict: Annotated[
        bool,
        _flag(
            help="Make no guess: what an input does not say, and no option or key does, is an"
            " error that names it.",
            usual="guesses are told, and in the label that 'adv2e info' shows first",
        ),
    ]


class OutputOptions(Content, SideInput, total=False):
    """Options of a file of events that is written."""

    format: Annotated[
        "str | None",
        Option(
            help="Write this format, whatever the suffix.",
            metavar="NAME",
            completes="formats",
        ),
    ]
    layout: Annotated[
        "str | None",
        Option(help="Layout of an HDF5 output.", metavar="NAME", completes="layouts"),
    ]
    overwrite: Overwrite


class SimulatedOutput(OutputOptions, Blurred, Strictness, total=False):
    """Options of the output of a simulation."""

    preview: Annotated[
        "str | Path | None",
        Option(
            help="Also draw the frames beside the events, as 'adv2e render' does: a film (.mp4,"
            " .webm, .gif, .avi) or a sheet of pictures (.png).",
            metavar="FILE",
            completes="files",
        ),
    ]


Progress = Annotated[bool, _flag(help="Show a progress bar on stderr.")]


Threads = Annotated[
    "int | None",
    Option(
        help="Compute with N threads. The result is the same for any N.",
        usual="all cores that this process may use",
        kind="count",
    ),
]


class Run(TypedDict, total=False):
    """Options of any work."""

    threads: Threads
    progress: Progress


class CopyOptions(EventInput, Clock, OutputOptions, Strictness, Run, total=False):
    """Options of the writing of events in another format."""


class InfoOptions(FrameInput, EventOrder, Part, total=False):
    """Options of the description of an input."""


class CompareOptions(EventInput, total=False):
    """Options of a comparison of two streams of events."""

    window_s: Annotated[
        "float | None",
        Option(
            help="Compare in windows of S seconds.",
            usual="from frame to frame; 0.05 if MEASURED has no frames",
            kind="positive",
            metavar="S",
        ),
    ]
    frames: Annotated[
        "str | Path | None",
        Option(
            help="Take the frames from INPUT, on the clock of MEASURED. They set the windows, and"
            " are what is simulated.",
            usual="the frames in MEASURED",
            metavar="INPUT",
            completes="files",
        ),
    ]
    threads: Threads


class SensorOptions(TypedDict, total=False):
    """Options of the measures of a sensor."""

    contrast: Annotated[
        float,
        Option(
            help="Size of the step of which the latency is measured: natural logarithm of the ratio"
            " of the lights; 1 is 172 %.",
            default=1.0,
            kind="positive",
            metavar="LN",
        ),
    ]
    white_lux: Annotated[
        "float | None",
        Option(
            help="Illuminance that white, 255 DN, stands for [lux]; levels of light are then in"
            " lux, too.",
            kind="positive",
            metavar="LUX",
        ),
    ]
    threads: Threads


class ConvertOptions(SourceOptions, EventInput, SimulatedOutput, Run, total=False):
    """Options of a conversion."""

    take: Annotated[
        "str | None",
        Option(
            help="What to take of an input that holds both: simulate its frames, or write its"
            " events in another format.",
            usual="the frames of cameras' recordings; the events of other files",
            flags=("--from",),
            choices=("frames", "events"),
        ),
    ]


class DiagnoseOptions(EventInput, Run, total=False):
    """Options of a diagnosis."""

    light: Annotated[
        "str | Path | None",
        Option(
            help="What the light was, in the place of frames: a table with the columns time_s and"
            " light_dn (255 is white).",
            metavar="TABLE",
            completes="files",
        ),
    ]
    film: Annotated[
        "str | Path | None",
        Option(
            help="What the camera saw, in the place of frames: a video, or one picture before which"
            " it moved. How it saw that is fitted.",
            metavar="FILM",
            completes="files",
        ),
    ]
    films: Annotated[
        "str | Path | None",
        Option(
            help="The same for many recordings of one camera: a table with the columns events and"
            " film, names of files beside it.",
            metavar="TABLE",
            completes="files",
        ),
    ]
    without: Annotated[
        "Sequence[str]",
        Option(
            help="Leave an effect out of the library.",
            default=(),
            metavar="EFFECT",
            completes="library",
        ),
    ]
    fit_thresholds: Annotated[
        bool,
        _flag(
            help="The contrast thresholds are not known: fit them first, to the totals of ON and"
            " OFF."
        ),
    ]
    overwrite: Overwrite


class FilmOptions(TypedDict, total=False):
    """Options of films and sheets of pictures."""

    fps: Annotated[
        float,
        Option(help="Pictures a second of a film.", default=30.0, kind="positive", metavar="F"),
    ]
    speed: Annotated[
        float,
        Option(
            help="Speed of a film: 1 is real time, 0.1 is ten times slower.",
            default=1.0,
            kind="positive",
            metavar="X",
        ),
    ]
    count: Annotated[
        int,
        Option(
            help="Show N instants on a sheet, about evenly spaced, if none is named.",
            default=6,
            kind="count",
            most=100,
        ),
    ]
    scale: Annotated[
        "int | None",
        Option(
            help="Draw each pixel N times as wide and high.",
            usual="panels about 640 pixels wide",
            kind="count",
            most=32,
        ),
    ]
    max_pictures: Annotated[
        int,
        Option(
            help="Most pictures of a film: one wrong time would make far too many.",
            default=MOST_PICTURES,
            kind="count",
        ),
    ]
    overwrite: Overwrite


class RenderedPart(FilmOptions, total=False):
    """Options of the film or sheet of a whole recording."""

    start_s: StartS
    stop_s: StopS
    at_s: Annotated[
        "Sequence[float]",
        Option(help="Show this instant on a sheet.", default=(), kind="seconds"),
    ]
    progress: Progress


_STYLE = Option(
    help="white, black: coloured events on that ground. grey: the net count of events, as v2e"
    " draws it. surface: colours that fade with age.",
    default="white",
    choices=("white", "black", "grey", "surface"),
)


class RenderOptions(RenderedPart, EventInput, total=False):
    """Options of pictures and films of events."""

    style: Annotated[
        str,
        replace(
            _STYLE,
            help=f"{_STYLE.help} rate: events a second over time, a .png.",
            choices=(*_STYLE.choices, "rate"),
        ),
    ]
    on_color: Annotated[
        str,
        Option(help="Colour of ON events: a name or #rrggbb.", default="red", metavar="COLOR"),
    ]
    off_color: Annotated[
        str,
        Option(help="Colour of OFF events: a name or #rrggbb.", default="blue", metavar="COLOR"),
    ]
    window_ms: Annotated[
        "float | None",
        Option(
            help="A picture shows the events of the last MS milliseconds; rate has bins of MS.",
            usual="in a film, those since the picture before; on a sheet 20; of rate a round part",
            kind="positive",
            metavar="MS",
        ),
    ]


class ViewOptions(EventInput, total=False):
    """Options of a page on which to look at events."""

    no_frames: Annotated[bool, _flag(help="Leave out the frames beneath.")]
    overwrite: Overwrite
    progress: Progress


WindowUs = Annotated[
    "int | None",
    Option(
        help="Cut the events into windows of TIME, such as 33ms: of voxel, histogram, surface,"
        " picture and rvt; for ev-segnet the time before each image.",
        usual="rvt, ev-segnet: 50ms; voxel and the like of 'adv2e batch': from image to image",
        kind="time",
    ),
]


Bins = Annotated[
    "int | None",
    Option(
        help="Bins of time of voxel, histogram and rvt.",
        usual="5; of histogram and rvt 10",
        kind="count",
        most=10_000,
    ),
]

Cutoff = Annotated[
    int,
    Option(help="Largest count of histogram and rvt.", default=10, kind="count", most=255),
]

Valid = Annotated[
    float,
    Option(
        help="Share that is held out, for validation or test: of the recordings, each by its name;"
        " of the images for e2vid of one recording.",
        default=0.2,
        kind="share",
    ),
]


class WindowOptions(TypedDict, total=False):
    """Options of an export of something for each window."""

    window_us: WindowUs
    count: Annotated["int | None", Option(help="Cut into windows of N events.", kind="count")]
    at: Annotated["str | None", Option(help="Cut where the images are.", choices=("images",))]
    most_empty: Annotated[
        int,
        Option(
            help="Most windows of TIME in a row without an event: one wrong time would make far too"
            " many.",
            default=MOST_EMPTY,
            flags=("--max-empty",),
            kind="count",
        ),
    ]
    valid: Valid


class VoxelOptions(WindowOptions, total=False):
    """Options of an export of voxel grids."""

    bins: Bins
    normalise: Annotated[
        str,
        Option(
            help="e2vid: mean 0 and deviation 1 over the cells that are not zero."
            " event_cnn_minimal: its RobustNorm, 0th to 95th percentile.",
            default="none",
            choices=("none", "e2vid", "event_cnn_minimal"),
        ),
    ]
    polarity: Annotated[
        str,
        Option(
            help="signed: ON counts +1, OFF -1. split: the bins of ON, then those of OFF.",
            default="signed",
            choices=("signed", "split"),
        ),
    ]
    span: Annotated[
        str,
        Option(
            help="The bins reach from the first to the last event, as in E2VID, or over the whole"
            " window.",
            default="events",
            choices=("events", "window"),
        ),
    ]


class SegmentationOptions(TypedDict, total=False):
    """Options of an export for Ev-SegNet."""

    window_us: WindowUs
    split: Annotated[
        str,
        Option(
            help="Part of the data set of Ev-SegNet.",
            default="train",
            choices=("train", "test", "other"),
        ),
    ]
    rows: Annotated[
        "int | None",
        Option(
            help="Keep the upper N rows.",
            usual="200 of 346x260 pixels, as DDD17 was cut; else all",
            kind="count",
        ),
    ]
    counts: Annotated[
        str,
        Option(
            help="Counts of Ev-SegNet: scaled to -1...1, or as counted.",
            default="scaled",
            choices=("scaled", "raw"),
        ),
    ]


class HistogramOptions(WindowOptions, total=False):
    """Options of an export of stacked histograms."""

    bins: Bins
    cutoff: Cutoff


class SurfaceOptions(WindowOptions, total=False):
    """Options of an export of time surfaces."""

    tau_us: Annotated[
        "int | None",
        Option(
            help="Time in which a time surface falls to 1/e, such as 30ms.",
            usual="50ms",
            kind="time",
        ),
    ]


class PictureOptions(WindowOptions, total=False):
    """Options of an export of pictures of events."""

    style: Annotated[str, _STYLE]


class RvtOptions(TypedDict, total=False):
    """Options of an export for RVT."""

    window_us: WindowUs
    bins: Bins
    cutoff: Cutoff
    valid: Valid


class SetOptions(TypedDict, total=False):
    """Options of an export of a training set without others of its own."""

    valid: Valid


class TrainingOptions(SetOptions, total=False):
    """Options of an export of a training set for E2VID."""

    flow: Annotated[
        "str | None",
        Option(
            help="Optical flow for e2vid. estimated: found from image to image.",
            usual="that beside the events, if there is any",
            choices=("none", "estimated"),
        ),
    ]


EXPORTS = {
    "voxel": VoxelOptions,
    "histogram": HistogramOptions,
    "surface": SurfaceOptions,
    "picture": PictureOptions,
    "ev-segnet": SegmentationOptions,
    "e2vid": TrainingOptions,
    "evreal": SetOptions,
    "rvt": RvtOptions,
    "dsec": SetOptions,
    "spikingjelly": SetOptions,
    "nmnist": SetOptions,
}
"""Options of each kind of export, by its name."""


class ExportOptions(EventInput, SideInput, Run, total=False):
    """Options of any export; those of its kind are in :data:`EXPORTS`."""

    overwrite: Overwrite


LAYOUTS = ("auto", "gopro", "ddd17", "davis240c", "images", "videos")
"""Trees of sequences that a batch knows."""


class BatchOptions(
    AnyFrames, Part, Clock, MotionOptions, Content, Blurred, Strictness, Run, total=False
):
    """Options of a batch."""

    layout: Annotated[str, Option(help="Which sequences count.", default="auto", choices=LAYOUTS)]
    format: Annotated[
        str,
        Option(help="Format of the files.", default="h5", metavar="NAME", completes="formats"),
    ]
    export: Annotated[
        "str | None",
        Option(
            help="Make a training set of the events of each sequence, too, as 'adv2e export' does."
            " Stores the frames where it needs them.",
            choices=tuple(EXPORTS),
        ),
    ]
    no_events: Annotated[
        bool,
        _flag(
            help="Keep no events: --export makes voxel grids, histograms, surfaces or pictures"
            " while it simulates."
        ),
    ]
    window_us: WindowUs
    bins: Bins
    side: Annotated[
        "str | None",
        Option(
            help="none: carry no poses, IMU, calibration, boxes, masks, depth and flow along.",
            usual="those of each sequence, as 'adv2e convert' finds them",
            choices=("none",),
        ),
    ]
    recipe: Annotated[
        "str | Path | None",
        Option(
            help="Make a set again by the recipe.json of its batch, and verify it.",
            kind="path",
            completes="files",
        ),
    ]
    jobs: Annotated[
        "int | None",
        Option(help="Convert N sequences at a time.", usual="one for each thread", kind="count"),
    ]
    shard: Annotated[
        "str | None",
        Option(help="Do only the I-th of N parts of about the same size.", metavar="I/N"),
    ]
    scheduler: Annotated[
        "str | None",
        Option(
            help="Convert on the workers of this Dask scheduler, such as tcp://node1:8786 or the"
            " file that it wrote. --jobs N bounds how many at a time; each has --threads, 1 by"
            " default.",
            metavar="ADDRESS",
        ),
    ]
    overwrite: Overwrite


def declared(*groups: Any) -> dict[str, Option]:
    """Return the options of groups, by name, in the order of their declaration."""
    return {name: hint.__metadata__[0] for name, hint in _hints(groups).items()}


def _hints(groups: Iterable[Any]) -> dict[str, Any]:
    return {name: hint for group in groups for name, hint in group.__annotations__.items()}


def size_of(options: AnyInput) -> Size | None:
    """Return the size of the sensor that options say, if they do."""
    return None if (size := options["size"]) is None else parse_size(size)


def crop_of(options: Part) -> Rectangle | None:
    """Return the part of the sensor that options say, if they do."""
    return None if (crop := options["crop"]) is None else parse_rectangle(crop)


def chosen(group: type[Options], options: Mapping[str, Any]) -> Options:
    """Return those of the options that belong to a group."""
    known = declared(group)
    found: Any = {name: value for name, value in options.items() if name in known}
    return found  # type: ignore[no-any-return]


def check_together(options: Mapping[str, Any]) -> None:
    """Raise UsageError if options contradict one another."""
    start_s, stop_s = options.get("start_s"), options.get("stop_s")
    if start_s is not None and stop_s is not None and stop_s <= start_s:
        raise UsageError(f"--stop {stop_s:g} must be after --start {start_s:g}")
    of_frames = "allow_damaged" in options  # and not of a film that is made
    if of_frames and options["fps"] is not None:
        if options.get("timestamps") is not None:
            raise UsageError("--fps and --timestamps both give the times of the frames: keep one")
        if options.get("time_unit") is not None:
            raise UsageError("--time-unit is for lists of times, which --fps replaces: keep one")
    sizes = options.get("extent_px"), options.get("duration_s")
    if options.get("motion") is None and sizes != (None, None):
        raise UsageError("--extent and --duration are of the path that --motion makes")


def takes(*groups: Any) -> Callable[[Function], Function]:
    """Return a decorator of functions that take the options of groups as ``**options``."""
    known = declared(*groups)
    defaults = {name: option.default for name, option in known.items()}

    def decorate(function: Function) -> Function:
        code = inspect.unwrap(function).__code__
        named = code.co_varnames[: code.co_argcount + code.co_kwonlyargcount]

        @functools.wraps(function)
        def call(*arguments: Any, **given: Any) -> Any:
            for name, value in given.items():
                if name in known:
                    given[name] = known[name].checked(name, value)
                elif name not in named:
                    raise TypeError(_unknown(function.__name__, name, known))
            given = {**defaults, **given}
            check_together(given)
            return function(*arguments, **given)

        made: Any = call
        made.option_groups = groups
        made.names = {option.flag_of(name).strip("-"): name for name, option in known.items()}
        return made  # type: ignore[no-any-return]

    return decorate


def _unknown(function: str, name: str, known: Iterable[str]) -> str:
    """Return the message for an argument that a function does not know."""
    near = difflib.get_close_matches(name, known, 1)
    hint = f"; did you mean {near[0]!r}?" if near else ""
    return f"{function}() got an unexpected keyword argument {name!r}{hint}"


def show_options(function: Function) -> Function:
    """Give a function the signature and the documentation of the options that it takes, if any."""
    groups = getattr(function, "option_groups", ())
    if not groups:
        return function
    signature = inspect.signature(function)
    own = [one for one in signature.parameters.values() if one.kind is not one.VAR_KEYWORD]
    added = [
        inspect.Parameter(
            name,
            inspect.Parameter.KEYWORD_ONLY,
            default=hint.__metadata__[0].default,
            annotation=_annotation(hint),
        )
        for name, hint in _hints(groups).items()
    ]
    shown: Any = function
    shown.__signature__ = signature.replace(parameters=[*own, *added])
    shown.__doc__ = _documented(function.__doc__ or "", groups)
    return function


def _annotation(hint: Any) -> str:
    """Return the type of an option as it is written."""
    (kind,) = get_args(hint)[:1]
    return kind.__forward_arg__ if isinstance(kind, ForwardRef) else kind.__name__


def _documented(text: str, groups: Iterable[Any]) -> str:
    """Return a docstring with the options in the place of its entry ``**options``."""
    from adv2e.in_python import in_python  # noqa: PLC0415

    lines = []
    for name, hint in _hints(groups).items():
        option: Option = hint.__metadata__[0]
        values = ", ".join(map(repr, option.choices))
        kind = f"{{{values}}}" if values else _annotation(hint).removesuffix(" | None")
        optional = ", optional" if option.default is None else ""
        usual = f"  Default: {option.usual}." if option.usual else ""
        lines += [f"    {name} : {kind}{optional}", *_wrapped(in_python(option.help) + usual)]
    return _ENTRY.sub(lambda found: "\n".join(lines) + "\n", text, count=1)


_wrapped = textwrap.TextWrapper(100, initial_indent=" " * 8, subsequent_indent=" " * 8).wrap


_ENTRY = re.compile(r"^    \*\*options\b.*\n(?:        .*\n)*", re.MULTILINE)
