"""Long columns of an HDF5 file, compressed in threads and written chunk by chunk.

HDF5 compresses in the thread that writes.  Here whole chunks are compressed beforehand with the
same two filters, shuffle and deflate, and stored as they are, so that any reader of HDF5 opens
them without plug-ins.
"""

from __future__ import annotations

import zlib
from collections.abc import Mapping
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from adv2e.sinks.work import OrderedWork

CHUNK = 1 << 16
"""Rows of a chunk."""

LEVEL = 1
"""Level of deflate: half the time of level 4 for a tenth more bytes."""

FILTERS: dict[str, Any] = {"compression": "gzip", "compression_opts": LEVEL, "shuffle": True}
"""Filters of a dataset whose chunks :func:`encode` makes."""


def encode(chunk: NDArray[Any], strategy: int = zlib.Z_DEFAULT_STRATEGY) -> bytes:
    """Return the bytes of a chunk as shuffle (bytes of equal rank together) and deflate leave it.

    Parameters
    ----------
    chunk : array
    strategy : int
        What deflate looks for; :data:`zlib.Z_RLE`, runs only, takes less time where there is
        nothing else to find.

    References
    ----------
    .. [1] HDF5 reference, H5Pset_shuffle, H5Pset_deflate.
    """
    flat = np.ascontiguousarray(chunk).reshape(-1)
    ranks = flat.view(np.uint8).reshape(flat.size, flat.itemsize)
    deflate = zlib.compressobj(LEVEL, strategy=strategy)
    return deflate.compress(np.ascontiguousarray(ranks.T).data) + deflate.flush()


class ChunkedColumns:
    """One-dimensional datasets of equal length that grow.

    Parameters
    ----------
    group : h5py.Group
        Where the datasets are made.
    types : mapping of str to dtype
        Their names and types.
    work : OrderedWork
        Threads that compress.
    """

    def __init__(
        self, group: h5py.Group, types: Mapping[str, np.dtype[Any]], work: OrderedWork
    ) -> None:
        self._types = dict(types)
        self._work = work
        self._datasets = {
            name: group.create_dataset(
                name, (0,), dtype, chunks=(CHUNK,), maxshape=(None,), track_times=False, **FILTERS
            )
            for name, dtype in self._types.items()
        }
        self._written = 0  # rows handed on
        self._held = 0  # rows in the buffers
        self._buffers = self._fresh()

    def append(self, columns: Mapping[str, NDArray[Any]]) -> None:
        """Append rows: an array for each column, all of the same length."""
        count = len(next(iter(columns.values())))
        begin = 0
        while begin < count:
            take = min(CHUNK - self._held, count - begin)
            for name, buffer in self._buffers.items():
                buffer[self._held : self._held + take] = columns[name][begin : begin + take]
            self._held += take
            begin += take
            if self._held == CHUNK:
                self._hand_on()

    def finish(self) -> None:
        """Write what is held; the datasets are complete when the work is."""
        if self._held:
            self._hand_on()

    def _fresh(self) -> dict[str, NDArray[Any]]:
        # zeros: the last chunk is stored in full
        return {name: np.zeros(CHUNK, dtype) for name, dtype in self._types.items()}

    def _hand_on(self) -> None:
        end = self._written + self._held
        for name, buffer in self._buffers.items():
            self._submit(self._datasets[name], self._written, end, buffer)
        self._written, self._held, self._buffers = end, 0, self._fresh()

    def _submit(self, dataset: h5py.Dataset, begin: int, end: int, buffer: NDArray[Any]) -> None:
        def take(data: bytes) -> None:
            dataset.resize((end,))
            dataset.id.write_direct_chunk((begin,), data)

        # bytes of whole numbers are noise or runs; only float times have more to find
        strategy = zlib.Z_DEFAULT_STRATEGY if buffer.dtype.kind == "f" else zlib.Z_RLE
        self._work.submit(encode, buffer, strategy, take=take)
