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
from adv2e.sources.video.containers import avi, matroska, mp4, mpegts, parts, y4m
from adv2e.sources.video.containers.base import Container, DamagedError

__all__ = ["Container", "examine"]

_FAMILIES: dict[bytes, Callable[[mmap.mmap, Container], None]] = {
    matroska.MAGIC: matroska.examine,
    y4m.MAGIC: y4m.examine,
    parts.FLV: parts.flv,
    parts.GIF: parts.gif,
    parts.MPEG_PS: parts.mpeg_ps,
    parts.OGG: parts.ogg,
    parts.ASF: parts.asf,
}
"""How files begin, and what reads them."""
_MPEG_VIDEO = b"\x00\x00\x01\xb3"


def examine(path: Path, *, allow_damaged: bool = False) -> Container:
    """Return what the headers of a video file say; families other than these say nothing.

    `allow_damaged`: damage becomes one of the faults of what is returned.

    Raises
    ------
    DataError
        If the file is empty, cut short, or its structure is broken.
    """
    found = Container()
    try:
        with path.open("rb") as file:
            if not file.read(1):
                raise DataError(f"{path}: an empty file")
            with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
                _examine(data, found)
    except DamagedError as error:
        found.faults.append(str(error))
    except (struct.error, IndexError):
        found.faults.append("its headers are damaged")
    except OSError as error:
        raise DataError(f"{path}: {error.strerror}") from error
    if found.faults and not allow_damaged:
        raise DataError(f"{path}: {found.faults[0]}")
    return found


def _examine(data: mmap.mmap, found: Container) -> None:
    if data[4:8] in mp4.FIRST:
        mp4.examine(data, found)
    elif data[:4] == b"RIFF" and data[8:12] == b"AVI ":
        avi.examine(data, found)
    elif family := next((_FAMILIES[m] for m in _FAMILIES if data[: len(m)] == m), None):
        family(data, found)
    elif layout := mpegts.layout_of(data):
        mpegts.examine(data, *layout, found)
    else:
        # pictures of MPEG-1 and -2 without a container have no times
        found.decoding_times = data[:4] == _MPEG_VIDEO
