"""A recording as files: the layout of the Event-Camera Dataset (DAVIS240C), folder or zip.

``events.txt`` (seconds x y polarity), ``images.txt`` (seconds name), ``images/frame_%08d.png``.

Source: Mueggler, Rebecq, Gallego, Delbruck, Scaramuzza, "The event-camera dataset and simulator",
2017; W3C, "Portable Network Graphics (PNG) Specification", 2003.
"""

from __future__ import annotations

import struct
import zipfile
import zlib
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from camera.readout import Stream
from camera.shutter import Frame

_SIGNATURE = b"\x89PNG\r\n\x1a\n"


def png(image: NDArray[Any]) -> bytes:
    """Return a grey image, uint8 or uint16, as a PNG file."""
    height, width = image.shape
    depth = 8 * image.dtype.itemsize
    data = image.astype(f">u{image.dtype.itemsize}").view(np.uint8).reshape(height, -1)
    lines = np.hstack([np.zeros((height, 1), np.uint8), data])  # filter 0 before each line
    header = struct.pack(">IIBBBBB", width, height, depth, 0, 0, 0, 0)
    packed = zlib.compress(lines.tobytes(), 1)
    return _SIGNATURE + _chunk(b"IHDR", header) + _chunk(b"IDAT", packed) + _chunk(b"IEND", b"")


def _chunk(kind: bytes, data: bytes) -> bytes:
    check = zlib.crc32(kind + data)
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", check)


def events_text(stream: Stream, width: int) -> bytes:
    """Return the lines of ``events.txt``: times in whole microseconds, written with 9 decimals."""
    us = np.rint(stream.time * 1e6).astype(np.int64)
    columns = (us, stream.pixel % width, stream.pixel // width, stream.polarity > 0)
    lines = (
        f"{t // 1_000_000}.{t % 1_000_000:06d}000 {x} {y} {p:d}\n"
        for t, x, y, p in zip(*(column.tolist() for column in columns), strict=True)
    )
    return "".join(lines).encode("ascii")


def members(stream: Stream, frames: Iterable[Frame], width: int) -> Iterator[tuple[str, bytes]]:
    """Yield (name, content) of all files."""
    yield "events.txt", events_text(stream, width)
    lines = []
    for number, frame in enumerate(frames):
        name = f"images/frame_{number:08d}.png"
        lines.append(f"{frame.stamp:.9f} {name}\n")
        yield name, png(frame.image)
    yield "images.txt", "".join(lines).encode("ascii")


def write(path: Path, files: Iterable[tuple[str, bytes]]) -> None:
    """Write `files` into a zip archive if `path` ends so, else into a new folder."""
    if path.suffix == ".zip":
        with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=4) as archive:
            for name, content in files:
                archive.writestr(zipfile.ZipInfo(name), content, zipfile.ZIP_DEFLATED)
        return
    (path / "images").mkdir(parents=True)
    for name, content in files:
        (path / name).write_bytes(content)
