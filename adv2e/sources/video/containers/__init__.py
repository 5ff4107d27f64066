"""What a video file says of itself: whether all of it is there, and when its pictures are shown.

FFmpeg decodes a file that was cut short without complaint, up to the cut.  The sizes written in
the file tell beforehand.  Only headers are read here, never pictures.
"""

from __future__ import annotations

import mmap
import struct
from collections.abc import Callable
from pathlib import Path

from adv2e.errors import DataError
from adv2e.sources.video.containers import (
    asf,
    avi,
    flv,
    gif,
    matroska,
    mp4,
    mpegps,
    mpegts,
    mxf,
    ogg,
    y4m,
)
from adv2e.sources.video.containers.base import Container, DamagedError

__all__ = ["Container", "examine"]

_FAMILIES: dict[bytes, Callable[[mmap.mmap], Container]] = {
    matroska.MAGIC: matroska.examine,
    y4m.MAGIC: y4m.examine,
    gif.MAGIC: gif.examine,
    flv.MAGIC: flv.examine,
    ogg.MAGIC: ogg.examine,
    asf.MAGIC: asf.examine,
    mxf.MAGIC: mxf.examine,
    mpegps.MAGIC: mpegps.examine,
}
"""How files begin, and what reads them."""
_MPEG_VIDEO = b"\x00\x00\x01\xb3"


def examine(path: Path, *, allow_damaged: bool = False) -> Container:
    """Return what the headers of a video file say; families other than these say nothing.

    Parameters
    ----------
    path : Path
    allow_damaged : bool
        Damage becomes one of the faults of what is returned.

    Raises
    ------
    DataError
        If the file is empty, cut short, or its structure is broken.
    """
    try:
        with path.open("rb") as file:
            if not file.read(1):
                raise DataError(f"{path}: an empty file")
            with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
                return _examine(data)
    except DamagedError as error:
        fault = str(error)
    except (struct.error, IndexError):
        fault = "its headers are damaged"
    except OSError as error:
        raise DataError(f"{path}: {error.strerror}") from error
    if not allow_damaged:
        raise DataError(f"{path}: {fault}")
    return Container(faults=[fault])


def _examine(data: mmap.mmap) -> Container:
    if data[4:8] in mp4.FIRST:
        return mp4.examine(data)
    if data[:4] == b"RIFF" and data[8:12] == b"AVI ":
        return avi.examine(data)
    for magic, family in _FAMILIES.items():
        if data[: len(magic)] == magic:
            return family(data)
    if layout := mpegts.layout_of(data):
        return mpegts.examine(data, *layout)
    # pictures of MPEG-1 and -2 without a container have no times
    return Container(decoding_times=data[:4] == _MPEG_VIDEO)
