"""The demonstration: a sample clip, its events, a picture and a film, and a sample recording."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from adv2e import __version__
from adv2e.config import load_config
from adv2e.conversion.pipeline import Summary, convert_reading
from adv2e.conversion.reading import Reading
from adv2e.conversion.simulation import simulate
from adv2e.errors import OutputError
from adv2e.files.regular import shown
from adv2e.files.staging import Staging
from adv2e.formats.reading import read_events
from adv2e.formats.writing import open_sink
from adv2e.rendering.recording import render_recording
from adv2e.rendering.styles import Style
from adv2e.rendering.timeline import caption
from adv2e.synthetic import Scene
from adv2e.synthetic.scene import RAMP_S, frame_times, write_video

if TYPE_CHECKING:
    from adv2e.config import Config

WIDTH, HEIGHT, FPS, DURATION_S = 346, 260, 30.0, 2.0
"""The sample clip: size of a DAVIS346, frames a second, length [s]."""

INSTANTS_S = (0.20, 0.45, 0.90, 1.20, 1.50, 1.90)
"""Instants of the picture: in motion, but for the third and the last."""

WINDOW_US = 10_000
"""Length of the event window shown at each instant [us]."""

_RESTS = 1e-6  # speed below which the scene rests

RECORDING_SIZE, RECORDING_FPS, RECORDING_S = (32, 24), 500.0, 0.6
"""The sample recording: width and height, frames a second, length [s]."""

DECLARED = """\
# What is known of the camera that made recording.zip. One of these numbers is wrong.
sampling: {L: 1}                       # frames come so fast that none are made between them
pixel:
  thresholds: {"on": 0.2, "off": 0.2}  # [ln]
  refractory: {period_us: 500}         # dead time after an event
"""

UNDECLARED = "pixel.refractory.period_us=4000"
"""True refractory period of the camera of the sample recording, as a key."""

_RECORDING_SEED = 12  # another chip, and other noise, than a simulation of the declared model has


@dataclass(frozen=True)
class Demo:
    """Files of the demonstration, and the summary of its conversion."""

    clip: Path
    events: Path
    picture: Path
    film: Path
    recording: Path
    declared: Path
    summary: Summary

    def text(self) -> str:
        """Return the summary for people."""
        done = self.summary
        share = f"{100 * done.on / done.events:.1f} % of them ON" if done.events else "none"
        rate = done.events / done.duration_s
        pixels = done.width * done.height
        return "\n".join(
            (
                f"clip     {shown(self.clip)}",
                f"         {done.frames} frames of {WIDTH}x{HEIGHT} at {FPS:g} a second;"
                " the scene moves, rests, moves and rests",
                f"events   {shown(self.events)}",
                f"         {done.events:,} events, {share}; {rate / 1e6:.2f} million a second,"
                f" {rate / pixels:.1f} a pixel a second",
                f"         made in {done.seconds:.1f} s",
                f"picture  {shown(self.picture)}",
                "         frames and, at their right, events: ON red, OFF blue",
                f"film     {shown(self.film)}",
                f"sample   {shown(self.recording)}",
                "         a recording to diagnose: one number in"
                f" {shown(self.declared.name)} is wrong",
                "",
                "Look at the picture first. Then convert a video of yours, and find that number:",
                "  adv2e convert VIDEO --preview events.mp4",
                f"  adv2e diagnose {shown(self.recording)} -c {shown(self.declared)} -o found",
            )
        )


def run_demo(
    folder: Path,
    config: Config,
    *,
    overwrite: bool = False,
    threads: int | None = None,
    progress: bool = False,
    log: Callable[[str], None] = lambda text: None,
) -> Demo:
    """Make clip, events, picture, film and a sample recording in `folder`.

    Raises
    ------
    OutputError
        `folder` cannot be made or written to, or holds one of them and `overwrite` is false.
    """
    if folder.exists() and not folder.is_dir():
        raise OutputError(f"{folder}: is not a folder")
    clip, events = folder / "clip.avi", folder / "clip.events.h5"
    picture, film = folder / "clip.events.png", folder / "clip.events.mp4"
    staging = Staging(overwrite)
    sample, declared = folder / "recording.zip", folder / "declared.yaml"
    for output in (clip, events, picture, film, sample, declared):
        staging.file(output)  # checks, before any work, that it may be written
    scene = Scene()
    size = {"width": WIDTH, "height": HEIGHT}
    write_video(scene, clip, **size, fps=FPS, duration_s=DURATION_S, overwrite=overwrite)
    with Reading(str(clip), threads=threads) as reading:
        summary = convert_reading(
            reading,
            str(events),
            config=config,
            with_frames=True,
            overwrite=overwrite,
            preview=str(film),
            progress=progress,
            log=log,
        )

    def describe(since_us: int, count: int) -> str:
        doing = "at rest" if scene.speed(since_us * 1e-6) < _RESTS else "moving"
        return f"{caption(since_us, count)} in {WINDOW_US // 1000} ms, {doing}"

    recording = read_events(events)
    render_recording(
        recording,
        picture,
        style=Style(window_us=WINDOW_US),
        at_s=INSTANTS_S,
        caption=describe,
        overwrite=overwrite,
    )
    _record(sample, declared, overwrite)
    return Demo(clip, events, picture, film, sample, declared, summary)


def _record(sample: Path, declared: Path, overwrite: bool) -> None:
    """Write a recording of a fast scene, by a camera that is not quite as declared."""
    (width, height), scene = RECORDING_SIZE, Scene(speed=1.5)
    times = frame_times(RECORDING_FPS, RECORDING_S)
    frames = [
        np.rint(scene.light(RAMP_S / 2 + t_s, width, height) * 257).astype(np.uint16)
        for t_s in times
    ]
    with Staging(overwrite) as staging:
        text = staging.file(declared)
        known = "sampling.L=1", "frames.encoding=linear", UNDECLARED
        config = load_config([], known, _RECORDING_SEED)
        with open_sink(
            sample,
            width=width,
            height=height,
            metadata={"adv2e": __version__},
            with_frames=True,
            staging=staging,
        ) as sink:
            text.write_text(DECLARED, "utf-8")
            for t_s, frame in zip(times, frames, strict=True):
                sink.write_frame(round(t_s * 1e9), frame)
            for chunk in simulate(frames, times, config):
                sink.write_events(chunk)
