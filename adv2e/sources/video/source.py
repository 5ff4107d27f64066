"""Video files, through OpenCV and the FFmpeg in it, each frame at its own time.

Frames are decoded in one pass.  Before, the pictures are listed, from the file's index or by going
through it without decoding: how many there are, and what is known of their times.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import cv2
import numpy as np

from adv2e.errors import DataError, MissingExtraError
from adv2e.sources.base import Source
from adv2e.sources.frame import Light, Pixels, Shot
from adv2e.sources.images.opencv import quiet, rgb_of
from adv2e.sources.times.gaps import gap_doubts
from adv2e.sources.times.instants import Stamp, seconds
from adv2e.sources.times.lists import read_list
from adv2e.sources.video import pyav
from adv2e.sources.video.choice import bits_of, choose
from adv2e.sources.video.colours import Colours, encoding_of, is_stated
from adv2e.sources.video.containers import examine
from adv2e.sources.video.opening import openable
from adv2e.sources.video.packets import RETRIES, Packets, read_packets, stamp_of
from adv2e.sources.video.times import VideoTimes
from adv2e.sources.wanted import GivenTimes, Selection

if TYPE_CHECKING:
    Capture = cv2.VideoCapture | pyav.PyavCapture

_FIELDS = (
    "interlaced: each picture is taken whole, with the two fields that it has of different times;"
    " ffmpeg -vf bwdif makes pictures of them"
)
_NO_TAG = "OpenCV does not tell what kind of pixels it has"
_GREY_8, _GREY_16 = b"Y800", b"Y1\x00\x10"
_DECODER_PIXELS, _DECODERS = 1 << 20, 4
"""Pixels of a frame for which one thread decodes fast enough, and the most threads."""


def open_source(path: Path, given: GivenTimes, selection: Selection) -> VideoSource:
    """Return the frames of a video file."""
    return VideoSource(path, given, selection)


class VideoSource(Source):
    """A video file; DataError if it is cut short, is no video, or holds no frame."""

    def __init__(self, path: Path, given: GivenTimes, selection: Selection) -> None:
        super().__init__(path, "video", selection, has_clock=given.timestamps is not None)
        if selection.bayer is not None:
            raise DataError(
                f"{path}: --bayer {selection.bayer} is for images, TIFF and .npy; a video has"
                " colours already"
            )
        self._container = examine(path, allow_damaged=selection.allow_damaged)
        told = [*self._container.faults, *self._container.doubts]
        self.doubts += [f"{path}: {line}" for line in told]
        self._why_pyav, self._pixels = "", b""
        self._colours = Colours()
        self._packets = self._choose_decoder()
        with self._opened() as capture:
            if not any(capture.grab() for _ in range(RETRIES)):
                raise DataError(f"{path}: no frame in it can be decoded")
            if not (self._pixels or self._why_pyav):  # one is of grey with alpha, of 16 bits
                raise MissingExtraError(f"{path}: {_NO_TAG}; reading that", "video")
            if isinstance(capture, pyav.PyavCapture):
                # of codecs whose own headers are not read here
                self._colours = self._colours.completed(Colours(transfer=capture.transfer))
            self._describe(_load(capture, f"{path}: frame 0"), f"{path}: frame 0", self._meaning())
        self._times = VideoTimes(self._container, self._packets, self._fps)
        self._given = self._given_times(given)
        if not given:
            self._tell_times()
        self.count = self._count()

    def _given_times(self, given: GivenTimes) -> Callable[[int], int] | None:
        """Return the times that replace those in the file: a function of a frame's number."""
        if given:
            self.notes.append(f"{given} replaces the times in the file")
        self._listed: int | None = None
        if given.timestamps is not None:
            stamps = self._list(given.timestamps, given.time_unit)
            self._listed = len(stamps)
            self._check_listed(len(stamps))
            self.doubts += gap_doubts([stamp.t_ns for stamp in stamps], str(given.timestamps))
            return lambda number: stamps[number].t_ns
        if given.time_unit is not None:
            raise DataError(
                f"{self.path}: --time-unit is for lists of times; this video has its own"
            )
        return None if given.rate is None else given.rate.time_ns

    def _count(self) -> int | None:
        """Return how many frames are wanted, as far as the file and the times given tell."""
        count, shown_ns, rate = self._times.expected, self._times.shown_ns, self._times.rate
        time_ns = self._given or (rate.time_ns if rate else None)
        if count is None or (self.selection.start_ns == 0 and self.selection.stop_s is None):
            return count
        if time_ns is None:
            if len(shown_ns) < count:
                return None
            time_ns = shown_ns.__getitem__
        first_ns, numbers = time_ns(0), range(self._listed or count)
        begin = bisect_left(numbers, first_ns + self.selection.start_ns, key=time_ns)
        return bisect_right(numbers, first_ns + self.selection.stop_ns, key=time_ns) - begin

    def _check_listed(self, listed: int) -> None:
        if listed == self._times.expected:
            return
        # pictures that cannot stand alone at the start are in the index and never shown
        with self._opened(self._decoders()) as capture:
            count = sum(1 for _ in self._grabbed(capture))
        if listed != count:
            raise DataError(f"{self.path}: {listed} times given for {count} frames")

    def _tell_times(self) -> None:
        back = None if self._packets is None else self._packets.back
        if back is not None and back.latest_ns <= self.selection.stop_ns:
            raise DataError(
                f"{self.path}: times begin again near frame {back.number}: {seconds(back.t_ns)} s"
                f" follows {seconds(back.latest_ns)} s, as in files that were joined; give --fps or"
                " --timestamps"
            )
        if not self._times.shown_ns:
            raise DataError(f"{self.path}: OpenCV finds no times in it; give --fps or --timestamps")
        self.doubts += [f"{self.path}: {doubt}" for doubt in self._times.doubts]
        if back is None and self._times.rate is None:
            self.doubts += gap_doubts(self._times.shown_ns, self.path)

    def _list(self, timestamps: Path, time_unit: str | None) -> list[Stamp]:
        steps = np.diff(self._times.shown_ns)
        own_s = float(np.median(steps)) / 1e9 if steps.size else 1 / self._fps if self._fps else 0
        found = read_list(timestamps, time_unit=time_unit, own_step_s=own_s)
        doubts, notes = found.told(str(timestamps))
        self.doubts += doubts
        self.notes += notes
        return found.stamps

    def _choose_decoder(self) -> Packets | None:
        """Choose by what container and coded pictures say; return when these are shown."""
        with self._opened() as capture:
            pixels = int(capture.get(cv2.CAP_PROP_CODEC_PIXEL_FORMAT))
            self._pixels = pixels.to_bytes(4, "little") if pixels >= 0 else b""
            self._fps = max(float(capture.get(cv2.CAP_PROP_FPS)), 0.0)
            height = int(capture.get(cv2.CAP_PROP_FRAME_HEIGHT))
        container = self._container
        stream, packets = read_packets(self.path, height, listed=bool(container.stamps_ns))
        self._why_pyav, self._colours = choose(self.path, container, stream, self._pixels)
        if not self._pixels and not self._why_pyav and pyav.is_installed():
            self._why_pyav = _NO_TAG
        bits = bits_of(self._pixels)
        if bits > 8 and not self._why_pyav and self._pixels != _GREY_16:
            if pyav.is_installed():
                self._why_pyav = f"it has {bits} bits a pixel"
            else:
                self.notes.append(
                    f"the video has {bits} bits a pixel and is read with 8 of them;"
                    " pip install 'adv2e[video]' reads all"
                )
        if self._why_pyav:
            self.packages = ("av",)
        return packets

    def _meaning(self) -> Light:
        transfer = self._colours.transfer
        if self._pixels in (_GREY_16, _GREY_16[::-1]) and not is_stated(transfer):
            return Light("linear", "16-bit grey video")
        return Light(*encoding_of(transfer))

    def _decoders(self) -> int:
        # each has frames of its own, and handing work over costs more than small frames are worth
        wanted = 1 + int(self.width * self.height) // _DECODER_PIXELS
        return min(wanted, _DECODERS, self.threads)

    @contextmanager
    def _opened(self, threads: int = 1) -> Iterator[Capture]:
        if self._why_pyav:
            decoder = pyav.PyavCapture(self.path, self._why_pyav, threads, self._colours.matrix)
            try:
                yield decoder
            finally:
                decoder.release()
            return
        with quiet(), openable(self.path) as name:
            options = [cv2.CAP_PROP_N_THREADS, threads]
            capture = cv2.VideoCapture(name, cv2.CAP_FFMPEG, options)
        try:
            if not capture.isOpened():
                raise DataError(f"{self.path}: not a video that can be read, or damaged")
            if self._pixels in (_GREY_8, _GREY_16):
                # they come as stored; conversion would repeat them three times, in 8 bits
                capture.set(cv2.CAP_PROP_CONVERT_RGB, 0)
            yield capture
        finally:
            capture.release()

    def shots(self) -> Iterator[Shot]:
        """Yield every frame, grabbed but not converted; a shot loads until the next is asked for.

        Raises
        ------
        DataError
            If decoding stops before the end, or times given do not fit the frames.
        """
        clock, given = self._times.clock(in_order=not self._why_pyav), self._given
        stamps: list[int | None] = []
        with self._opened(self._decoders()) as capture:
            for number in self._grabbed(capture):
                # of the frame just grabbed; before the first one it means nothing
                stamp: int | None = stamp_of(capture)
                if stamp == 0 and number and self._times.zero_means_none:
                    stamp = None
                stamps.append(stamp)
                if self._listed is not None and number >= self._listed:
                    continue  # only counted
                label = f"{self.path}: frame {number}"
                own = None if stamp is None else stamp - (stamps[0] or 0)
                t_ns = given(number) if given is not None else clock(number, own)
                if isinstance(capture, pyav.PyavCapture) and capture.has_fields:
                    self._note(_FIELDS)
                yield Shot(t_ns, label, partial(_load, capture, label))
            spoilt = capture.spoilt if isinstance(capture, pyav.PyavCapture) else 0
        self._check_end(stamps, spoilt)

    def _grabbed(self, capture: Capture) -> Iterator[int]:
        """Grab frame after frame, past what cannot be decoded, and yield their numbers."""
        number, failed = 0, 0
        while failed < RETRIES:
            if capture.grab():
                yield number
                number, failed = number + 1, 0
            elif self._times.expected is not None and number >= self._times.expected:
                return
            else:
                failed += 1

    def _check_end(self, stamps: list[int | None], spoilt: int) -> None:
        count = len(stamps)
        if spoilt:  # OpenCV does not tell
            self._note(f"{self.path}: the decoder met errors in {spoilt} of {count} frames")
        if self._listed is not None and self._listed != count:
            raise DataError(f"{self.path}: {self._listed} times given for {count} frames")
        lost = self._times.lost(stamps)
        if not lost:
            return
        fault = (
            f"{self.path}: {count} frames could be decoded where it states {count + lost}: cut"
            " short or damaged"
        )
        if not self.selection.allow_damaged:
            raise DataError(f"{fault}; --allow-damaged takes those")
        self._note(fault)


def _load(capture: Capture, label: str) -> Pixels:
    good, image = capture.retrieve()
    if not good or image is None:
        raise DataError(f"{label}: cannot be decoded")
    if image.ndim < 3 or image.shape[2] < 4:
        return Pixels(rgb_of(image))
    white, alpha = np.iinfo(image.dtype).max, image[..., 3]
    there = None if alpha.min() == white else alpha.astype(np.float32) / np.float32(white)
    return Pixels(rgb_of(image), there)
