"""What a video file says of itself: whether all of it is there, and when its pictures end.

FFmpeg decodes a file that was cut short without complaint, up to the cut.  The sizes written in
the file tell beforehand.  Only headers are read here, never pictures.
"""

from __future__ import annotations

import mmap
import struct
from pathlib import Path

from adv2e.errors import DataError
from adv2e.sources.containers import avi, matroska, mp4
from adv2e.sources.containers.base import Container, DamagedError

__all__ = ["Container", "examine"]


def examine(path: Path) -> Container:
    """Return what the headers of a video file say; families other than three say nothing.

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
        raise DataError(f"{path}: {error}") from error
    except (struct.error, IndexError) as error:
        raise DataError(f"{path}: its headers are damaged") from error
    except OSError as error:
        raise DataError(f"{path}: {error.strerror}") from error


def _examine(data: mmap.mmap) -> Container:
    if data[4:8] in (b"ftyp", b"moov", b"mdat", b"wide", b"free", b"skip"):
        return mp4.examine(data)
    if data[:4] == b"RIFF" and data[8:12] == b"AVI ":
        return avi.examine(data)
    if data[:4] == b"\x1a\x45\xdf\xa3":
        return matroska.examine(data)
    return Container()
