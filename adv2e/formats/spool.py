"""Frames kept aside, encoded, until the events are all written.

Events and frames come interleaved in a way that depends on how the work was cut into chunks.  A
file must not: its frames come after its events.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class StoredFrame:
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
    """

    def __init__(self, folder: Path) -> None:
        self._file = tempfile.TemporaryFile(dir=folder)  # noqa: SIM115 - lives as long as the sink
        self._index: list[tuple[int, tuple[int, ...], int]] = []

    def add(self, t_ns: int, shape: tuple[int, ...], data: bytes) -> None:
        """Append an encoded frame."""
        self._file.write(data)
        self._index.append((t_ns, shape, len(data)))

    def __len__(self) -> int:
        return len(self._index)

    def __iter__(self) -> Iterator[StoredFrame]:
        self._file.seek(0)
        for t_ns, shape, size in self._index:
            yield StoredFrame(t_ns, shape, self._file.read(size))

    def close(self) -> None:
        """Remove the frames."""
        self._file.close()
