"""HDF5 in the layout of the data set DSEC, which loaders of DSEC, RVT and TUM-VIE read.

=========================== ====================================================================
/events/x, /events/y        uint16, column and row
/events/t                   uint32 [us], from t_offset; of ours int64 if they go beyond 71 minutes
/events/p                   uint8, 1 is ON and 0 is OFF
/events/width, height       of ours, and of RVT's: the sensor [pixels]
/ms_to_idx                  uint64, for each millisecond of t the first event at it or after
/t_offset                   int64 [us], to be added to t
=========================== ====================================================================

The slicer of DSEC rounds the end of a part up to whole milliseconds and needs an entry for that, so
that ours go on to the first millisecond after the last event, which is how many events there are.
``t_offset`` of ours is zero, unless events begin before zero or more than 71 minutes after it: then
it is the time of the first one.  Files of DSEC are compressed with Blosc, for which h5py needs a
plug-in, and do not state the size of the sensor; ours are compressed with gzip.

References
----------
.. [1] M. Gehrig et al., "DSEC: A Stereo Event Camera Dataset for Driving Scenarios", RA-L 2021,
   arXiv:2103.06011; github.com/uzh-rpg/DSEC, scripts/utils/eventslicer.py.
"""

from __future__ import annotations

from contextlib import ExitStack
from functools import partial
from pathlib import Path

import numpy as np

from adv2e.errors import DataError
from adv2e.events import Events
from adv2e.formats import hdf5
from adv2e.formats.event_file import EventFile, Facts
from adv2e.formats.hdf5_writer import CHUNK, FILTERS, Column, Hdf5Writer, Milliseconds
from adv2e.formats.sink import Request
from adv2e.ticks import US

COLUMNS = ("events/t", "events/x", "events/y", "events/p")

_WORD = 1 << 32


def open_dsec(path: Path, facts: Facts) -> EventFile:
    """Open a file of this layout.

    Raises
    ------
    DataError
        Columns of different lengths or kinds, or times beyond 146 years; without ``ms_to_idx``,
        their unit may be another and is told from them.
    """
    with hdf5.opened(path) as file:
        hdf5.describe(file, facts, "events")
        offset = hdf5.number(file, "t_offset") if hdf5.find(file, "t_offset") is not None else 0
        columns = hdf5.columns(file, COLUMNS)
        unit_ns = US
        if hdf5.find(file, "ms_to_idx") is None:
            t, x, y = (column[: hdf5.PART] for column in columns[:3])
            whole = t.dtype.kind != "f"
            facts.time_unit = facts.time_unit or hdf5.unit_of(columns[0])
            unit_ns = facts.unit_of_events(t, x, y, facts.geometry, whole=whole).ns

    if abs(offset) > 1 << 53:
        raise DataError(f"{path}: t_offset of {offset} us is beyond 146 years")
    return EventFile(
        "dsec",
        facts,
        partial(hdf5.parts, path, COLUMNS, facts),
        unit_ns=unit_ns,
        offset_us=offset,
        times="events/t",
    )


class DsecWriter(Hdf5Writer):
    """Writes an HDF5 file in the layout ``dsec``."""

    layout = "dsec"

    def __init__(self, request: Request, stack: ExitStack, *temporary: Path) -> None:
        super().__init__(request, stack, *temporary)
        self._index = Milliseconds(self, "ms_to_idx")
        self._offset: int | None = None
        self._words = [0]  # events before each multiple of 2**32 us

    def columns(self) -> list[Column]:
        """Return the columns of the events."""
        return [
            Column("events/x", np.uint16, lambda events: events["x"]),
            Column("events/y", np.uint16, lambda events: events["y"]),
            Column("events/t", np.uint32, lambda events: self._times(events) % _WORD),
            Column("events/p", np.uint8, lambda events: events["p"]),
        ]

    def _times(self, events: Events) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
        return events["t"] - (self._offset or 0)

    def chunk_made(self, begin: int, events: Events) -> None:
        """Take note of a chunk."""
        super().chunk_made(begin, events)
        if self._offset is None:
            first = int(events["t"][0])
            self._offset = 0 if 0 <= first < _WORD else first
        times = self._times(events)
        self._index.add(begin, times)
        while times[-1] >= len(self._words) * _WORD:
            self._words.append(begin + int(np.searchsorted(times, len(self._words) * _WORD)))

    def flush(self) -> None:
        """Hand over the last of the index."""
        self._index.flush(self.size)

    def complete(self) -> None:
        """Write the offset, the size of the sensor, and times of 64 bits where they are needed."""
        if len(self._words) > 1:
            self._widen()
        self.file["t_offset"] = np.int64(self._offset or 0)
        self.file["events/width"] = np.int64(self.request.width)
        self.file["events/height"] = np.int64(self.request.height)

    def _widen(self) -> None:
        """Put times of 64 bits, of which only the lower 32 were kept, in the place of those."""
        short = self.file["events/t"]
        wide = self.file.create_dataset(
            "events/wide",
            short.shape,
            np.int64,
            **(FILTERS | {"chunks": (CHUNK,), "maxshape": (None,), "shuffle": True}),
        )
        for begin in range(0, self.size, CHUNK):
            part = short[begin : begin + CHUNK].astype(np.int64)
            numbers = np.arange(begin, begin + part.size)
            words = np.searchsorted(self._words, numbers, side="right") - 1
            wide[begin : begin + part.size] = part + words * _WORD
        del self.file["events/t"]
        self.file.move("events/wide", "events/t")
