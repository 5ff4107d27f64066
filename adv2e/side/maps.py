"""Masks, depth and optical flow: a map of numbers for each frame, or for each of its pixels.

========== ===================================== ================================================
kind       read                                  written
========== ===================================== ================================================
``masks``  PNG, ``.npy``                         as they were read; of a PNG with a palette, the
                                                 indices are the numbers, and the palette stays
``depth``  PNG, ``.npy``                         as they were read: they do not change with scale
``flow``   PNG of KITTI and DSEC, ``.flo``,      ``.npy``, float32 (rows, columns, 2): columns and
           ``.npy`` (rows, columns, 2)           rows moved [px of the sensor]; NaN: not known
========== ===================================== ================================================

A pixel of the sensor has the number at the point nearest to its middle, for a mean of two classes
is a third.  Where there is no frame, it is 0, and flow is NaN.  ``KIND.txt`` has a line for each
file, ``time name``, of flow ``from to name``; it is read, too.

References
----------
.. [1] S. Baker et al., "A Database and Evaluation Methodology for Optical Flow", IJCV 92, 2011
   (``.flo``).
.. [2] M. Menze, A. Geiger, "Object Scene Flow for Autonomous Vehicles", CVPR 2015; the development
   kit of KITTI (flow in PNG: 64 u + 2^15, 64 v + 2^15, valid).
"""

from __future__ import annotations

import io
import struct
import zlib
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import PurePosixPath
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from adv2e.errors import DataError
from adv2e.files.zips import read_array
from adv2e.geometry import Size
from adv2e.side.placement import Clock, Placement
from adv2e.side.tables import unit_of
from adv2e.sources.images.headers import png_chunks
from adv2e.sources.times.rates import NUMBER, nine_decimals, parse_ns

SUFFIXES = (".png", ".npy", ".flo")
_FLO = 202021.25
_HEAD = struct.Struct("<fii")
_PNG, _COLOUR = b"\x89PNG\r\n\x1a\n", 25
"""Of a PNG: how it begins, and where the kind of its colours stands, behind the bits of each."""
_GREY, _INDEXED = b"\0", b"\3"


@dataclass(frozen=True)
class Maps:
    """Files of a kind, and the times of each where a list has them.

    Attributes
    ----------
    kind : str
        masks, depth or flow.
    label : str
        The folder, for messages.
    names : list of str
        In the order of time.
    read : callable
        Returns the bytes of a file.
    times : (files, 1) or (files, 2) int64, optional
        Its time on the source's own clock, of flow its first and last [ns].
    """

    kind: str
    label: str
    names: Sequence[str]
    read: Callable[[str], bytes]
    times: NDArray[np.int64] | None = None

    def map_of(self, name: str, place: Placement) -> NDArray[Any]:
        """Return a map of the frame; DataError if it is none, or of another size."""
        return self._map_in(self.read(name), name, place)

    def placed(self, name: str, place: Placement) -> NDArray[Any]:
        """Return a map on the sensor; DataError as :meth:`map_of`."""
        return self._on_sensor(self.map_of(name, place), place)

    def _map_in(self, data: bytes, name: str, place: Placement) -> NDArray[Any]:
        found = decoded(data, f"{self.label}/{PurePosixPath(name).name}", self.kind)
        place.check(Size(found.shape[1], found.shape[0]), f"{self.label}/{name}")
        return found

    def _on_sensor(self, found: NDArray[Any], place: Placement) -> NDArray[Any]:
        if self.kind != "flow":
            return place.taken(found)
        steps = np.array(place.scale, np.float32) * (-1 if place.turned else 1)
        return place.taken(found, np.nan) * steps

    def frames(self, clock: Clock) -> NDArray[np.int64]:
        """Return the numbers of the frames that each is of, (files, 1), or (files, 2) of flow.

        Raises
        ------
        DataError
            They cannot be told.
        """
        ends = np.arange(2 if self.kind == "flow" else 1)
        if self.times is None:
            first = np.array(clock.numbers(self.names, self.label, len(ends) - 1), np.int64)
            return first[:, np.newaxis] + ends
        shown = clock.frames if clock.own is None else clock.own
        apart = np.abs(self.times[..., np.newaxis] - shown)
        if np.any(apart.min(-1) > np.diff(shown).min() / 4):
            raise DataError(f"{self.label}: its times are not those of the frames")
        return np.asarray(apart.argmin(-1), np.int64)

    def when(self, clock: Clock) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
        """Return the times on the events' clock [ns], (files, 1 or 2), and which are wanted."""
        if self.times is None:
            numbers, last = self.frames(clock), len(clock.frames) - 1
            times, wanted = clock.of_frames(np.minimum(numbers, last))
            wanted &= numbers <= last
        else:
            times, wanted = clock.of(self.times)
        return times, np.asarray(wanted.all(axis=1))

    def written(self, place: Placement, clock: Clock) -> Iterator[tuple[str, bytes]]:
        """Yield names and bytes of the maps on the sensor that are wanted, and of their list.

        Raises
        ------
        DataError
            At the end: some cannot be read, and are left out.
        """
        lines: list[str] = []
        wrong: list[str] = []
        times, wanted = self.when(clock)
        for number in np.flatnonzero(wanted).tolist():
            try:
                data = self.read(self.names[number])
                made = self._on_sensor(self._map_in(data, self.names[number], place), place)
            except DataError as error:
                wrong.append(str(error))
                continue
            suffix = PurePosixPath(self.names[number]).suffix.lower()
            suffix = ".npy" if self.kind == "flow" else suffix
            name = f"{self.kind}/{len(lines):08d}{suffix}"
            palette = _palette(data) if self.kind == "masks" else b""
            yield name, _encoded(made, suffix, palette)
            lines.append(" ".join([*map(nine_decimals, times[number]), name]) + "\n")
        yield f"{self.kind}.txt", "".join(lines).encode()
        if wrong:
            raise DataError(f"{wrong[0]}; {len(wrong)} of {len(self.names)} {self.kind}")


def listed(text: str, label: str, ends: int) -> tuple[list[str], NDArray[np.int64], list[str]]:
    """Return names, if there are any, and times [ns] of a list, by time; what is doubtful of it.

    Raises
    ------
    DataError
        A line has not `ends` times and perhaps a name; the text names it.
    """
    rows: list[list[str]] = []
    for number, line in enumerate(text.splitlines(), 1):
        words = line.replace(",", " ").split()
        if not words or words[0].startswith(("#", "%")):
            continue
        if len(words) not in (ends, ends + 1) or not all(map(NUMBER.fullmatch, words[:ends])):
            what = "a time" if ends == 1 else "two times"
            raise DataError(f"{label} line {number}: must be {what}, and a name")
        rows.append(words)
    unit, told = unit_of([one for words in rows for one in words[:ends]], None, label)
    try:
        times = [tuple(parse_ns(one, unit) for one in words[:ends]) for words in rows]
    except ValueError as error:
        raise DataError(f"{label}: {error}") from None
    order = sorted(range(len(rows)), key=times.__getitem__)
    names = [rows[at][ends] for at in order if len(rows[at]) > ends]
    return names, np.array([times[at] for at in order], np.int64).reshape(-1, ends), told


def decoded(data: bytes, label: str, kind: str) -> NDArray[Any]:
    """Return the map in a file: (rows, columns[, channels]); of flow, (rows, columns, 2) float32.

    Raises
    ------
    DataError
        It holds none.
    """
    if label.lower().endswith(".flo"):
        if len(data) < _HEAD.size or (head := _HEAD.unpack_from(data))[0] != _FLO:
            raise DataError(f"{label}: not a .flo file")
        if len(data) != _HEAD.size + 8 * head[1] * head[2]:
            raise DataError(f"{label}: cut short, or not of {head[1]}x{head[2]} pixels")
        found = np.frombuffer(data, "<f4", offset=_HEAD.size).reshape(head[2], head[1], 2)
        return np.where(np.abs(found) > 1e9, np.nan, found)  # as that format says: not known
    if label.lower().endswith(".npy"):
        found = read_array(io.BytesIO(data), len(data), label)
        if kind == "flow" and found.ndim == 3 and found.shape[2] == 2:
            return found.astype(np.float32)
        if kind == "flow" or found.ndim not in (2, 3):
            form = "(rows, columns, 2)" if kind == "flow" else "(rows, columns)"
            raise DataError(f"{label}: shape {found.shape}, must be {form}")
        return found
    if kind == "masks" and _palette(data):
        return _indices(data, label)
    image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED) if data else None
    if image is None:
        raise DataError(f"{label}: not a PNG that can be read")
    if kind != "flow":
        return image
    if image.dtype != np.uint16 or image.ndim != 3:
        raise DataError(f"{label}: flow in a PNG has three channels of 16 bits, as of KITTI")
    flow = (image[..., 2:0:-1].astype(np.float32) - 2**15) / 64  # OpenCV has blue first
    flow[image[..., 0] == 0] = np.nan
    return flow


def _encoded(array: NDArray[Any], suffix: str, palette: bytes) -> bytes:
    if suffix == ".png":
        done, data = cv2.imencode(".png", array)
        assert done
        return _with_palette(data.tobytes(), palette) if palette else data.tobytes()
    file = io.BytesIO()
    np.save(file, array)
    return file.getvalue()


# ---- A PNG of indices has the same data as a grey one, another head, and a palette (PNG, third
# edition, W3C 2025, section 4.4); OpenCV reads its colours alone.


def _palette(data: bytes) -> bytes:
    """Return the palette of a PNG; empty where it has none."""
    if data[:8] != _PNG or data[_COLOUR : _COLOUR + 1] != _INDEXED:
        return b""
    return next((body for kind, body in png_chunks(data) if kind == b"PLTE"), b"")


def _indices(data: bytes, label: str) -> NDArray[Any]:
    kept = (pair for pair in png_chunks(data) if pair[0] in (b"IHDR", b"IDAT", b"IEND"))
    grey = _joined(kept, _GREY)
    image = cv2.imdecode(np.frombuffer(grey, np.uint8), cv2.IMREAD_UNCHANGED)
    if image is None:
        raise DataError(f"{label}: not a PNG that can be read")
    return np.asarray(image // (255 // (2 ** data[_COLOUR - 1] - 1)))


def _with_palette(grey: bytes, palette: bytes) -> bytes:
    head, *rest = png_chunks(grey)
    return _joined([head, (b"PLTE", palette), *rest], _INDEXED)


def _joined(chunks: Iterable[tuple[bytes, bytes]], colour: bytes) -> bytes:
    """Return a PNG of chunks, whose head says how its numbers are to be taken."""
    made = bytearray(_PNG)
    for kind, body in chunks:
        own = body[:9] + colour + body[10:] if kind == b"IHDR" else body
        made += struct.pack(">I", len(own)) + kind + own
        made += struct.pack(">I", zlib.crc32(kind + own))
    return bytes(made)
