"""Codecs whose coded pictures say of themselves whether they are fields, and their colours.

OpenCV tells none of it, and since its version 4.13 goes on without a word where its conversion to
RGB refuses a picture.  It hands over coded pictures, though, out of every container it knows, and
their headers are read here; no picture is decoded.
"""

from __future__ import annotations

from collections.abc import Callable

from adv2e.sources.video.streams.base import Parser, Stream
from adv2e.sources.video.streams.h264 import H264
from adv2e.sources.video.streams.hevc import Hevc
from adv2e.sources.video.streams.mpeg import MotionJpeg, Mpeg2, Mpeg4

__all__ = ["RAW", "Stream", "parser_of"]

RAW = "raw"
"""Name of what is not coded."""

_PARSERS: dict[str, tuple[Callable[[], Parser], str]] = {
    "H.264": (H264, "h264 avc1 avc3 x264"),
    "HEVC": (Hevc, "hevc hev1 hvc1 h265 x265"),
    "MPEG-2": (Mpeg2, "mpg2 mp2v m2v1 hdv1 hdv2 hdv3 mx3p mx5p xdv1 xdv2 xdv3 xdva"),
    "MPEG-4": (Mpeg4, "fmp4 mp4v xvid divx dx50 mp4s 3iv2 m4s2"),
}
"""Parsers, and the letters FFmpeg has for their codecs."""

_JPEG = ("mjpg", "jpeg", "avrn", "ljpg", "dmb1", "mjpa")

_WITHOUT_FIELDS = (
    "vp80 vp90 vp8 vp9 vp6f vp6a vp60 vp61 vp62 vp30 vp31 theo mpg1 mp1v m1v1 mpng png gif"
    " hfyu ffvh rle wrle mrle msrl cvid svq1 svq3 flv1 flv h263 s263 u263 h261 mp41 mp42 mp43 div3"
    " div4 mpg4 wmv1 wmv2 wmv3 snow asv1 asv2 tscc tsc2 zmbv cram msvc rpza smc zlib mszh lagr fps1"
    " iv31 iv32 iv41 iv50 rv10 rv20 rv30 rv40 webp"
)
"""Codecs whose pictures FFmpeg never flags as fields."""


def parser_of(name: str, height: int) -> tuple[Stream, Parser | None]:
    """Return what is known of a codec, and what reads its coded pictures.

    `name` are the letters by which FFmpeg knows it, in lower case, none for pictures not coded;
    `height` are the rows that the container states.
    """
    if not name:
        return Stream(RAW), None
    if name in _JPEG:
        return Stream("Motion JPEG"), MotionJpeg(height)
    for codec, (parser, names) in _PARSERS.items():
        if name in names.split():
            return Stream(codec), parser()
    return Stream(name, known=name in _WITHOUT_FIELDS.split()), None
