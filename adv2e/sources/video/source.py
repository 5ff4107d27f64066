"""Video files, through PyAV and the FFmpeg in it, each frame at its own time.

Frames are decoded in one pass.  Before, the pictures are listed by going through the file without
decoding: how many there are, when they are shown, and what is damaged.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import av

from adv2e.errors import DataError
from adv2e.label import left_out, told_of
from adv2e.sources.base import GivenTimes, Selection, Source
from adv2e.sources.frame import Light, Shot
from adv2e.sources.times.rates import NS_PER_S, gap_doubts, seconds
from adv2e.sources.video.listing import Listing, list_pictures
from adv2e.sources.video.opening import Video, opened
from adv2e.sources.video.pictures import Converter, encoding_of, is_stated, oddly_shown

_FIELDS = (
    "interlaced: each picture is taken whole, with the two fields that it has of different times;"
    " ffmpeg -vf bwdif makes pictures of them"
)
_DECODER_PIXELS, _DECODERS = 1 << 20, 4
"""Pixels of a frame for which one thread decodes fast enough, and the most threads."""
_NEAR_NS = 2000
"""Largest difference between times that come with pictures and those listed."""


def open_source(path: Path, given: GivenTimes, selection: Selection) -> VideoSource:
    """Return the frames of a video file."""
    return VideoSource(path, given, selection)


class VideoSource(Source):
    """A video file; DataError if it is damaged, is no video, or holds no frame."""

    has_tracks = True

    def __init__(self, path: Path, given: GivenTimes, selection: Selection) -> None:
        super().__init__(path, "video", selection, has_clock=given.timestamps is not None)
        self.packages = ("av",)
        if selection.bayer is not None:
            raise DataError(
                f"{path}: --bayer {selection.bayer} is for images, TIFF and .npy; a video has"
                " colours already"
            )
        with opened(self.path, selection.track) as video:
            _check_alpha(video)
            self._listing = list_pictures(video)
            self._examine(video)
        self._given = self._given_times(given)
        if not given:
            self._tell_times()
        self.count = self._count()

    def _examine(self, video: Video) -> None:
        """Note faults of the file; take geometry and light from the first frame."""
        listing, first = self._listing, self._listing.first
        listing.first = None  # it holds memory of the decoder
        if listing.faults and not self.selection.allow_damaged:
            raise DataError(f"{self.path}: {listing.faults[0]}; --allow-damaged takes what is left")
        if first is None:
            raise DataError(f"{self.path}: no frame in it can be decoded: not a video, or damaged")
        odd = oddly_shown(first)
        faults = filter(None, (*listing.faults, odd))
        self.doubts += [told_of(self.path, left_out(each)) for each in faults]
        self.notes += [told_of(self.path, each) for each in video.told]
        aspect = video.stream.sample_aspect_ratio
        if aspect and aspect != 1:
            told = f"its pixels are not square ({aspect.numerator}:{aspect.denominator})"
            told += ": they are taken as they are stored"
            self.notes.append(told_of(self.path, left_out(told)))
        transfer = int(first.color_trc)
        if not is_stated(transfer):
            transfer = int(video.stream.codec_context.color_trc)
        light = Light(*encoding_of(transfer), is_stated=is_stated(transfer))
        if first.format.name.startswith("gray16") and not is_stated(transfer):
            light = Light("linear", "16-bit grey video")
        self._meaning = encoding_of(transfer)
        label = f"{self.path}: frame 0"
        self._describe(Converter().frame(first, label), label, light)

    def _given_times(self, given: GivenTimes) -> Callable[[int], int] | None:
        """Return the times that replace those in the file: a function of a frame's number."""
        if given:
            self.notes.append(f"{given} replaces the times in the file")
        self._listed: int | None = None
        if given.timestamps is not None:
            own_s = self._listing.usual_ns / NS_PER_S if self._listing.shown_ns else 0
            times = self._take_list(given, own_s)
            self._listed = len(times)
            self._check_listed(len(times))
            self.doubts += gap_doubts(times, str(given.timestamps))
            return times.__getitem__
        if given.time_unit is not None:
            raise DataError(
                f"{self.path}: --time-unit is for lists of times; this video has its own"
            )
        return None if given.rate is None else given.rate.time_ns

    def _check_listed(self, listed: int) -> None:
        if listed == self._listing.count:
            return
        # pictures that cannot stand alone at the start are in the file and never shown
        with opened(self.path, self.selection.track) as video:
            count = sum(1 for _ in self._decoded(video))
        if listed != count:
            raise DataError(f"{self.path}: {listed} times given for {count} frames")

    def _tell_times(self) -> None:
        listing = self._listing
        if listing.back is not None and listing.back[1] <= self.selection.stop_ns:
            number, latest_ns, t_ns = listing.back
            raise DataError(
                f"{self.path}: times begin again near frame {number}: {seconds(t_ns)} s follows"
                f" {seconds(latest_ns)} s, as in files that were joined; give --fps or --timestamps"
            )
        if not listing.shown_ns and listing.rate is None:
            raise DataError(f"{self.path}: it states no times; give --fps or --timestamps")
        self.doubts += [told_of(self.path, doubt) for doubt in listing.doubts]
        if listing.back is None and listing.rate is None:
            self.doubts += gap_doubts(listing.shown_ns, self.path)

    def _count(self) -> int | None:
        """Return the number of frames wanted, as far as the file and the times given tell."""
        listing = self._listing
        count, rate = listing.count, listing.rate
        time_ns = self._given or (rate.time_ns if rate else None)
        if self.selection.start_ns == 0 and self.selection.stop_s is None:
            return count
        if time_ns is None:
            if len(listing.shown_ns) < count:
                return None
            time_ns = listing.shown_ns.__getitem__
        first_ns, numbers = time_ns(0), range(self._listed or count)
        begin = bisect_left(numbers, first_ns + self.selection.start_ns, key=time_ns)
        return bisect_right(numbers, first_ns + self.selection.stop_ns, key=time_ns) - begin

    def _decoders(self) -> int:
        # each has frames of its own, and handing work over costs more than small frames are worth;
        # how a decoder guesses what is damaged may depend on their number
        wanted = 1 + int(self.width * self.height) // _DECODER_PIXELS
        return 1 if self.selection.allow_damaged else min(wanted, _DECODERS, self.threads)

    def shots(self) -> Iterator[Shot]:
        """Yield every frame, decoded but not converted.

        Raises
        ------
        DataError
            A frame is damaged, frames are missing, or times given do not fit the frames.
        """
        clock, given, converter = _Clock(self._listing), self._given, Converter()
        count, guessed, first = 0, 0, self._listing.origin
        latest_ns: int | None = None
        with opened(self.path, self.selection.track) as video:
            tick = video.stream.time_base * NS_PER_S
            for number, frame in enumerate(self._decoded(video)):
                if number == 0 and frame.pts is not None:
                    first = frame.pts
                own_ns = None if frame.pts is None else round((frame.pts - first) * tick)
                count += 1
                label = f"{self.path}: frame {number}"
                if frame.is_corrupt and (frame.key_frame or number > guessed):
                    self._check_damage(f"{label}: it is damaged: the decoder guessed a part of it")
                guessed += frame.is_corrupt
                if self._listed is not None and number >= self._listed:
                    continue  # only counted
                t_ns = given(number) if given is not None else clock.time_ns(number, own_ns)
                if frame.interlaced_frame:
                    self._note(left_out(_FIELDS))
                self._check_transfer(frame, label)
                if self.selection.allow_damaged and latest_ns is not None and t_ns <= latest_ns:
                    told = f"frame {number}: its time is that of frames before: left out"
                    self._note(told_of(self.path, left_out(told)))
                    continue
                latest_ns = t_ns
                yield Shot(t_ns, label, partial(converter.frame, frame, label))
        if guessed:
            told = f"the decoder met errors in {guessed} of {count} frames"
            self._note(told_of(self.path, left_out(told)))
        if self._listed is not None and self._listed != count:
            raise DataError(f"{self.path}: {self._listed} times given for {count} frames")
        if lost := self._lost(count, round((first - self._listing.origin) * tick)):
            told = f"{count} frames could be decoded where it states {count + lost}: cut short or"
            self._check_damage(told_of(self.path, left_out(f"{told} damaged")), those=True)

    def _decoded(self, video: Video) -> Iterator[Any]:
        """Yield the pictures that can be decoded, in the order they are shown."""
        video.stream.thread_type = "AUTO" if self._decoders() > 1 else "SLICE"
        video.stream.codec_context.thread_count = self._decoders()
        packets = video.container.demux(video.stream)
        while True:
            try:
                packet = next(packets, None)
                if packet is None:
                    return
                frames = packet.decode()
            except av.error.FFmpegError:
                continue  # what is missing is counted; a generator that failed has ended
            yield from frames

    def _check_damage(self, fault: str, *, those: bool = False) -> None:
        if not self.selection.allow_damaged:
            raise DataError(f"{fault}; --allow-damaged takes {'those' if those else 'it'}")
        if those:
            self._note(fault)

    def _check_transfer(self, frame: Any, label: str) -> None:
        transfer = int(frame.color_trc)
        if is_stated(transfer) and encoding_of(transfer)[0] != self._meaning[0]:
            raise DataError(
                f"{label}: its light differs from that of the first ({encoding_of(transfer)[1]},"
                f" before {self._meaning[1]}); cut it where that changes"
            )

    def _lost(self, count: int, first_ns: int) -> int:
        """Return the number of pictures missing behind the first that came."""
        listing = self._listing
        if listing.by_number:
            expected = listing.count
        else:
            before = bisect_left(listing.shown_ns, first_ns - _NEAR_NS)
            expected = (len(listing.shown_ns) or listing.count) - before
        if abs(expected - 2 * count) <= 2 and count > 2:
            return 0  # two fields a picture
        return max(expected - count - listing.tiny, 0)


class _Clock:
    """Times of frames in one pass, from their numbers and their own times."""

    def __init__(self, listing: Listing) -> None:
        self._listing = listing
        self._previous_ns = -listing.usual_ns

    def time_ns(self, number: int, own_ns: int | None) -> int:
        """Return the presentation time of a frame, since the first frame like `own_ns` [ns]."""
        listing, rate = self._listing, self._listing.rate
        if rate is not None:
            t_ns = rate.time_ns(number)
            if not listing.by_number and own_ns is not None:
                # frames that could not be shown may be missing before this one
                near = abs(t_ns - own_ns) <= listing.tick_ns
                t_ns = t_ns if near else rate.time_ns(round(own_ns * rate.hz / NS_PER_S))
        elif listing.by_number and number < len(listing.shown_ns):
            t_ns = listing.shown_ns[number]
        elif own_ns is not None and not listing.by_number:
            t_ns = own_ns
        else:
            t_ns = self._previous_ns + listing.usual_ns
        self._previous_ns = t_ns
        return t_ns


def _check_alpha(video: Video) -> None:
    stated = {key.lower(): value for key, value in video.stream.metadata.items()}
    if stated.get("alpha_mode") == "1" and video.stream.codec_context.name.startswith("vp"):
        raise DataError(
            f"{video.path}: its transparency is beside the pictures, where it cannot be read; make"
            " pictures of it with ffmpeg -c:v libvpx-vp9 -i VIDEO folder/%06d.png"
        )
