"""The coded pictures of a video, gone through once without decoding: how many, when, and damage.

FFmpeg's demultiplexer takes little beside decoding.  What is missing of a file is found by what its
container states (a list of pictures, a length, its size), by packets that are flagged as damaged,
by FFmpeg's log, and by bytes that are no whole packet at the end.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from fractions import Fraction
from itertools import pairwise
from pathlib import Path
from statistics import median
from typing import Any

import av
import numpy as np

from adv2e.label import guessed
from adv2e.sources.times.rates import NS_PER_S, FrameRate, constant_rate, rates_near, seconds
from adv2e.sources.video.opening import Video, overheard

_TINY_BYTES = 8
"""Coded pictures of no more than this may stand for the one before them (MPEG-4's N-VOP)."""
_MOVED = 4.5
"""Usual steps by which a stated length may be off."""
_ROUNDED = 0.02
"""Usual steps by which times are off that FFmpeg fills in, in whole ticks."""
_REORDERED = 16
"""Pictures between which decoding may change the order."""
_HALF_WRAP_NS = 2**32 * NS_PER_S // 90_000
"""Clocks of MPEG streams begin again after twice this; FFmpeg takes going back for that."""
_IN_DECODING_ORDER = ("avi", "asf")
"""Formats whose timestamps are those of decoding."""
_MILLISECONDS = ("matroska", "asf")
"""Formats with a clock so coarse that a constant rate has to be recovered from it."""
_WITHOUT_TIMES = ("h264", "hevc", "m4v", "mpegvideo")
_LOG = re.compile("ended prematurely|exceeds containing master|packet_obj_size")
"""Messages of FFmpeg about parts of Matroska and ASF that do not fit, which it passes over."""
_LAST = 50
"""Packets at the end of a file, of sound and others as well, that must be whole."""


@dataclass
class Listing:
    """Coded pictures of a video and their presentation times.

    Attributes
    ----------
    count : int
        Number of pictures to be shown.
    shown_ns : list of int
        Their times from the first on, sorted and none twice; fewer where times are missing [ns].
    origin : int
        When the first of them is, on the clock of the file [ticks].
    by_number : bool
        The first picture shown is at the first of these times, and so on: those that come with the
        pictures are times of decoding, or missing.
    rate : FrameRate or None
        The constant rate at which all of them are, where there is one.
    usual_ns : int
        The usual step from picture to picture [ns].
    tick_ns : int
        Step of the times in the file [ns].
    tiny : int
        How many are too small to hold a picture.
    first : Any
        The first picture that can be decoded, as PyAV gives it; None: there is none.
    back : (int, int, int) or None
        Where times begin again: number of the picture, latest time before and its own [ns].
    faults, doubts : list of str
        What is missing or damaged; what is guessed.
    """

    count: int = 0
    shown_ns: list[int] = field(default_factory=list)
    origin: int = 0
    by_number: bool = False
    rate: FrameRate | None = None
    usual_ns: int = NS_PER_S
    tick_ns: int = 0
    tiny: int = 0
    first: Any = None
    back: tuple[int, int, int] | None = None
    faults: list[str] = field(default_factory=list)
    doubts: list[str] = field(default_factory=list)


def list_pictures(video: Video) -> Listing:
    """Go through the packets of a video, and decode its first picture."""
    found, stream = Listing(), video.stream
    stated = sum(each.size > 0 and not each.is_discard for each in stream.index_entries)
    may_repeat = stream.codec_context.name.startswith("mpeg4")
    stamps: list[int | None] = []
    last, since_corrupt = None, _LAST
    with overheard() as said:
        try:
            for packet in video.container.demux():
                ours = packet.stream_index == stream.index
                if ours and found.first is None:
                    found.first = next(_decoded(packet), None)
                if not packet.size:
                    continue
                last = packet
                since_corrupt = 0 if packet.is_corrupt else since_corrupt + 1
                if not ours:
                    continue
                if packet.is_corrupt and not (found.faults or found.doubts):
                    told = f"cut short or damaged near frame {len(stamps)}"
                    # jumps of its counters may be no damage, as where files were joined
                    (found.doubts if video.format == "mpegts" else found.faults).append(told)
                if not packet.is_discard and _is_shown(packet, stream.codec_context.name):
                    stamps.append(packet.dts if packet.pts is None else packet.pts)
                    found.tiny += may_repeat and packet.size <= _TINY_BYTES
        except (av.error.FFmpegError, OSError):
            found.faults.append(f"damaged after frame {len(stamps) - 1}, where reading ends")
    _arrange(found, stamps, video)
    found.faults += _missing(found, stated, last, video)
    lines = [text for text in (*video.said, *(text for _, _, text in said)) if _LOG.search(text)]
    if lines and not found.faults:
        found.faults.append(f"cut short or damaged: {lines[0].strip().lower()}")
    if since_corrupt < _LAST and not (found.faults or found.doubts):
        found.faults.append("cut short: its last packets are not whole")
    return found


def _decoded(packet: Any) -> Iterator[Any]:
    """Yield the pictures that a packet brings out of the decoder; errors are passed over."""
    try:
        yield from packet.decode()
    except av.error.FFmpegError:
        return


def _is_shown(packet: Any, codec: str) -> bool:
    # VP8 has pictures that others refer to, and nobody sees
    return codec not in ("vp8", "libvpx") or bool(bytes(packet)[0] & 0x10)


def _arrange(found: Listing, stamps: list[int | None], video: Video) -> None:
    """Set the presentation times of pictures from their times in the order of the file [ticks]."""
    found.count, stream = len(stamps), video.stream
    tick = Fraction(stream.time_base) * NS_PER_S
    found.tick_ns = round(tick)
    found.origin = min((t for t in stamps if t is not None), default=0)
    known = [
        (number, round((t - found.origin) * tick))
        for number, t in enumerate(stamps)
        if t is not None
    ]
    found.shown_ns = sorted({t_ns for _, t_ns in known})
    reordered = stream.codec_context.has_b_frames
    found.by_number = video.format in _IN_DECODING_ORDER and reordered
    if video.format in _WITHOUT_TIMES:
        hz = stream.codec_context.framerate
        found.shown_ns, found.by_number = [], True
        if hz:
            found.rate = FrameRate(Fraction(hz))
            told = f"it has no times: taken at {float(hz):.6g} frames a second, as it says itself"
            found.doubts.append(guessed(told, "fps", float(hz), f"give --fps {hz}, or another"))
    elif len(known) < found.count:
        found.rate, found.by_number = _rate_of_some(found, stream.guessed_rate), True
        rest = (
            f"taken at {float(found.rate.hz):.6g} frames a second" if found.rate else "they follow"
        )
        told = f"it states times for {len(known)} of its {found.count} frames: {rest}"
        found.doubts.append(guessed(told, "times of frames", rest, "give --fps or --timestamps"))
    elif video.format in _MILLISECONDS:
        hz = float(stream.guessed_rate or 0)
        found.rate = constant_rate(found.shown_ns, stated_hz=hz, tolerance_ns=found.tick_ns)
    if video.format == "yuv4mpegpipe" and not _states_rate(video.path):
        found.shown_ns, found.rate = [], None
    steps = [after - before for before, after in pairwise(found.shown_ns)]
    if found.rate is not None:
        found.usual_ns = found.rate.time_ns(1)
    elif steps:
        found.usual_ns = round(median(steps))
    latest = known[0][1] if known else 0
    for number, t_ns in known:
        if latest - t_ns > _REORDERED * found.usual_ns or t_ns - latest > _HALF_WRAP_NS:
            found.back = number, latest, t_ns
            break
        latest = max(latest, t_ns)


def _rate_of_some(found: Listing, guessed: Fraction | None) -> FrameRate | None:
    """Return the rate near the guessed one at which pictures are if some are at times known."""
    times = np.array(found.shown_ns, np.float64) / NS_PER_S
    for hz in (*rates_near(float(guessed or 0)), guessed):
        if hz:
            places = times * float(hz)
            within = max(2 * found.tick_ns * float(hz) / NS_PER_S, _ROUNDED)
            if times.size and np.all(np.abs(places - np.rint(places)) <= within):
                return FrameRate(Fraction(hz))
    return None


def _states_rate(path: str) -> bool:
    with Path(path).open("rb") as file:
        return re.search(rb" F[1-9]\d*:[1-9]", file.readline(1024)) is not None


def _missing(found: Listing, stated: int, last: Any, video: Video) -> Iterator[str]:
    """Yield faults: pictures missing by the container's own numbers, or by the end of the file."""
    if found.count < stated:
        yield f"cut short or damaged: it lists {stated} pictures, and has {found.count}"
    length_ns = _length_ns(video)
    if found.shown_ns and length_ns:
        has_ns = found.shown_ns[-1] + found.usual_ns
        if video.format == "matroska":  # lengths are counted from zero
            has_ns += found.origin * found.tick_ns
        if has_ns + _MOVED * found.usual_ns < length_ns:
            yield (
                f"cut short or damaged: it states a length of {seconds(length_ns)} s, and has"
                f" {seconds(has_ns)} s"
            )
    if video.format == "yuv4mpegpipe" and last is not None:
        rest = video.size - last.pos - last.size
        if rest > 0:
            yield f"cut short or damaged: {rest} bytes after its last whole frame"
    yield from _end(Path(video.path), video)


def _length_ns(video: Video) -> int | None:
    """Return the length of the film that the file states [ns]; None: it states none."""
    stream: Any = video.stream
    container: Any = video.container
    tag = re.fullmatch(r"(\d+):(\d\d):(\d\d\.\d{1,9})", stream.metadata.get("DURATION", ""))
    if tag is not None:
        hours, minutes, rest = tag.groups()
        return round((3600 * int(hours) + 60 * int(minutes) + Fraction(rest)) * NS_PER_S)
    alone = len(container.streams) == 1
    if stream.duration and (alone or video.format != "asf"):  # its length is that of all
        return round(Fraction(stream.duration * stream.time_base) * NS_PER_S)
    if container.duration and alone:
        return int(container.duration * 1000)
    return None


_PACKETS = ((188, 0), (192, 4), (204, 0))
"""Bytes of a packet of MPEG-TS, and where in them it begins: as sent, on discs, with parity."""
_SYNC = 0x47
_ASF_PROPERTIES = bytes.fromhex("a1dcab8c47a9cf118ee400c00c205365")
_HEAD_BYTES, _TAIL_BYTES = 1 << 16, 1 << 16


def _end(path: Path, video: Video) -> Iterator[str]:
    """Yield faults: data missing by the sizes of parts that FFmpeg passes over."""
    with path.open("rb") as file:
        head = file.read(_HEAD_BYTES)
        file.seek(max(0, video.size - _TAIL_BYTES))
        tail = file.read()
    if video.format == "mpegts":
        data = np.memmap(path, np.uint8, "r")
        for size, lead in _PACKETS:
            starts = data[lead::size]
            if np.mean(starts[:100] == _SYNC) > 0.5:
                wrong = np.flatnonzero(starts != _SYNC)
                if wrong.size and int(wrong[0]) * size < video.size - size:
                    yield f"damaged at byte {int(wrong[0]) * size}"
                elif video.size % size:
                    yield f"cut short: {video.size % size} bytes after its last whole packet"
                break
    elif video.format == "mov":
        yield from _broken_boxes(path, video.size)
    elif video.format == "avi" and len(head) >= 8:
        (size,) = struct.unpack_from("<I", head, 4)
        if video.size < size + 8 and size != 0xFFFFFFFF:
            yield f"cut short: it holds {video.size} bytes where {size + 8} belong; copy it again"
    elif video.format == "asf":
        place = head.find(_ASF_PROPERTIES)
        if place >= 0 and len(head) >= place + 92:
            size, flags = struct.unpack_from("<Q40xI", head, place + 40)
            if size > video.size and not flags & 1:  # of a broadcast nothing is stated
                yield f"cut short: it holds {video.size} bytes where {size} belong; copy it again"
    elif video.format == "gif":
        yield from _end_of_gif(path.read_bytes())
    elif video.format == "ogg":
        place = tail.rfind(b"OggS")
        if place < 0 or place + 5 >= len(tail) or not tail[place + 5] & 4:
            yield "its last page has no end mark: cut short or damaged"


def _broken_boxes(path: Path, size: int) -> Iterator[str]:
    """Yield a fault if the boxes of fragments do not follow one another to the end."""
    place, kinds = 0, []
    data = np.memmap(path, np.uint8, "r")
    while place + 8 <= size:
        length, kind = struct.unpack(">I4s", data[place : place + 8].tobytes())
        if length == 1:
            length = int.from_bytes(data[place + 8 : place + 16].tobytes(), "big")
        if length < 8 or not kind.isalnum():
            break  # what follows the last box may be anything
        kinds.append(kind)
        place += length
    if b"moof" not in kinds:
        return
    if place > size:
        yield f"cut short: it holds {size} bytes where {place} belong; copy it again"
    elif bytes(data[place:]).find(b"moof") >= 0:
        yield f"damaged at byte {place}"


def _end_of_gif(data: bytes) -> Iterator[str]:
    """Yield a fault if the blocks of a GIF do not follow one another to the end mark."""
    extension, image, end = 0x21, 0x2C, 0x3B
    try:
        place = 13 + _colours(data[10])
        while data[place] != end:
            if data[place] not in (extension, image):
                yield f"damaged at byte {place}"
                return
            place += 2 if data[place] == extension else 11 + _colours(data[place + 9])
            while data[place]:
                place += 1 + data[place]
            place += 1
    except IndexError:
        yield f"cut short: it holds {len(data)} bytes, and its end mark is not among them"


def _colours(flags: int) -> int:
    return 3 << ((flags & 7) + 1) if flags & 0x80 else 0
