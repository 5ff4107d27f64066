"""Long columns of an HDF5 file, compressed in threads and written chunk by chunk.

HDF5 compresses in the thread that writes.  Here whole chunks are compressed beforehand into what
its filters shuffle and deflate would read, and stored as they are, so that any reader of HDF5
opens them without plug-ins.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import h5py
import numpy as np
from numpy.typing import DTypeLike, NDArray

from adv2e.background import OrderedWork
from adv2e.formats.compression import compress_shuffled

CHUNK = 1 << 16
"""Rows of a chunk."""

FILTERS: dict[str, Any] = {"compression": "gzip", "compression_opts": 1, "track_times": False}
"""Of a dataset whose chunks are zlib streams."""

Column = tuple[np.dtype[Any], Callable[[NDArray[Any]], NDArray[Any]]]
"""Type of a column, and what makes its values of rows."""


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
                *(name, (0,), dtype),
                chunks=(CHUNK,),
                maxshape=(None,),
                shuffle=True,
                **FILTERS,
            )
            for name, (dtype, _) in columns.items()
        ]
        self._size = 0  # rows handed on
        self._held = 0  # rows in the buffer
        self._buffer = np.zeros(CHUNK, rows)

    def append(self, rows: NDArray[Any]) -> None:
        """Append rows."""
        while rows.size:
            part, rows = np.split(rows, [CHUNK - self._held])
            self._buffer[self._held : self._held + part.size] = part
            self._held += part.size
            if self._held == CHUNK:
                self.finish()

    def finish(self) -> None:
        """Write what is held; the datasets are complete when the work is."""
        if not self._held:
            return
        begin, self._size = self._size, self._size + self._held
        end = self._size

        def take(chunks: list[bytes]) -> None:
            for dataset, data in zip(self._datasets, chunks, strict=True):
                dataset.resize((end,))
                dataset.id.write_direct_chunk((begin,), data)

        self._work.submit(self._encode, self._buffer, take=take)
        # zeros: the last chunk is stored in full
        self._held, self._buffer = 0, np.zeros(CHUNK, self._buffer.dtype)

    def _encode(self, rows: NDArray[Any]) -> list[bytes]:
        return [
            compress_shuffled(values(rows).astype(dtype, copy=False))
            for dtype, values in self._columns
        ]
