"""Sources of frames: videos, folders of images, recordings of data sets, stacks."""

from __future__ import annotations

import importlib
import re
from pathlib import Path
from typing import TYPE_CHECKING

from adv2e.errors import DataError, UsageError
from adv2e.files.regular import check_ends, reading
from adv2e.options import SourceOptions, size_of, takes
from adv2e.sources.base import GivenTimes, Selection, Source
from adv2e.sources.frame import Frame
from adv2e.sources.paths import SensorPath

if TYPE_CHECKING:
    from typing_extensions import Unpack

__all__ = ["Frame", "Source", "open_source"]

VIDEO_SUFFIXES = (
    *(".mp4", ".m4v", ".mov", ".avi", ".mkv", ".webm", ".mpg", ".mpeg", ".ts", ".mts", ".m2ts"),
    *(".wmv", ".flv", ".3gp", ".ogv", ".gif", ".apng", ".y4m"),
    *(".h264", ".264", ".hevc", ".h265", ".265"),
)
"""Files that are opened as video."""

PICTURES = (".png", ".jpg", ".jpeg", ".bmp", ".webp", ".exr", ".hdr", ".pgm", ".ppm", ".pfm")
"""Pictures: an input if they are animated, else for what moves a sensor before them."""

STDIN = "-"
"""Name of standard input."""

OPENERS = {
    **dict.fromkeys(VIDEO_SUFFIXES, "adv2e.sources.video.source"),
    ".zip": "adv2e.sources.zipped",
    ".npy": "adv2e.sources.npy",
    **dict.fromkeys((".tif", ".tiff"), "adv2e.sources.images.stack"),
}
"""Module whose ``open_source(path, given, selection)`` reads files of a suffix."""


@takes(SourceOptions)
def open_source(path: str | Path, **options: Unpack[SourceOptions]) -> Source:
    """Open an input with frames.

    Parameters
    ----------
    path : path
        Video file, folder or zip of images, recording of a data set, TIFF of several pages,
        or ``.npy`` stack; "-" is standard input, through which Y4M or raw video comes; a number, or
        ``/dev/video0``, is a camera; an address with `network`.
    **options
        See :class:`adv2e.options.SourceOptions`.  Of a list, each line is ``t`` or ``t name``: see
        :mod:`adv2e.sources.times.lists`.

    Returns
    -------
    Source
        Its `frames` yields them, checked, as often as asked; those of standard input once.

    Raises
    ------
    UsageError
        If the options contradict each other or are impossible.
    DataError
        If the input is missing, of an unknown kind, or wrong.
    """
    given, selection = GivenTimes.of(options), Selection.of(options)
    along = SensorPath.of(options)
    pixel_format, size = options["pixel_format"], size_of(options)
    if not str(path):
        raise DataError("the input has no name: give a video, a folder of images or a recording")
    if pixel_format is not None and (str(path) != STDIN or size is None):
        raise UsageError(
            "--pixel-format is for raw video through standard input: INPUT must be -, and --size"
            " WxH says the size of its frames"
        )
    if str(path) == STDIN:
        if along is not None:
            raise UsageError("--motion moves before one picture: INPUT must be its file")
        from adv2e.sources.pipes import source as pipe  # noqa: PLC0415  (needs OpenCV)

        return pipe.open_source(given, selection, pixel_format=pixel_format, size=size)
    if is_live(path):
        is_camera = "://" not in str(path)
        if not is_camera and not options["network"]:
            raise DataError(
                f"{without_password(path)}: an address: --network lets it be read, or download it"
                " first"
            )
        if along is not None:
            raise UsageError("--motion moves before one picture: INPUT must be its file")
        from adv2e.sources import live  # noqa: PLC0415  (needs PyAV)

        return live.LiveSource(str(path), given, selection, is_camera)
    named, path = str(path), Path(path)
    with reading(named):
        check_ends(path)
    if not path.exists():
        raise DataError(f"{named}: no such file or folder{_advice(named)}")
    if along is not None:
        from adv2e.sources import still  # noqa: PLC0415  (needs OpenCV)

        return still.open_source(path, given, selection, along)
    opener = importlib.import_module(_opener(path))
    source: Source = opener.open_source(path, given, selection)
    return source


def without_password(address: str | Path) -> str:
    """Return an address as it is told, and stored."""
    return re.sub(r"//[^/]*@", "//", str(address))


def is_live(path: str | Path) -> bool:
    """Tell whether an input is a camera or an address: not if a file or folder is called so.

    A camera is a number, or a device such as ``/dev/video0``.
    """
    text = str(path)
    if "://" in text or re.fullmatch(r"/dev/video\d+", text):
        return True
    return re.fullmatch(r"\d{1,3}", text, re.ASCII) is not None and not Path(text).exists()


def check_stored(path: str | Path) -> None:
    """Refuse (DataError) a camera or an address where frames of a recording are wanted."""
    if is_live(path):
        told = without_password(path)
        raise DataError(f"{told}: a camera or an address, which adv2e convert and info read alone")


def _advice(path: str) -> str:
    """Return advice on a missing path that looks like a pattern, else ''."""
    if any(character in path for character in "*?%"):
        return "; patterns are not read: give the folder of the images"
    return ""


def _opener(path: Path) -> str:
    suffix = path.suffix.lower()
    if path.is_dir():
        return f"adv2e.sources.{_kind_of_folder(path)}"
    if suffix in OPENERS:
        return OPENERS[suffix]
    if suffix in PICTURES:
        if suffix in (".png", ".webp") and (kind := _animated(path)):
            return kind
        raise DataError(
            f"{path}: a single picture makes no events: --motion saccade moves a sensor before it;"
            " give the folder if it is one of many frames"
        )
    known = " ".join(suffix.lstrip(".") for suffix in OPENERS)
    raise DataError(
        f"{path}: frames cannot be read from {suffix or 'a file without suffix'}; give a folder of"
        f" images, a recording of a data set, or a file ({known})"
    )


def _animated(path: Path) -> str:
    """Return the module that reads an animated picture; nothing for one that stands still.

    Raises
    ------
    DataError
        It is an animated WebP.
    """
    from adv2e.sources.images.headers import read_header  # noqa: PLC0415  (needs OpenCV)

    if read_header(path.read_bytes()).pictures < 2:
        return ""
    if path.suffix.lower() == ".webp":
        raise DataError(
            f"{path}: animated WebP is not read; make an animated PNG or a video of it, or pictures"
        )
    return OPENERS[".apng"]


def _kind_of_folder(path: Path) -> str:
    # they need OpenCV; most of us do not
    from adv2e.files.zips import Members  # noqa: PLC0415
    from adv2e.sources import davis240c, gopro, listings  # noqa: PLC0415

    files = Members(path)
    if davis240c.is_recording(files):
        return "davis240c"
    if listings.find_listing(files):
        return "listings"
    return "gopro" if gopro.find_sequence(path) else "images.source"
