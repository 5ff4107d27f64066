r"""Packets of an AEDAT4 file, each a FlatBuffers table, mostly compressed.

============ ========================================================================
first bytes  ``#!AER-DAT4.0\r\n``
header       size (uint32), table IOHE: compression, place of the data table, and XML that
             describes each stream by its number
packets      number of the stream, bytes (int32 each), then the table that the stream holds,
             compressed: EVTS (events), FRME (a frame), others (IMU, triggers)
data table   at the end, compressed: table FTAB, where each packet is and its times
============ ========================================================================

A table inside a packet stands behind its own size (uint32).  All numbers are little-endian, times
are microseconds of the camera's clock, mostly since 1970.

Why no library is used: dv-processing hangs and aborts on damaged files, takes its events one by one
from Python, and is 100 MB on macOS; aedat only reads.

References
----------
.. [1] iniVation, "AEDAT 4.0", https://docs.inivation.com/software/software-advanced-usage/
   file-formats/aedat-4.0.html; schemas of dv-processing: include/dv-processing/data.
.. [2] Google, "FlatBuffers internals", https://flatbuffers.dev/internals/.
"""

from __future__ import annotations

import copy
import struct
from collections.abc import Iterator
from typing import Any

import numpy as np

from adv2e.errors import DataError, MissingExtraError
from adv2e.files.expansion import expand

MAGIC = b"#!AER-DAT4.0\r\n"
EVENT = np.dtype({
    "names": ["t", "x", "y", "p"], "formats": ["<i8", "<i2", "<i2", "u1"],
    "offsets": [0, 8, 10, 12], "itemsize": 16,
})  # fmt: skip
"""An event, as a packet holds it."""

NONE, LZ4 = 0, 1
_LZ4, _ZSTD = (1, 2), (3, 4)
"""Compressions, of two strengths each."""


class Table:
    """A table of FlatBuffers, whose fields are read by number.

    Parameters
    ----------
    data : bytes
    identifier : bytes
        Four letters by which it is known.
    label : str
        What it is called, for messages.

    Raises
    ------
    DataError
        From any method: it is damaged, or not of that kind.
    """

    def __init__(self, data: bytes, identifier: bytes, label: str) -> None:
        self._data, self._label = data, label
        if data[4:8] != identifier:
            raise DataError(f"{label}: holds no {identifier.decode()}: damaged")
        self._enter(self._number("<I", 0))

    def _enter(self, at: int) -> None:
        self._at = at
        self._fields = self._at - self._number("<i", self._at)
        self._size = self._number("<H", self._fields)

    def _number(self, kind: str, at: int) -> int:
        try:
            if at < 0:
                raise struct.error
            number: int = struct.unpack_from(kind, self._data, at)[0]
        except struct.error:
            raise DataError(f"{self._label}: damaged, or cut short") from None
        return number

    def _place(self, field: int) -> int:
        """Return the offset of a field; 0: the table does not have it."""
        entry = 4 + 2 * field
        offset = self._number("<H", self._fields + entry) if entry < self._size else 0
        return self._at + offset if offset else 0

    def number(self, field: int, kind: str, default: int = 0) -> int:
        """Return a number, of a kind that :mod:`struct` knows."""
        place = self._place(field)
        return self._number(kind, place) if place else default

    def array(self, field: int, dtype: Any) -> Any:
        """Return a vector as an array, or none of its elements where it is not there."""
        place = self._place(field)
        if not place:
            return np.empty(0, dtype)
        place += self._number("<I", place)
        count = self._number("<I", place)
        if place + 4 + count * np.dtype(dtype).itemsize > len(self._data):
            raise DataError(f"{self._label}: cut short: states {count:,} elements")
        return np.frombuffer(self._data, dtype, count, place + 4)

    def tables(self, field: int) -> Iterator[Table]:
        """Yield the tables of a vector of them."""
        place = self._place(field)
        place += self._number("<I", place) if place else 0
        for at, offset in enumerate(self.array(field, "<u4").tolist(), 1):
            table = copy.copy(self)
            table._enter(place + 4 * at + offset)
            yield table


def unpacked(data: bytes, compression: int, label: str) -> bytes:
    """Return the uncompressed content of a packet, without the size at its beginning.

    Raises
    ------
    DataError
        It is damaged, or compressed in an unknown way.
    MissingExtraError
        The package that uncompresses it is not installed.
    """
    if compression != NONE:
        reader, errors = _decompressor(compression, label)
        data = expand(reader, data, label, errors)
    (size,) = struct.unpack_from("<I", data) if len(data) >= 4 else (0,)
    if size != len(data) - 4:
        raise DataError(f"{label}: states {size:,} bytes and holds {max(0, len(data) - 4):,}")
    return data[4:]


def _decompressor(compression: int, label: str) -> tuple[Any, tuple[type[Exception], ...]]:
    """Return the decompressor for one packet, and its exceptions."""
    if compression in _LZ4:
        return lz4_frame(label).LZ4FrameDecompressor(), (RuntimeError, EOFError)
    if compression in _ZSTD:
        zstd = _zstd(label)
        return zstd.ZstdDecompressor(), (zstd.ZstdError, EOFError)
    raise DataError(f"{label}: compressed in a way that is not known, number {compression}")


def lz4_frame(label: str) -> Any:
    """Return the module ``lz4.frame``; MissingExtraError names `label`."""
    try:
        import lz4.frame  # noqa: PLC0415 - an optional package
    except ImportError:
        raise MissingExtraError(f"{label}: LZ4", "aedat4") from None
    return lz4.frame


def _zstd(label: str) -> Any:
    try:
        from compression import zstd  # noqa: PLC0415 - of Python 3.14
    except ImportError:
        try:
            from backports import zstd  # noqa: PLC0415 - an optional package
        except ImportError:
            raise MissingExtraError(f"{label}: Zstandard", "aedat4") from None
    return zstd
