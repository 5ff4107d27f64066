"""Long columns of an HDF5 file, compressed in threads and written chunk by chunk.

HDF5 compresses in the thread that writes.  Here whole chunks are compressed beforehand into what
its filters shuffle and deflate would read, and stored as they are, so that any reader of HDF5
opens them without plug-ins.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import h5py
import numpy as np
from numpy.typing import DTypeLike, NDArray

from adv2e.background import OrderedWork
from adv2e.formats.deflate import deflate_shuffled, deflate_words

CHUNK = 1 << 16
"""Rows of a chunk."""

LEVEL = 1
"""Level of deflate that the file states, and that of images."""

_SPARSE = 0.8
"""Share of times unlike the one before from which zlib, slow but with less to do, finds more."""

FILTERS: dict[str, Any] = {"compression": "gzip", "compression_opts": LEVEL}
"""Filters of a dataset whose chunks are zlib streams."""


def encode_image(image: NDArray[np.uint8]) -> bytes:
    """Return the bytes of an image of 8 bits as deflate leaves them."""
    return zlib.compress(np.ascontiguousarray(image).data, LEVEL)


@dataclass(frozen=True)
class Column:
    """A dataset that grows.

    Attributes
    ----------
    dtype : dtype
    of : callable
        Its values for some rows.
    """

    dtype: np.dtype[Any]
    of: Callable[[NDArray[Any]], NDArray[Any]]

    @property
    def shuffled(self) -> bool:
        """Whether the bytes of equal rank go together, as suits whole numbers."""
        return self.dtype.kind != "f"

    def encode(self, rows: NDArray[Any]) -> bytes:
        """Return the bytes of a chunk."""
        values = self.of(rows).astype(self.dtype, copy=False)
        if self.shuffled:
            return deflate_shuffled(values)
        if np.count_nonzero(values[1:] != values[:-1]) > _SPARSE * values.size:
            return zlib.compress(np.ascontiguousarray(values).data, LEVEL)
        return deflate_words(values)


class ChunkedColumns:
    """One-dimensional datasets of equal length that grow.

    Parameters
    ----------
    group : h5py.Group
        Where the datasets are made.
    columns : mapping of str to Column
        Their names, and what they hold.
    rows : dtype
        Type of the rows from which they are made.
    work : OrderedWork
        Threads that compress.
    """

    def __init__(
        self,
        group: h5py.Group,
        columns: Mapping[str, Column],
        rows: DTypeLike,
        work: OrderedWork,
    ) -> None:
        self._columns = list(columns.values())
        self._work = work
        self._datasets = [
            group.create_dataset(
                name,
                (0,),
                column.dtype,
                chunks=(CHUNK,),
                maxshape=(None,),
                shuffle=column.shuffled,
                track_times=False,
                **FILTERS,
            )
            for name, column in columns.items()
        ]
        self._rows = np.dtype(rows)
        self._written = 0  # rows handed on
        self._held = 0  # rows in the buffer
        self._buffer = self._fresh()

    def append(self, rows: NDArray[Any]) -> None:
        """Append rows."""
        begin = 0
        while begin < rows.size:
            take = min(CHUNK - self._held, rows.size - begin)
            self._buffer[self._held : self._held + take] = rows[begin : begin + take]
            self._held += take
            begin += take
            if self._held == CHUNK:
                self._hand_on()

    def finish(self) -> None:
        """Write what is held; the datasets are complete when the work is."""
        if self._held:
            self._hand_on()

    def _fresh(self) -> NDArray[Any]:
        # zeros: the last chunk is stored in full
        return np.zeros(CHUNK, self._rows)

    def _hand_on(self) -> None:
        begin, self._written = self._written, self._written + self._held
        end = self._written

        def take(chunks: list[bytes]) -> None:
            for dataset, data in zip(self._datasets, chunks, strict=True):
                dataset.resize((end,))
                dataset.id.write_direct_chunk((begin,), data)

        self._work.submit(self._encode, self._buffer, take=take)
        self._held, self._buffer = 0, self._fresh()

    def _encode(self, rows: NDArray[Any]) -> list[bytes]:
        return [column.encode(rows) for column in self._columns]
