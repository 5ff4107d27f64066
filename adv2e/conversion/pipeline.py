"""One conversion: source -> light -> events -> sink, with a summary and versions at the end.

With more than one thread, frames are read and decoded in a thread ahead of the pixel and events
written in another behind it; those two are seldom busy and come on top of the threads that compute.
With one thread, that one does everything.
"""

from __future__ import annotations

import math
import platform
import time
import zlib
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager, ExitStack
from dataclasses import asdict, dataclass, replace
from functools import partial
from importlib.metadata import PackageNotFoundError, version
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from adv2e import __version__
from adv2e.background import OrderedWork
from adv2e.causes import CAUSES
from adv2e.config import Config, to_dict
from adv2e.config.active_effects import active_hooks, user_sources
from adv2e.conversion.reading import Decoded, Decoding, Reading
from adv2e.conversion.simulation import events_from_light, warm
from adv2e.effects.frames.brightness import check_white
from adv2e.effects.frames.encoding import LightDecoder
from adv2e.effects.hooks import Frames
from adv2e.errors import DataError, UsageError
from adv2e.events import Events
from adv2e.files.regular import shown
from adv2e.files.staging import Staging, nearest_there, writing
from adv2e.files.states import digest_of_values
from adv2e.formats.registry import check_frames, to_write
from adv2e.formats.writing import PACKAGES, SideFiles, Sink, open_sink
from adv2e.geometry import Size
from adv2e.label import ENCODING, WHITE, Label, Seen, left_out
from adv2e.light.decoding import decoder_for, kernel_table, light_line, light_text
from adv2e.light.interpolation import network_of
from adv2e.light.pictures import drawn, picture_white
from adv2e.light.sensor import fitting_of
from adv2e.options import SimulatedOutput, takes
from adv2e.process import bars
from adv2e.side.blurred import BlurredFrames
from adv2e.side.carrying import SideData, find_side
from adv2e.side.maps import Maps
from adv2e.side.placement import Clock, Placement
from adv2e.sources import STDIN
from adv2e.sources.base import LIVE, Source

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from adv2e.light.interpolation.flow import GivenFlow
    from adv2e.light.sensor import Fitting
    from adv2e.rendering.timeline import Timeline


BEHIND_BYTES = 16 << 20
"""Memory for events and frames that were made and not written yet."""

BEHIND_TASKS = 1000
"""Most pieces of events and frames that were made and not written yet."""


Opening = Callable[..., AbstractContextManager[Any]]
"""Opens an output, with the arguments of :func:`adv2e.formats.writing.open_sink`."""


@dataclass(frozen=True)
class Summary:
    """Summary of a conversion; `copied_from` is the file whose events were copied, if any."""

    output: str
    width: int
    height: int
    frames: int
    duration_s: float
    events: int
    on: int
    seconds: float
    notes: tuple[str, ...] = ()
    copied_from: str = ""

    def text(self) -> str:
        """Return the summary as two lines for people."""
        share = f"{100 * self.on / self.events:.1f} % ON" if self.events else "no events"
        if self.copied_from:
            frames = f" and {self.frames} frames" if self.frames else ""
            return (
                f"{shown(self.output)}: {self.events:,} events ({share}){frames} of"
                f" {self.width}x{self.height} pixels, over {self.duration_s:.3f} s\n"
                f"copied from {shown(self.copied_from)}, nothing was simulated; took"
                f" {self.seconds:.1f} s"
            )
        rate = self.events / self.duration_s / (self.width * self.height)
        return (
            f"{shown(self.output)}: {self.events:,} events ({share}) from {self.frames} frames, on"
            f" {self.width}x{self.height} pixels, over {self.duration_s:.3f} s\n"
            f"{rate:.2f} events a pixel a second; made in {self.seconds:.1f} s"
        )


class _Output:
    """Output of frames and events, by `work`: to the sink and the preview, if any; with counts."""

    def __init__(
        self,
        sink: Sink,
        preview: Timeline | None,
        blurred: BlurredFrames | None,
        white: float,
        work: OrderedWork,
    ) -> None:
        self._sink, self._preview, self._white, self._work = sink, preview, white, work
        self._blurred = blurred
        self.wants_frames = sink.wants_frames or preview is not None or blurred is not None
        self.frames = self.first_ns = self.last_ns = 0
        self.events = self.on = 0

    def light_of(self, frames: Iterable[Decoded]) -> Frames:
        """Yield (t_ns, light), or grey values, of each frame; its picture is written."""
        for now, picture in frames:
            self.last_ns = now[0]
            self.first_ns = self.first_ns if self.frames else self.last_ns
            self.frames += 1
            if picture is not None:
                self._work.submit(self._write_frame, self.last_ns, picture)
            del picture
            yield now
        if self._preview is not None:
            self._work.submit(self._preview.no_more_frames)

    def complete_until(self, t_us: int) -> None:
        """Tell the preview of a time [us] before which no event will come."""
        if self._preview is not None:
            self._work.submit(self._preview.complete_until, t_us)

    def add(self, events: Events) -> None:
        """Write events."""
        self.events += events.size
        for piece in _pieces(events):
            self._work.submit(self._write_events, piece)

    def _write_frame(self, t_ns: int, picture: NDArray[Any]) -> None:
        self._sink.write_frame(t_ns, picture)
        if self._blurred is not None:
            with writing("blurred frames"):
                self._blurred.add(t_ns, picture)
        if self._preview is not None:
            self._preview.add_frame(t_ns, drawn(picture, self._white))

    def _write_events(self, events: Events) -> None:
        self.on += int(np.count_nonzero(events["p"]))
        self._sink.write_events(events)
        if self._preview is not None:
            self._preview.add_events(events)


def default_output(source: str, format: str | None = None) -> str:
    """Return ``<stem>.events.h5`` in the current folder, or with the suffix of another format."""
    suffix = to_write(Path("events.h5"), format).suffixes[0]
    if source == STDIN:
        return f"stdin.events{suffix}"
    path = Path(source)
    name = path.resolve().name if path.name in ("", ".", "..") else path.name
    return f"{name if path.is_dir() else Path(name).stem}.events{suffix}"


@takes(SimulatedOutput)
def convert_reading(
    reading: Reading,
    output: str | None,
    *,
    config: Config,
    progress: bool = False,
    also_read: Iterable[str | Path] = (),
    log: Callable[[str], None] = lambda text: None,
    doubt: Callable[[str], None] | None = None,
    opening: Opening = open_sink,
    source_sha256: str | None = None,
    **options: Unpack[SimulatedOutput],
) -> Summary:
    """Convert one video, image sequence or recording to events.

    Parameters
    ----------
    reading : Reading
        Input, within its context.
    output : str, optional
        Output path ("-": text to stdout; None: see :func:`default_output`).
    config : Config
    progress : bool
        Show a progress bar on stderr.
    also_read : iterable of str or Path
        Files that `config` is made of, which must not be written over.
    log, doubt : callable
        Take lines for people; `doubt` those that ask for a look, by default `log`.
    opening : callable
        Returns what takes the events, as :func:`adv2e.formats.writing.open_sink` does.
    source_sha256 : str, optional
        SHA-256 of the source, where it is known.
    **options
        See :class:`adv2e.options.SimulatedOutput`.

    Raises
    ------
    Adv2eError
        For anything wrong with input or output; then no output file is left.
    """
    began = time.perf_counter()
    say = doubt or log
    recording, workers = reading.source, reading.threads
    exposures_us = recording.exposures_us
    if exposures_us:  # in the place of one for all
        mean_us = float(np.mean(exposures_us))
        config = replace(config, frames=replace(config.frames, exposure_us=mean_us))
    decoder, fitting = decoding_of(recording, config)
    doubt = label = Label(say, said=_said(config))
    digests = {"config": digest_of_values(to_dict(config)), "source": source_sha256}
    label.entries["sha256"] = digests
    format, layout, causes = options["format"], options["layout"], options["causes"]
    target = output or default_output(reading.path, format)
    chosen = to_write(Path(target), format, layout)
    with_frames, preview = options["with_frames"], options["preview"]
    if with_frames:
        check_frames(chosen)
    eight_bit = not chosen.is_davis240c
    with_frames = with_frames or not eight_bit
    white = picture_white(recording.dtype, decoder.full_scale, eight_bit)
    frames = Size(recording.width, recording.height)
    width, height = frames if fitting is None else fitting.size
    # events and preview come into place together, when all is written
    given = options["side"]
    inputs = (*reading.inputs, *also_read, *([] if given in (None, "none") else [given]))
    side = _side_of(recording, config, fitting, given, doubt)
    clock = partial(_clock_of, recording, config)
    flow = _given_flow(recording, config, side)
    blurred, count = None, options["blurred_frames"]
    if count is not None:
        if target == "-":
            raise UsageError(
                "--blurred-frames: standard output has no place for them: give -o FILE"
            )
        blurred = BlurredFrames(
            count, decoder.encoding, white, nearest_there(Path(target).absolute())
        )
    files = _side_files(side, blurred, clock, doubt)
    taken = light_line(recording.light, recording.full_scale, config.frames)
    told = _doubt_of_white(recording, recording.largest, config)
    label.add(taken, *recording.selection.left_out, *recording.doubts, *recording.notes)
    if options["strict"]:
        label.refuse(recording.path, told)
    with Staging(options["overwrite"], inputs) as staging, ExitStack() as stack:
        sink = stack.enter_context(
            opening(
                target,
                width=width,
                height=height,
                format=format,
                layout=layout,
                metadata={
                    **_metadata(
                        config, recording, decoder, fitting, white if with_frames else None
                    ),
                    **({"causes": CAUSES} if causes else {}),
                    "label": label.entries,
                },
                with_frames=with_frames,
                threads=workers,
                staging=staging,
                causes=causes,
                side=None if target == "-" else files,
            )
        )
        # a write to standard output may block until the reader pleases, and only the main thread
        # can be interrupted in it
        beside = workers > 1 and target != "-"
        seen = _open_preview(preview, width, height, staging, stack)
        work = stack.enter_context(OrderedWork(int(beside), limit=BEHIND_BYTES, count=BEHIND_TASKS))
        out = _Output(sink, seen, blurred, white, work)
        for text in filter(None, (*recording.doubts, told)):
            say(text)
        hooks = active_hooks(config, exposures_us=exposures_us)
        table = kernel_table(decoder, config.sampling, hooks, fitting)
        response = config.pixel.log_response
        floor = None if response.linear_below else response.floor
        if table is not None and floor is not None:  # as a value: the kernel decodes
            floor = int(np.count_nonzero(table <= floor)) - 1
        noted, fired = Seen(decoder.full_scale, recording.dtype, floor), list[int]()
        stated = config.frames.full_scale
        decoded = reading.decoded(
            Decoding(
                decoder, table is not None, out.wants_frames, stated, eight_bit, fitting, noted
            )
        )
        if progress:
            decoded = _shown(decoded, recording.count, out, stack)
        if recording.kind in LIVE:  # frames that came meanwhile would be lost
            kind = np.zeros((1, 1, 3) if recording.colour else (1, 1), recording.dtype)
            warm(config, kind, threads=workers, causes=causes)
        chunks = events_from_light(
            out.light_of(decoded),
            config,
            hooks=hooks,
            threads=workers,
            table=table,
            complete=out.complete_until,
            causes=causes,
            given=flow,
            fired=fired.append,
        )
        for events in chunks:
            out.add(events)
            del events  # or they would stay while the next ones are made
        if recording.ended_by_hand is not None:
            sink.describe(ended_by_hand_after_frames=recording.ended_by_hand)
        found = _doubt_of_white(recording, recording.largest_read, config)
        label.add(*recording.notes, found)
        if options["strict"]:  # what only all frames tell
            label.refuse(recording.path)
        if (lost := sum(fired) - out.events) > 0:
            label.add(left_out(f"{lost:,} events that the readout lost"))
        interpolation = config.sampling.interpolation if config.sampling.L > 1 else "linear"
        label.entries |= noted.label(interpolation, config.frames.exposure_us)
    # at the end: an error is to be the only line
    is_doubtful = config.frames.encoding == "auto" and recording.light.is_doubtful
    (say if is_doubtful else log)(taken)
    crop = recording.selection.crop
    if crop is not None or fitting is not None:
        part = f" at x {crop.x}, y {crop.y} of the input's" if crop is not None else ""
        log(f"frames are {frames}{part}{f', {fitting.text()}' if fitting is not None else ''}")
    if told:
        largest = f"{recording.path}: whole numbers up to {recording.largest_read:g} came"
        found = "" if found else f"{largest}: what was said of white does not hold"
    network = network_of(config.sampling)
    if network is not None:
        log(f"frames in between are made by {network.text}")
    for note in recording.notes:
        log(note)
    if exposures_us:
        log(f"exposures of {min(exposures_us):g} to {max(exposures_us):g} us are those of the list")
    if side is not None:
        log("standard output holds no side data" if target == "-" else side.told())
    if found:
        say(found)
    return Summary(
        output=target,
        width=width,
        height=height,
        frames=out.frames,
        duration_s=(out.last_ns - out.first_ns) * 1e-9,
        events=out.events,
        on=out.on,
        seconds=time.perf_counter() - began,
    )


def decoding_of(recording: Source, config: Config) -> tuple[LightDecoder, Fitting | None]:
    """Return the decoder of the frames of a source to light, and their fitting to the sensor.

    Raises
    ------
    Adv2eError
        The frames do not fit the configuration.
    """
    if recording.largest is not None and recording.dtype.kind == "f":
        check_white(recording.largest, recording.path, config.frames.full_scale)
    decoder = decoder_for(
        config.frames,
        recording.dtype,
        recording.colour,
        auto=recording.encoding,
        white=recording.full_scale,
    )
    frames = Size(recording.width, recording.height)
    return decoder, fitting_of(*frames, config.sensor, recording.path, recording.along)


def _side_of(
    recording: Source,
    config: Config,
    fitting: Fitting | None,
    given: str | Path | None,
    doubt: Callable[[str], None],
) -> SideData | None:
    """Return the side data of a source, if there are any; see :func:`find_side`."""
    if recording.along is not None:
        if given not in (None, "none"):
            raise UsageError("--side: a picture before which the sensor moves has no side data")
        return None
    place = Placement.of(recording.whole, recording.selection, fitting, config.frames.shift_px)
    return find_side(recording.path, given, place, doubt, recording.uncarried)


def _side_files(
    side: SideData | None,
    blurred: BlurredFrames | None,
    clock: Callable[[], Clock],
    doubt: Callable[[str], None],
) -> SideFiles | None:
    """Return the files that lie beside the events; None: there are none."""
    if side is None and blurred is None:
        return None
    own = side.files(clock, doubt) if side is not None else ()
    return chain(own, blurred.files(clock) if blurred is not None else ())


def _given_flow(recording: Source, config: Config, side: SideData | None) -> GivenFlow | None:
    """Return the flow that frames are moved along, by the number of the first that is simulated.

    Raises
    ------
    DataError
        It is asked for, and some of it is not there.
    """
    if config.sampling.interpolation != "given" or config.sampling.L == 1:
        return None
    kind, shots = None if side is None else side.kinds.get("flow"), recording.listed()
    if side is None or not isinstance(kind, Maps) or not shots:
        raise DataError(
            f"{recording.path}: sampling.interpolation: given needs pictures, or a stack, with flow"
            " beside them, such as flow/*.npy; or say flow, which finds it"
        )
    clock = _clock_of(recording, config)
    files = {
        first: name
        for (first, last), name in zip(kind.frames(clock).tolist(), kind.names, strict=False)
        if last == first + 1
    }
    inside = (clock.frames >= clock.begin) & (clock.frames <= clock.end)
    begin, *_, end = np.flatnonzero(inside).tolist()
    missing = next((n for n in range(begin, end) if n not in files), None)
    if missing is not None:
        raise DataError(f"{kind.label}: no flow from {shots[missing].label} to the next frame")
    return lambda number: kind.placed(files[begin + number], side.place)


def _clock_of(recording: Source, config: Config) -> Clock:
    """Return the way from the clock of a source to that of the events, once its frames are read.

    Frames that are known before are all in it at once, but for the zero of the events' clock.
    """
    shots, own, chosen = recording.listed(), recording.own_times_ns(), recording.selection
    frames = np.array([shot.t_ns for shot in shots] or recording.passed_ns, np.int64)
    begin = int(frames[0]) + chosen.start_ns
    return Clock(
        frames=frames,
        names=[shot.label for shot in shots],
        own=None if own is None else np.array(own, np.int64),
        first=int(frames[np.searchsorted(frames, begin)]),
        begin=begin if chosen.start_ns else -math.inf,
        end=frames[0] + chosen.stop_ns,
        zero=recording.origin_ns,
        offset_us=config.frames.clock_offset_us,
        drift_ppm=config.frames.clock_drift_ppm,
    )


def _said(config: Config) -> set[str]:
    """Return the keys of which a configuration says what the numbers of frames stand for."""
    stated = {ENCODING: config.frames.encoding, WHITE: config.frames.full_scale}
    return {key for key, value in stated.items() if value not in (None, "auto")}


def _doubt_of_white(recording: Source, largest: float | None, config: Config) -> str:
    return "" if config.frames.full_scale else recording.doubt_of_white(largest)


def _metadata(
    config: Config,
    recording: Source,
    decoder: LightDecoder,
    fitting: Fitting | None,
    white: float | None,
) -> dict[str, Any]:
    """Return the metadata of a file: all that reproduces it but the input, and its content.

    `white` is that of the frames stored; None where there are none.
    """
    own, network = user_sources(config), network_of(config.sampling)
    runs = network.PACKAGES if network is not None else ()
    stored = {"encoding": decoder.encoding, "full_scale": white}
    crop = recording.selection.crop
    return {
        "adv2e": __version__,
        "versions": versions((*recording.packages, *PACKAGES, *runs)),
        "config": to_dict(config),
        "seed": config.seed,
        **({"effects": own} if own else {}),
        **({"network": network.source} if network is not None else {}),
        "source": {
            "name": shown(Path(recording.path).name),
            "kind": recording.kind,
            "size": list(recording.whole),
            **({"rotate180": True} if recording.selection.rotate180 else {}),
            **({"crop": list(crop)} if crop is not None else {}),
            **({"sensor": fitting.placement()} if fitting is not None else {}),
            "encoding": decoder.encoding,
            "full_scale": decoder.full_scale,
            "light": light_text(recording.light, recording.full_scale, config.frames),
            **({"motion": asdict(recording.along)} if recording.along is not None else {}),
        },
        **({"frames": stored} if white is not None else {}),
    }


def _open_preview(
    preview: str | Path | None, width: int, height: int, staging: Staging, stack: ExitStack
) -> Timeline | None:
    if preview is None:
        return None
    from adv2e.rendering.recording import open_preview  # noqa: PLC0415 - most draw nothing

    return stack.enter_context(
        open_preview(Path(preview), width, height, frames=True, staging=staging)
    )


def _pieces(events: Events) -> Iterator[Events]:
    """Yield the events, those of a burst in copies that are given back one by one.

    Else all of them would stay until the last one is written, beside those made meanwhile.
    """
    if events.nbytes <= BEHIND_BYTES:
        yield events
        return
    size = BEHIND_BYTES // 4 // events.itemsize
    for begin in range(0, events.size, size):
        yield events[begin : begin + size].copy()


def _shown(
    frames: Iterator[Decoded], count: int | None, out: _Output, stack: ExitStack
) -> Iterator[Decoded]:
    """Return the frames, with a bar on stderr that shows how many, and how many events so far.

    The bar goes with the `stack`: a line that tells an error does not follow it.
    """
    bar = stack.enter_context(bars.bar(total=count, unit=" frames"))

    def counted() -> Iterator[Decoded]:
        for frame in frames:
            bar.set_postfix_str(f"{out.events:,} events", refresh=False)
            bar.update()
            yield frame
            del frame  # with its picture

    return counted()


# ---- Versions of what computes events, stored with them: the same bytes are promised for the
# same.


_OPENCV = (
    *("opencv-python-headless", "opencv-python"),
    *("opencv-contrib-python-headless", "opencv-contrib-python"),
)
"""Packages that bring cv2, of which any does."""


def versions(optional: Iterable[str] = ()) -> dict[str, str | None]:
    """Return the version of Python and of each package; None for what has none.

    Parameters
    ----------
    optional : iterable of str
        Optional packages that take part, by the names under which they are installed.
    """
    opencv = next((found for name in _OPENCV if (found := _version(name))), None)
    return {
        "python": platform.python_version(),
        "numpy": _version("numpy"),
        "numba": _version("numba"),
        "opencv": opencv,
        "zlib": zlib.ZLIB_RUNTIME_VERSION,
        **{name: _version(name) for name in optional},
    }


def _version(package: str) -> str | None:
    try:
        return version(package)
    except PackageNotFoundError:
        return None
