"""What a video file says of itself: whether all of it is there, and when its pictures are shown.

FFmpeg decodes a file that was cut short without complaint, up to the cut.  The sizes written in
the file tell beforehand.  Only headers are read here, never pictures.
"""

from __future__ import annotations

import mmap
import struct
from pathlib import Path

from adv2e.errors import DataError
from adv2e.sources.containers import avi, matroska, mp4, y4m
from adv2e.sources.containers.base import Container, DamagedError

__all__ = ["Container", "examine"]

_DECODING_TIMES = {
    b"\x30\x26\xb2\x75\x8e\x66\xcf\x11": 1_000_000,  # ASF, WMV
    b"\x00\x00\x01\xba": 11_112,  # MPEG program stream: ticks of 90 kHz
    b"\x00\x00\x01\xb3": 11_112,  # MPEG video without a container
    b"\x06\x0e\x2b\x34": 1000,  # MXF
}
"""How files begin that state no times of showing for all pictures, and the step of those."""


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
    if data[4:8] in (b"ftyp", b"moov", b"mdat", b"wide", b"free", b"skip", b"pnot"):
        return mp4.examine(data)
    if data[:4] == b"RIFF" and data[8:12] == b"AVI ":
        return avi.examine(data)
    if data[:4] == b"\x1a\x45\xdf\xa3":
        return matroska.examine(data)
    if data[: len(y4m.MAGIC)] == y4m.MAGIC:
        return y4m.examine(data)
    for magic, tick_ns in _DECODING_TIMES.items():
        if data[: len(magic)] == magic:
            return Container(decoding_times=True, tick_ns=tick_ns)
    return Container()
