"""Frames kept aside, encoded, until the events are all written.

Events and frames come interleaved in a way that depends on how the work was cut into chunks.  A
file must not: its frames come after its events.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

from numpy.typing import NDArray

from adv2e.background import OrderedWork


class StoredFrame(NamedTuple):
    """An encoded frame: time [ns], shape of the image, bytes."""

    t_ns: int
    shape: tuple[int, ...]
    data: bytes


class FrameSpool:
    """Encoded frames in a nameless temporary file, which is gone when closed.

    Parameters
    ----------
    folder : Path
        Where the disk has room: that of the output.
    work : OrderedWork
        Threads that encode.
    """

    def __init__(self, folder: Path, work: OrderedWork) -> None:
        self._file = tempfile.TemporaryFile(dir=folder)  # noqa: SIM115 - lives as long as the sink
        self._work = work
        self._frames: list[tuple[int, tuple[int, ...], int]] = []

    def add(self, t_ns: int, encode: Callable[[NDArray[Any]], bytes], image: NDArray[Any]) -> None:
        """Append a frame, which is encoded by `encode` in a thread."""

        def take(data: bytes) -> None:
            self._file.write(data)
            self._frames.append((t_ns, image.shape, len(data)))

        self._work.submit(encode, image, take=take)

    def __iter__(self) -> Iterator[StoredFrame]:
        self._file.seek(0)
        for t_ns, shape, size in self._frames:
            yield StoredFrame(t_ns, shape, self._file.read(size))

    def close(self) -> None:
        """Remove the frames."""
        self._file.close()
