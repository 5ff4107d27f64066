"""One conversion: source -> light -> events -> sink, with a summary at the end."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from adv2e import __version__, jit
from adv2e.config import Config, to_dict
from adv2e.effects.frames.encoding import LightDecoder
from adv2e.events import Events
from adv2e.rendering import Preview
from adv2e.simulation import events_from_light
from adv2e.sinks import format_name, open_sink
from adv2e.sources import open_source
from adv2e.sources.base import Source


@dataclass(frozen=True)
class Summary:
    """What a conversion did."""

    output: str
    width: int
    height: int
    frames: int
    duration_s: float
    events: int
    on: int
    seconds: float

    def text(self) -> str:
        """Return the summary as two lines for people."""
        share = f"{100 * self.on / self.events:.1f} % ON" if self.events else "no events"
        rate = self.events / self.duration_s / (self.width * self.height)
        return (
            f"{self.output}: {self.events:,} events ({share}) of {self.width}x{self.height} pixels"
            f" over {self.duration_s:.3f} s\n"
            f"{rate:.2f} events a pixel a second; {self.frames} frames in {self.seconds:.1f} s"
        )


class _Counter:
    """Counts frames and events as they pass."""

    def __init__(self) -> None:
        self.frames = 0
        self.first_ns = 0
        self.last_ns = 0
        self.events = 0
        self.on = 0

    def frame(self, t_ns: int) -> None:
        if not self.frames:
            self.first_ns = t_ns
        self.frames += 1
        self.last_ns = t_ns

    def add(self, events: Events) -> None:
        self.events += events.size
        self.on += int(np.count_nonzero(events["p"]))


def default_output(source: str) -> str:
    """Return ``<stem>.events.h5`` in the current folder."""
    path = Path(source)
    name = path.resolve().name if path.name in ("", ".", "..") else path.name
    return f"{name if path.is_dir() else Path(name).stem}.events.h5"


def convert(
    source: str,
    output: str | None,
    *,
    config: Config,
    fps: float | None = None,
    timestamps: str | Path | None = None,
    start_s: float | None = None,
    stop_s: float | None = None,
    t0: str = "auto",
    format: str | None = None,
    layout: str | None = None,
    with_frames: bool = False,
    overwrite: bool = False,
    preview: str | None = None,
    threads: int | None = None,
    progress: bool = False,
    log: Callable[[str], None] = lambda text: None,
) -> Summary:
    """Convert one video, image sequence or recording to events.

    Parameters
    ----------
    source, output : str
        Input; output path ("-": text to stdout; None: see :func:`default_output`).
    config : Config
    fps, timestamps, start_s, stop_s, t0
        See :func:`adv2e.sources.open_source`.
    format, layout, with_frames, overwrite
        See :func:`adv2e.sinks.open_sink`; DAVIS240C folders and zips always hold the frames.
    preview : str, optional
        Picture or film of the events to write beside.
    threads : int, optional
        Default: all cores.
    progress : bool
        Show a progress bar on stderr.
    log : callable
        Takes lines for people.

    Raises
    ------
    Adv2eError
        For anything wrong with input or output; then no output file is left.
    """
    began = time.perf_counter()
    recording = open_source(
        source,
        fps=fps,
        timestamps=Path(timestamps) if timestamps else None,
        start_s=start_s,
        stop_s=stop_s,
        t0=t0,
    )
    target = output or default_output(source)
    counter = _Counter()
    with ExitStack() as stack:
        sink = stack.enter_context(
            open_sink(
                target if target == "-" else Path(target),
                width=recording.width,
                height=recording.height,
                format=format,
                layout=layout,
                metadata=_metadata(config, recording),
                overwrite=overwrite,
                with_frames=with_frames or _holds_frames(target, format),
                threads=threads,
            )
        )
        view = _open_preview(preview, recording, overwrite, stack)
        frames = _watched(recording, config, counter, sink, view, progress)
        if not jit.is_cached("run_tile"):
            log("compiling the pixel's kernel (once; about half a minute)")
        for events in events_from_light(frames, config, threads=threads):
            counter.add(events)
            sink.write_events(events)
            if view is not None:
                view.add_events(events)
    for note in recording.notes:  # at the end: an error is to be the only line
        log(note)
    return Summary(
        output=target,
        width=recording.width,
        height=recording.height,
        frames=counter.frames,
        duration_s=(counter.last_ns - counter.first_ns) * 1e-9,
        events=counter.events,
        on=counter.on,
        seconds=time.perf_counter() - began,
    )


def _holds_frames(target: str, format: str | None) -> bool:
    """Tell whether the output is a whole DAVIS240C recording, to which the frames belong."""
    return target != "-" and format_name(Path(target), format) in ("folder", "zip")


def _metadata(config: Config, recording: Source) -> dict[str, Any]:
    """Return what makes the file again, apart from the input itself."""
    return {
        "adv2e": __version__,
        "config": to_dict(config),
        "seed": config.seed,
        "source": {
            "name": Path(recording.path).name,
            "kind": recording.kind,
            "encoding": _encoding(recording, config),
            "full_scale": _full_scale(recording, config),
        },
    }


def _encoding(recording: Source, config: Config) -> str:
    chosen = config.frames.encoding
    return recording.encoding if chosen == "auto" else chosen


def _full_scale(recording: Source, config: Config) -> float:
    return config.frames.full_scale or recording.full_scale


def _open_preview(preview: str | None, recording: Source, overwrite: bool, stack: ExitStack) -> Any:
    if preview is None:
        return None
    return stack.enter_context(
        Preview(Path(preview), recording.width, recording.height, overwrite=overwrite)
    )


def _watched(
    recording: Source, config: Config, counter: _Counter, sink: Any, view: Any, progress: bool
) -> Iterator[tuple[int, NDArray[Any]]]:
    """Yield (t_ns, light) of the source; count, store and show each frame on the way."""
    decoder = LightDecoder(
        _encoding(recording, config),
        _full_scale(recording, config),
        recording.dtype,
        recording.colour,
    )
    frames = tqdm(
        recording.frames(), total=recording.count, unit="frame", disable=not progress, leave=False
    )
    for frame in frames:
        counter.frame(frame.t_ns)
        if sink.wants_frames or view is not None:
            image = _viewable(frame.image, _full_scale(recording, config))
            if sink.wants_frames:
                sink.write_frame(frame.t_ns, image)
            if view is not None:
                view.add_frame(frame.t_ns, image)
        yield frame.t_ns, decoder.decode(frame.image)


def _viewable(image: NDArray[Any], full_scale: float) -> NDArray[Any]:
    """Return the frame as 8 or 16 bit, for storing beside the events."""
    if image.dtype in (np.uint8, np.uint16):
        return image
    scaled = np.clip(np.rint(image * (65535.0 / full_scale)), 0, 65535)
    return scaled.astype(np.uint16)
