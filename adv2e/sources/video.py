"""Video files, through OpenCV and the FFmpeg in it, each frame at its own time.

Files are read in one pass: a frame's time is known when the frame is.  Matroska rounds times to
milliseconds, and whether a constant rate stands behind them can be told only from all of them;
there the times are first read from the headers of the blocks, which costs no decoding.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path

import cv2
import numpy as np

from adv2e.errors import DataError
from adv2e.sources.base import GivenTimes, Image, Selection, Shot, Source
from adv2e.sources.containers import Container, examine
from adv2e.sources.opencv import quiet, rgb_of
from adv2e.sources.opening import openable
from adv2e.sources.times import NS_PER_S, parse_times, read_text
from adv2e.sources.video_times import clock_of

_GREY_8, _GREY_16 = b"Y800", b"Y1\x00\x10"
_RETRIES = 1000
"""How many packets after the end of a video may fail before it counts as its end."""

_DECODER_PIXELS, _DECODERS = 1 << 20, 4
"""Pixels of a frame for which one thread decodes fast enough, and the most threads."""


def open_source(path: Path, given: GivenTimes, selection: Selection) -> VideoSource:
    """Return the frames of a video file."""
    return VideoSource(path, given, selection)


class VideoSource(Source):
    """A video file.

    Parameters
    ----------
    path : Path
        The file.
    given : GivenTimes
        Times in place of the file's own.
    selection : Selection
        Frames wanted.

    Raises
    ------
    DataError
        If the file is cut short, is no video, or holds no frame.
    """

    def __init__(self, path: Path, given: GivenTimes, selection: Selection) -> None:
        super().__init__(path, "video", selection, has_clock=given.timestamps is not None)
        self._container = examine(path)
        with self._opened() as capture:
            pixels = int(capture.get(cv2.CAP_PROP_CODEC_PIXEL_FORMAT))
            self._pixels = pixels.to_bytes(4, "little") if pixels >= 0 else b""
            self._fps = max(float(capture.get(cv2.CAP_PROP_FPS)), 0.0)
            self._stated = int(capture.get(cv2.CAP_PROP_FRAME_COUNT))
            self._keep_grey(capture)
            if not capture.grab():
                raise DataError(f"{path}: no frame in it can be decoded")
            self._describe(_load(capture, f"{path}: frame 0"), f"{path}: frame 0")
        if self._container.stamps_ns is not None:
            # counted, where FFmpeg multiplies the rate and the length of the longest track
            self._stated = len(self._container.stamps_ns)
        if selection.start_s is None and selection.stop_s is None and self._stated > 0:
            self.count = self._stated
        self._choose_encoding()
        if given:
            self.notes.append(f"{given} replaces the times in the file")
        listed = None
        if given.timestamps is not None:
            listed = parse_times(read_text(given.timestamps), str(given.timestamps))
        self._listed = None if listed is None else len(listed)
        self._clock = clock_of(given, listed, self._container, self._fps)

    def _keep_grey(self, capture: cv2.VideoCapture) -> None:
        # grey pictures come as stored; conversion would repeat them three times, in 8 bits
        if self._pixels in (_GREY_8, _GREY_16):
            capture.set(cv2.CAP_PROP_CONVERT_RGB, 0)

    def _choose_encoding(self) -> None:
        # FFmpeg's tags of deeper formats end with the number of bits, or begin with it (big endian)
        ends = (self._pixels[-1:] + self._pixels[:1]) or b"\0"
        bits = next((byte for byte in ends if 8 < byte <= 16), 8)
        if self.dtype == np.uint16:
            self.encoding_reason = "16-bit grey video"
            return
        self.encoding, self.encoding_reason = "srgb", "a video"
        if bits > 8:
            self.notes.append(f"the video has {bits} bits a pixel and is read with 8 of them")

    def _decoders(self) -> int:
        # each has frames of its own, and handing work over costs more than small frames are worth
        wanted = 1 + int(self.width * self.height) // _DECODER_PIXELS
        return min(wanted, _DECODERS, self.threads)

    @contextmanager
    def _opened(self, threads: int = 1) -> Iterator[cv2.VideoCapture]:
        with quiet(), openable(self.path) as name:
            options = [cv2.CAP_PROP_N_THREADS, threads]
            capture = cv2.VideoCapture(name, cv2.CAP_FFMPEG, options)
        try:
            if not capture.isOpened():
                raise DataError(f"{self.path}: not a video that can be read, or damaged")
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
        with self._opened(self._decoders()) as capture:
            self._keep_grey(capture)
            number, first_ns, stamp_ns = 0, 0, 0
            while capture.grab():
                # of the frame just grabbed; before the first one it means nothing
                stamp_ns = round(capture.get(cv2.CAP_PROP_POS_MSEC) * 1e6)
                first_ns = stamp_ns if number == 0 else first_ns
                if self._listed is None or number < self._listed:  # the others are only counted
                    label = f"{self.path}: frame {number}"
                    t_ns = self._clock(number, stamp_ns - first_ns)
                    yield Shot(t_ns, label, partial(_load, capture, label))
                number += 1
            self._check_end(capture, number, stamp_ns)

    def _check_end(self, capture: cv2.VideoCapture, count: int, last_ns: int) -> None:
        complete = self._container.exact_count and count >= self._stated
        if not complete and any(capture.grab() for _ in range(_RETRIES)):
            raise DataError(f"{self.path}: damaged after frame {count - 1}; re-encode it")
        if _ends_early(self._container, self._fps, self._stated, count, last_ns):
            raise DataError(
                f"{self.path}: {count} frames could be decoded where it states {self._stated}: cut"
                " short or damaged"
            )
        if self._listed is not None and self._listed != count:
            raise DataError(f"{self.path}: {self._listed} times given for {count} frames")


def _load(capture: cv2.VideoCapture, label: str) -> Image:
    good, image = capture.retrieve()
    if not good or image is None:
        raise DataError(f"{label}: cannot be decoded")
    return rgb_of(image)


def _ends_early(container: Container, fps: float, stated: int, count: int, last_ns: int) -> bool:
    # a count alone does not tell: an edit list hides frames at the start, AVI may leave some out
    if not container.exact_count or count >= stated or not fps > 0:
        return False
    interval_ns = NS_PER_S / fps
    end_ns = stated * interval_ns if container.end_ns is None else container.end_ns
    return last_ns + 1.5 * interval_ns < end_ns
