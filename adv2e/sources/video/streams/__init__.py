"""What the coded pictures of a video say of themselves: fields or frames, colours, transfer.

OpenCV tells none of it, and since its version 4.13 goes on without a word where its conversion to
RGB refuses a picture.  It hands over coded pictures, though, out of every container it knows, and
their headers are read here; no picture is decoded.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import cv2

from adv2e.sources.images.opencv import quiet
from adv2e.sources.video.colours import Colours
from adv2e.sources.video.opening import openable
from adv2e.sources.video.packets import RETRIES
from adv2e.sources.video.streams.base import Findings, Parser
from adv2e.sources.video.streams.ffv1 import Ffv1
from adv2e.sources.video.streams.gif import Gif
from adv2e.sources.video.streams.h264 import H264
from adv2e.sources.video.streams.hevc import Hevc
from adv2e.sources.video.streams.intra import DnxHd, Dv, MotionJpeg, ProRes, UtVideo
from adv2e.sources.video.streams.mpeg import Mpeg2, Mpeg4

__all__ = ["RAW", "Stream", "examine_stream"]

RAW = "raw"

_PARSERS: dict[str, tuple[Callable[[], Parser], str]] = {
    "H.264": (H264, "h264 avc1 avc3 x264"),
    "HEVC": (Hevc, "hevc hev1 hvc1 h265 x265"),
    "MPEG-2": (Mpeg2, "mpg2 mp2v m2v1 hdv1 hdv2 hdv3 mx3p mx5p xdv1 xdv2 xdv3 xdva"),
    "MPEG-4": (Mpeg4, "fmp4 mp4v xvid divx dx50 mp4s 3iv2 m4s2"),
    "ProRes": (ProRes, "apch apcn apcs apco ap4h ap4x aprh aprn"),
    "DNxHD": (DnxHd, "avdn avdh avd1"),
    "DV": (Dv, "dvsd dvsl dvhd dvh1 dvh2 dvh3 dvh5 dvh6 dv25 dv50 dvc dvcp dvcs dvis dvpp cdvc"),
    "FFV1": (Ffv1, "ffv1"),
    "GIF": (Gif, "gif"),
    "Ut Video": (UtVideo, "ulrg ulra uly0 uly2 uly4 ulh0 ulh2 ulh4"),
}
"""Codecs whose pictures say what counts here: the parser, and the letters FFmpeg has for each."""

_JPEG = ("mjpg", "jpeg", "avrn", "ljpg", "dmb1", "mjpa")

_WITHOUT_FIELDS = (
    "vp80 vp90 vp8 vp9 vp6f vp6a vp60 vp61 vp62 vp30 vp31 theo mpg1 mp1v m1v1 mpng png"
    " hfyu ffvh rle wrle mrle msrl cvid svq1 svq3 flv1 flv h263 s263 u263 h261 mp41 mp42 mp43 div3"
    " div4 mpg4 wmv1 wmv2 wmv3 snow asv1 asv2 tscc tsc2 zmbv cram msvc rpza smc zlib mszh lagr fps1"
    " iv31 iv32 iv41 iv50 rv10 rv20 rv30 rv40 webp"
)
"""Codecs whose pictures FFmpeg never flags as fields."""


@dataclass(frozen=True)
class Stream:
    """What the coded pictures of a video say.

    Attributes
    ----------
    codec : str
        Its name, or the four letters by which FFmpeg knows it; ``raw`` for pictures not coded.
    known : bool
        It is known how its coded pictures say whether they are fields.
    clear : bool
        All of them could be read.
    interlaced : bool
        They are, or could be.
    transparent : bool
        Pixels could be transparent, or nothing but the kind of pixels tells.
    colours : tuple of Colours
        All that are stated, none twice.
    """

    codec: str
    known: bool
    clear: bool
    interlaced: bool
    transparent: bool
    colours: tuple[Colours, ...]


def examine_stream(path: str, height: int) -> Stream:
    """Read the headers of all coded pictures, up to the first that is two fields.

    Parameters
    ----------
    path : str
        The video.
    height : int
        Rows that its container states.
    """
    findings = Findings()
    with _raw(path) as capture:
        letters = (int(capture.get(cv2.CAP_PROP_FOURCC)) & 0xFFFFFFFF).to_bytes(4, "little")
        name = letters.decode("latin-1").lower().strip("\0 ")
        codec, parser = _parser_of(name, height)
        if parser is None:
            known = codec == RAW or codec in _WITHOUT_FIELDS.split()
            return Stream(codec, known, True, False, True, ())
        try:
            parser.header(_extra(capture), findings)
            for data in _pictures(capture):
                parser.picture(data, findings)
                if findings.interlaced:
                    break
            clear = True
        except (IndexError, struct.error):
            clear = False
    transparent = findings.transparent or codec != "GIF"
    colours = tuple(findings.colours)
    return Stream(codec, True, clear, findings.interlaced, transparent, colours)


def _pictures(capture: cv2.VideoCapture) -> Iterator[bytes]:
    failed = 0
    while failed < RETRIES and capture.isOpened():
        if not capture.grab():
            failed += 1
            continue
        failed = 0
        good, data = capture.retrieve()
        if good and data is not None:
            yield data.tobytes()


def _parser_of(name: str, height: int) -> tuple[str, Parser | None]:
    if not name:
        return RAW, None
    if name in _JPEG:
        return "Motion JPEG", MotionJpeg(height)
    for codec, (parser, names) in _PARSERS.items():
        if name in names.split():
            return codec, parser()
    return name, None


@contextmanager
def _raw(path: str) -> Iterator[cv2.VideoCapture]:
    with quiet(), openable(path) as name:
        capture = cv2.VideoCapture(name, cv2.CAP_FFMPEG, [cv2.CAP_PROP_FORMAT, -1])
    try:
        yield capture
    finally:
        capture.release()


def _extra(capture: cv2.VideoCapture) -> bytes:
    index = int(capture.get(cv2.CAP_PROP_CODEC_EXTRADATA_INDEX))
    good, data = capture.retrieve(flag=index)
    return data.tobytes() if good and data is not None else b""
