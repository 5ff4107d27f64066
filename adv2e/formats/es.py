"""Events in Event Stream, version 2, in files that end on ``.es``; of its types, DVS events.

======== =============================================
bytes    content
======== =============================================
0-11     ``Event Stream``
12-14    version: major, minor, patch
15       type: 1, DVS events
16-19    width and height, 16 bits each, little endian
======== =============================================

Then, for each event:

====== ==============================================================================
byte   content
====== ==============================================================================
0      bits 1-7: time since the event before [us], up to 126; bit 0: polarity
1-2    column, little endian
3-4    row, from the bottom
====== ==============================================================================

Before an event, a byte 0xFF is 127 us more, and 0xFE says nothing.  Times are from 0 on, so empty
time makes a file long: 28 MB an hour.  Up to 9.5 hours are written.

References
----------
.. [1] A. Marcireau, "Event Stream", https://github.com/neuromorphic-paris/event_stream.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from adv2e.errors import DataError
from adv2e.events import Events
from adv2e.formats.event_file import Columns, EventFile, Facts, described_geometry
from adv2e.formats.sink import Request, Writer

_MAGIC = b"Event Stream"
_VERSION = 2, 0, 0
_TYPES = "generic events", "DVS events", "ATIS events", "display events", "colour events"
_DVS = 1
_HEADER = 20  # bytes
_OVERFLOW, _RESET = 0xFF, 0xFE
_LONGEST = 127  # us of an overflow
_EVENT = 5  # bytes
_READ = 1 << 20  # bytes
_WRITE = 1 << 18  # events, or bytes of empty time


def open_es(path: Path, facts: Facts) -> EventFile:
    """Open an Event Stream file.

    Raises
    ------
    DataError
        It is of another version, or of another type than DVS events.
    """
    with path.open("rb") as file:
        header = file.read(_HEADER)
    if len(header) < _HEADER:
        raise DataError(f"{path}: cut short, within the header")
    version = tuple(header[12:15])
    if version[0] != _VERSION[0]:
        raise DataError(
            f"{path}: Event Stream of version {'.'.join(map(str, version))}, must be {_VERSION[0]}"
        )
    if header[15] != _DVS:
        names = dict(enumerate(_TYPES))
        raise DataError(
            f"{path}: holds {names.get(header[15], f'events of type {header[15]}')}, must be DVS"
            " events"
        )
    width, height = (int(size) for size in np.frombuffer(header[16:20], "<u2"))
    facts.state(described_geometry({"width": width, "height": height}), "the header")

    def parts() -> Iterator[Columns]:
        total, t, rest = path.stat().st_size, 0, b""
        with path.open("rb") as file:
            file.seek(_HEADER)
            while data := file.read(_READ):
                block = np.frombuffer(rest + data, np.uint8)
                events, waits, rest = _split(block)
                times = t + np.cumsum(waits[:-1] + (events[:, 0] >> 1))
                t = int(times[-1] if times.size else t) + int(waits[-1])
                x, y = (
                    events[:, k].astype(np.int32) | events[:, k + 1].astype(np.int32) << 8
                    for k in (1, 3)
                )
                yield times, x, height - 1 - y, events[:, 0] & 1
                facts.progress(file.tell(), total)
        if rest:
            facts.problems.append(f"the last {len(rest)} bytes are no whole event: left out")

    return EventFile("es", facts, parts)


def _split(block: NDArray[np.uint8]) -> tuple[NDArray[np.uint8], NDArray[np.int64], bytes]:
    """Return the events, (n, 5), the empty time before each and at the end, and what is left.

    Bytes from 0xFE on stand alone where an event may begin.  Where that is depends on all before,
    but only on those that stand alone, which come in few runs.
    """
    is_high = np.zeros(block.size + 2, np.int8)
    np.greater_equal(block, _RESET, out=is_high[1:-1].view(np.bool_))
    edges = np.flatnonzero(np.diff(is_high))
    begin = 0  # of some event before the run
    alone: list[tuple[int, int]] = []
    for run, end in edges.reshape(-1, 2).tolist():
        at = run + (begin - run) % _EVENT
        if at < end:
            begin = end
            alone.append((at, end))
    first, last = np.array(alone, np.int64).reshape(-1, 2).T
    step = np.zeros(block.size + 1, np.int8)
    step[first] = 1
    step[last] -= 1
    of_events = block[np.cumsum(step[:-1], dtype=np.int8) == 0]
    count, left = divmod(of_events.size, _EVENT)
    overflows = np.concatenate([[0], np.cumsum(block == _OVERFLOW, dtype=np.int32)])
    lengths = last - first
    which = (first - (np.cumsum(lengths) - lengths)) // _EVENT
    waits = np.zeros(count + 1, np.int64)
    waits[which] = (overflows[last] - overflows[first]) * _LONGEST
    rest = of_events[count * _EVENT :].tobytes() if left else b""
    return of_events[: count * _EVENT].reshape(count, _EVENT), waits, rest


class EsWriter(Writer):
    """Writes Event Stream; see :class:`Writer`."""

    def __init__(self, request: Request, stack: ExitStack, *temporary: Path) -> None:
        (path,) = temporary
        self._file = stack.enter_context(path.open("wb"))
        size = np.array([request.width, request.height], "<u2").tobytes()
        self._file.write(_MAGIC + bytes(_VERSION) + bytes([_DVS]) + size)
        self._rows = request.height
        self._t = 0

    def write_events(self, events: Events) -> None:
        """Append events."""
        for begin in range(0, events.size, _WRITE):
            part = events[begin : begin + _WRITE]
            far = np.flatnonzero(np.diff(part["t"]) > _WRITE) + 1
            for piece in np.split(part, far):
                self._pass_time(int(piece["t"][0]))
                self._write(piece)

    def _pass_time(self, t: int) -> None:
        """Write the time up to an event, but for what the event holds itself."""
        overflows, _ = divmod(t - self._t, _LONGEST)
        self._t += overflows * _LONGEST
        while overflows:
            count = min(overflows, _WRITE)
            self._file.write(bytes([_OVERFLOW]) * count)
            overflows -= count

    def _write(self, events: Events) -> None:
        passed = np.diff(events["t"], prepend=self._t)
        self._t = int(events["t"][-1])
        overflows, left = np.divmod(passed, _LONGEST)
        end = np.cumsum(overflows + _EVENT)
        data = np.full(int(end[-1]), _OVERFLOW, np.uint8)
        at = end - _EVENT
        y = self._rows - 1 - events["y"]
        data[at] = left << 1 | events["p"]
        for k, value in ((1, events["x"]), (3, y)):
            data[at + k] = value & 0xFF
            data[at + k + 1] = value >> 8
        self._file.write(data.data)
