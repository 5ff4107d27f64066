"""Simulators under one interface: each turns a clip of light into events.

Configurations of adv2e, also such with the parameters of another tool; EventCV and v2e, the tools
themselves; any other by the events that it wrote; and :mod:`experiments.voltmeter`.
"""

from __future__ import annotations

import hashlib
import importlib.util
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, wraps
from importlib import metadata
from pathlib import Path
from typing import Any
from unittest.mock import patch

import click
import numpy as np
from benchmarks.worker import TOOLS
from numpy.typing import NDArray
from writing import one_line_errors, table, threads_option

from adv2e.comparison.resimulation import resimulator
from adv2e.config import Config, load_config
from adv2e.config.model import Sampling
from adv2e.effects.frames.encoding import encode_light
from adv2e.effects.pixel.thresholds import FLOOR
from adv2e.errors import ConfigError, DataError, MissingExtraError
from adv2e.events import Events, make_events, sort_events
from adv2e.formats.reading import open_events, read_events
from adv2e.geometry import Size
from adv2e.light.interpolation import Upsampler, make_upsampler
from adv2e.light.interpolation.linear import NOTHING, Beside
from adv2e.sources import Frame
from experiments.clip import Clip, Simulator
from experiments.voltmeter import Voltmeter

OWN = "a configuration of adv2e"
OF_A_TOOL = "its parameters in the pixel of adv2e, not the tool"


@dataclass(frozen=True)
class Pixel:
    """The pixel of adv2e; seed and sensor of its configuration do not count."""

    name: str
    nature: str
    config: Config
    threads: int | None = None

    def events(self, clip: Clip, seed: int) -> Events:
        """Return the events of a clip."""

        def frames() -> Iterator[Frame]:
            for t_ns, image in zip(clip.times_ns.tolist(), clip.frames, strict=True):
                yield Frame(image, white=255.0, t_ns=t_ns)

        # the clip is on the sensor already, whatever camera the configuration is of
        config = replace(self.config, sensor=None)
        with patch("adv2e.light.intervals.make_upsampler", _remembering):
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

    def interpolating(self, interpolation: str) -> Pixel:
        """Return it with ``linear``, ``flow``, or the network in an ONNX file between frames."""
        sampling = self.config.sampling
        if interpolation in ("linear", "flow"):
            sampling = replace(sampling, interpolation=interpolation, model=None)
        else:
            sampling = replace(sampling, interpolation="onnx", model=interpolation)
        name = f"{self.name} {Path(interpolation).stem}"
        return replace(self, name=name, config=replace(self.config, sampling=sampling))


def interpolated(simulators: Sequence[Simulator], interpolations: Sequence[str]) -> list[Simulator]:
    """Return the simulators, each pixel of adv2e once with each of the interpolations."""
    found: list[Simulator] = []
    for one in simulators:
        found += map(one.interpolating, interpolations) if isinstance(one, Pixel) else [one]
    return found


@dataclass(frozen=True)
class _Remembered:
    """An upsampler whose frames are kept: thresholds are sought on the same frames many times."""

    upsampler: Upsampler
    asked: str
    kept: dict[bytes, list[NDArray[Any]]]

    def count(self, a: NDArray[Any], b: NDArray[Any], beside: Beside = NOTHING) -> int:
        return self.upsampler.count(a, b, beside)

    def between(
        self, a: NDArray[Any], b: NDArray[Any], beside: Beside = NOTHING
    ) -> Iterator[NDArray[Any]]:
        key = hashlib.sha256(self.asked.encode())
        for one in (a, b, beside.before, beside.after):
            key.update(b"" if one is None else np.ascontiguousarray(one).data)
            key.update(str(None if one is None else (one.shape, one.dtype)).encode())
        key.update(f"{beside.span_before} {beside.span_after}".encode())
        if key.digest() not in self.kept:
            while sum(len(made) for made in self.kept.values()) * a.nbytes > _KEPT_BYTES:
                self.kept.pop(next(iter(self.kept)))
            self.kept[key.digest()] = list(self.upsampler.between(a, b, beside))
        return iter(self.kept[key.digest()])


_KEPT_BYTES = 3 << 30
_kept: dict[bytes, list[NDArray[Any]]] = {}


def _remembering(sampling: Sampling, **options: Any) -> Upsampler:
    """Return what :func:`make_upsampler` does, with its frames remembered."""
    return _Remembered(make_upsampler(sampling, **options), repr(sampling), _kept)


QUIET = {"leak_rate_hz": 0.0, "shot_noise_rate_hz": 0.0}
THRESHOLDS = {"pos_thres": 0.2, "neg_thres": 0.2}
"""Defaults of EventCV and v2e [ln]."""


class _Tool:
    """A tool of another project, which has its thresholds among its arguments."""

    arguments: dict[str, Any]

    @property
    def levels(self) -> tuple[float, float]:
        """Its thresholds of ON and OFF [ln]."""
        held = {**THRESHOLDS, **self.arguments}
        return held["pos_thres"], held["neg_thres"]

    def with_levels(self, on: float, off: float) -> Any:
        """Return it with other thresholds [ln]."""
        return replace(self, arguments={**self.arguments, "pos_thres": on, "neg_thres": off})


@dataclass(frozen=True)
class EventCV(_Tool):
    """EventCV, with arguments of ``eventcv.simulate``, and so many even steps of an interval."""

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


V2E_DEFAULTS = {
    **THRESHOLDS, "sigma_thres": 0.03, "cutoff_hz": 300.0, "leak_rate_hz": 0.01,
    "shot_noise_rate_hz": 0.001, "refractory_period_s": 0.0005,
}  # fmt: skip
"""Of its command line; those of its class differ."""


@dataclass(frozen=True)
class V2e(_Tool):
    """v2e out of a folder with ``v2ecore/``, with arguments of its ``EventEmulator``."""

    folder: Path
    arguments: dict[str, float] = field(default_factory=lambda: dict(V2E_DEFAULTS))
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


FIRST_FRAME = "start"
"""In place of a number of seconds: that of the clip's first frame."""


@dataclass(frozen=True)
class ByFile:
    """Events that are there already.

    Their times are made later by `added` [s]; None: by the time of the clip's first frame.
    """

    name: str
    path: Path
    added: float | None = 0.0

    @property
    def nature(self) -> str:
        """Where they come from."""
        return f"events that it wrote, {self.path.name}"

    @cached_property
    def _held(self) -> tuple[Events, tuple[int, int], bool]:
        """Events, their size, and whether the file states it."""
        recording = read_events(self.path)
        stated = open_events(self.path).facts.geometry is not None
        return recording.events, (recording.width, recording.height), stated

    def events(self, clip: Clip, seed: int) -> Events:
        """Return the events of a clip."""
        events, size, stated = self._held
        if size != clip.size if stated else size[0] > clip.size[0] or size[1] > clip.size[1]:
            raise DataError(
                f"{self.path}: events of {Size(*size)} pixels, but frames of {Size(*clip.size)}"
            )
        first, last = (int(t) // 1000 for t in clip.times_ns[[0, -1]])
        events = events.copy()
        events["t"] += first if self.added is None else round(1e6 * self.added)
        if not ((events["t"] >= first) & (events["t"] <= last)).any():
            raise DataError(
                f"{self.path}: no event between the first and last frame, {first / 1e6:g} to"
                f" {last / 1e6:g} s; {self.name}={self.path}@{FIRST_FRAME} is for times that begin"
                " with the first frame, and @SECONDS adds so many"
            )
        return events

    @property
    def levels(self) -> None:
        """None: it cannot be simulated anew."""
        return None

    def with_levels(self, on: float, off: float) -> ByFile:
        """Return it as it is."""
        return self


NAMES = "ideal,adv2e,paper,v2e,vid2e,dvs-voltmeter,eventcv,eventcv-quiet"
_OF_TOOLS = ("v2e", "vid2e")
"""Configurations with another tool's parameters."""


def named(
    names: Sequence[str],
    files: Sequence[ByFile] = (),
    *,
    sets: Sequence[str] = (),
    v2e_sources: Path | None = None,
    threads: int | None = None,
) -> list[Simulator]:
    """Return simulators in this order, those by file last.

    Names are ``dvs-voltmeter``, ``eventcv``, ``eventcv-quiet``, or what :func:`adv2e.load_config`
    takes; `sets` are for all of these.  With `v2e_sources`, ``v2e`` is the tool itself.
    """
    asked = [Path(name).stem for name in names] + [one.name for one in files]
    for name in asked:
        if asked.count(name) > 1:
            raise ConfigError(f"{name}: is asked for twice; give each simulator a name of its own")

    def one(name: str) -> Simulator:
        if name == "v2e" and v2e_sources is not None:
            return V2e(v2e_sources)
        if name in _OTHERS:
            return _OTHERS[name]()
        nature = OF_A_TOOL if name in _OF_TOOLS else OWN
        return Pixel(Path(name).stem, nature, load_config([name], sets), threads)

    return [*map(one, names), *files]


_OTHERS: dict[str, Callable[[], Simulator]] = {
    "dvs-voltmeter": Voltmeter,
    "eventcv": EventCV,
    "eventcv-quiet": lambda: EventCV("eventcv-quiet", dict(QUIET)),
}


def natures(simulators: Sequence[Simulator]) -> str:
    """Return what each is, as a table."""
    rows = [[one.name, one.nature] for one in simulators]
    return table(["simulator", "what it is"], rows).replace("---:", "---")


class EventsOf(click.ParamType):
    """``NAME=FILE``, ``NAME=FILE@SECONDS`` or ``NAME=FILE@start``."""

    name = "NAME=FILE"

    def convert(
        self, value: object, param: click.Parameter | None, ctx: click.Context | None
    ) -> ByFile:
        """Return the simulator."""
        if isinstance(value, ByFile):
            return value
        name, _, path = str(value).partition("=")
        if not name or not path:
            self.fail(f"{value!r}: must be NAME=FILE, such as v2ce=events.npz", param, ctx)
        file, at, clock = path.rpartition("@")
        if not at:
            return ByFile(name, Path(path))
        if clock == FIRST_FRAME:
            return ByFile(name, Path(file), None)
        try:
            return ByFile(name, Path(file), float(clock))
        except ValueError:  # a name with @ in it
            return ByFile(name, Path(path))


sources_option = click.option(
    "--v2e-sources", type=click.Path(file_okay=False, path_type=Path), metavar="FOLDER",
    help="A clone of github.com/SensorsINI/v2e: v2e is the tool itself then. Needs PyTorch.",
)  # fmt: skip
sets_option = click.option(
    "--set", "sets", multiple=True, metavar="KEY=VALUE",
    help="For all configurations of adv2e. Repeatable.",
)  # fmt: skip


def simulator_options(command: Callable[..., None]) -> Callable[..., None]:
    """Add options that choose simulators; the command is given them as `simulators`."""

    @click.option(
        "--simulators", "names", default=NAMES, show_default=True,
        help="Also other shipped names and YAML files.",
    )  # fmt: skip
    @click.option(
        "--events", "files", type=EventsOf(), multiple=True, metavar="NAME=FILE",
        help="Events that another simulator wrote, on the recording's clock; with @start after"
        " FILE they begin with the first frame, @SECONDS adds so many. Repeatable.",
    )  # fmt: skip
    @sources_option
    @sets_option
    @threads_option
    @wraps(command)
    def made(
        names: str, files: tuple[ByFile, ...], v2e_sources: Path | None,
        sets: tuple[str, ...], threads: int | None, **rest: Any,
    ) -> None:  # fmt: skip
        with one_line_errors():
            simulators = named(
                [name for name in names.split(",") if name], files,
                sets=sets, v2e_sources=v2e_sources, threads=threads,
            )  # fmt: skip
            command(simulators=simulators, **rest)

    return made
