"""Arrays that wait for their turn, in bounded memory."""

from __future__ import annotations

import tempfile
from collections import deque
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

LIMIT_BYTES = 32 << 20
"""Memory that the arrays of one backlog take before those that follow wait on disk."""


@dataclass(frozen=True)
class _OnDisk:
    begin: int
    dtype: np.dtype[Any]
    shape: tuple[int, ...]


class Backlog:
    """Arrays with a time each, first in, first out; what is beyond a limit waits on disk.

    Parameters
    ----------
    folder : Path, optional
        Where the disk has room; by default, that of the system for temporary files.
    limit : int, optional
        Memory to take [bytes]; by default ``LIMIT_BYTES``; 0: all wait on disk.
    """

    def __init__(self, folder: Path | None = None, limit: int | None = None) -> None:
        self._folder, self._limit = folder, LIMIT_BYTES if limit is None else limit
        self._items: deque[tuple[int, NDArray[Any] | _OnDisk]] = deque()
        self._held = 0
        self._on_disk = 0
        self._end = 0
        self._file: IO[bytes] | None = None

    def __len__(self) -> int:
        return len(self._items)

    def time(self, number: int) -> int:
        """Return the time given with the array that is `number` places behind the first."""
        return self._items[number][0]

    def append(self, time: int, array: NDArray[Any]) -> None:
        """Put a copy of `array` at the end.

        Raises
        ------
        OSError
            The disk is full.
        """
        if self._held + array.nbytes <= self._limit:
            self._held += array.nbytes
            self._items.append((time, array.copy()))
            return
        if self._file is None:
            # nameless: it is gone whatever becomes of the process
            self._file = tempfile.TemporaryFile(dir=self._folder)  # noqa: SIM115
        self._file.seek(self._end)
        self._file.write(np.ascontiguousarray(array).view(np.uint8).data)
        self._items.append((time, _OnDisk(self._end, array.dtype, array.shape)))
        self._on_disk += 1
        self._end += array.nbytes

    def take(self) -> NDArray[Any]:
        _, item = self._items[0]
        if isinstance(item, _OnDisk):
            assert self._file is not None
            self._file.seek(item.begin)
            array: NDArray[Any] = np.empty(item.shape, item.dtype)
            self._file.readinto(array.view(np.uint8).data)  # type: ignore[attr-defined]
        else:
            array = item
        self.drop()
        return array

    def drop(self) -> None:
        _, item = self._items.popleft()
        if not isinstance(item, _OnDisk):
            self._held -= item.nbytes
            return
        self._on_disk -= 1
        if not self._on_disk and self._file is not None:  # give the disk back
            self._file.truncate(0)
            self._end = 0

    def close(self) -> None:
        self._items.clear()
        if self._file is not None:
            with suppress(OSError):  # what could not be written is not needed either
                self._file.close()
