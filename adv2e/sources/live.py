"""Frames as they happen: of a camera at this computer, or from an address that sends video.

Both come through PyAV, whose devices (v4l2, avfoundation, dshow) hand on the time of each frame as
the driver states it.  What states no times gets those of this computer's clock as frames arrive.

An address is opened only where the user says so, and nothing on this computer through it: FFmpeg
may follow what a playlist names, but by protocols of the network alone.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import av

from adv2e.errors import DataError
from adv2e.process.signals import Interrupt, first_interrupt
from adv2e.sources import without_password
from adv2e.sources.base import GivenTimes, Selection, Source
from adv2e.sources.frame import Light, Shot
from adv2e.sources.times.rates import NS_PER_S, gap_doubts
from adv2e.sources.video.opening import FORMATS
from adv2e.sources.video.pictures import Converter, encoding_of

PROTOCOLS = ("http", "https", "rtmp", "rtmps", "rtp", "rtsp", "srt", "tcp", "tls", "udp", "crypto")
"""FFmpeg's protocols of the network; no other is used for an address."""

_STREAMED = (*FORMATS, "hls", "rtsp", "rtp", "sdp", "mpjpeg", "mjpeg")
_PATIENCE_S = 10.0


def device(name: str) -> tuple[str, str]:
    """Return FFmpeg's format and name of a camera, by its number or its path."""
    if sys.platform == "darwin":
        return "avfoundation", f"{name}:none"
    if sys.platform == "win32":
        films = [one for one in av.enumerate_input_devices("dshow") if "video" in one.media_types]
        return "dshow", f"video={films[int(name)].name}" if int(name) < len(films) else ""
    return "v4l2", name if name.startswith("/") else f"/dev/video{name}"


class LiveSource(Source):
    """Frames that come until they are ended; DataError if none do, or not as they should.

    The source is opened twice: what it is like is seen before all else is ready, and frames of that
    time would be followed by a gap.
    """

    def __init__(self, name: str, given: GivenTimes, selection: Selection, is_camera: bool) -> None:
        super().__init__(Path(name), "camera" if is_camera else "network", selection, False)
        self.path = without_password(name)
        self.inputs, self.packages, self.waits = [], ("av",), True
        self._name, self._rate = name, given.rate
        self._interrupt: Interrupt | None = None
        if given.timestamps or given.time_unit or selection.bayer:
            raise DataError(
                f"{self.path}: its frames have times and colours of their own: leave --timestamps,"
                " --time-unit and --bayer out"
            )
        with closing(self._container()) as container:
            first = next(self._decoded(container), None)
        if first is None:
            raise DataError(f"{self.path}: no frames came")
        label = f"{self.path}: frame 0"
        light = Light(*encoding_of(int(first.color_trc)))
        self._describe(Converter().frame(first, label), label, light)
        self._states_times = first.pts is not None
        whose = "it states" if self._states_times else "this computer's clock as they arrive"
        self.notes.append(f"times of frames: {f'{given} replaces them' if given else whose}")

    @contextmanager
    def capturing(self, told: str) -> Iterator[None]:
        """Within the context, end the frames by the first SIGINT, which says `told`."""
        with first_interrupt(told) as self._interrupt:
            yield
        self._interrupt = None

    def _container(self) -> Any:
        try:
            if self.kind == "camera":
                kind, named = device(self._name)
                return av.open(named, format=kind, timeout=_PATIENCE_S)
            allowed = {
                "protocol_whitelist": ",".join(PROTOCOLS), "format_whitelist": ",".join(_STREAMED),
                "rtsp_flags": "prefer_tcp",
            }  # fmt: skip
            return av.open(self._name, options=allowed, timeout=_PATIENCE_S)
        except (av.error.FFmpegError, OSError, ValueError) as error:
            what = "no camera" if self.kind == "camera" else "no video"
            raise DataError(f"{self.path}: {what} can be opened: {_why(error)}") from error

    def _decoded(self, container: Any) -> Iterator[Any]:
        """Yield the frames; they end with the source, by hand, or, if damage is allowed, by it."""
        stream = container.streams.best("video")
        if stream is None:
            raise DataError(f"{self.path}: no video in it")
        frames, number = container.decode(stream), 0
        while not self._was_interrupted():
            try:
                frame = next(frames, None)
            except (av.error.FFmpegError, OSError) as error:
                fault = f"{self.path}: broke off after frame {number}: {_why(error)}"
                if not self._was_interrupted() and not self.selection.allow_damaged:
                    raise DataError(f"{fault}; --allow-damaged takes those before") from error
                self._note(fault)
                return
            if frame is None:
                return
            if frame.is_corrupt and not self.selection.allow_damaged:
                if number == 0:
                    continue  # a stream that is joined in its midst
                raise DataError(
                    f"{self.path}: frame {number}: damaged on its way; --allow-damaged takes it"
                )
            yield frame
            number += 1

    def _was_interrupted(self) -> bool:
        return self._interrupt is not None and self._interrupt.came

    def shots(self) -> Iterator[Shot]:
        """Yield every frame as it comes, of those from now on.

        Raises
        ------
        DataError
            The source breaks off, or nothing comes for a while; a frame is damaged or has no time.
        """
        converter, first_ns = Converter(), None
        try:
            with closing(self._container()) as container:
                for number, frame in enumerate(self._decoded(container)):
                    label = f"{self.path}: frame {number}"
                    t_ns = self._time_ns(frame, number, label)
                    first_ns = t_ns if first_ns is None else first_ns
                    t_ns -= first_ns
                    late = self.passed_ns and t_ns <= self.passed_ns[-1]
                    if late and self.selection.allow_damaged:
                        self._note(f"{label}: its time is that of frames before: left out")
                        continue
                    yield Shot(t_ns, label, partial(converter.frame, frame, label))
        finally:  # also where --stop breaks it off
            for doubt in gap_doubts(list(self.passed_ns), self.path):
                self._note(doubt)
        if self._was_interrupted():
            self.ended_by_hand = len(self.passed_ns)
            self._note(f"{self.path}: ended by hand (Ctrl-C) after {self.ended_by_hand} frames")

    def _time_ns(self, frame: Any, number: int, label: str) -> int:
        if self._rate is not None:
            return self._rate.time_ns(number)
        if not self._states_times:
            return time.monotonic_ns()
        if frame.pts is None:
            raise DataError(f"{label}: states no time, as those before did; give --fps")
        t_ns: int = round(frame.pts * frame.time_base * NS_PER_S)
        return t_ns


def _why(error: Exception) -> str:
    if isinstance(error, av.error.ExitError):
        return f"nothing came for {_PATIENCE_S:g} s"
    return getattr(error, "strerror", None) or str(error)
