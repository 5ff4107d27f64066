"""HDF5 in the layout of the data set MVSEC, of its left DAVIS or the right one.

================================= ==============================================================
/davis/left/events                float64 (events, 4): column, row, time [s], polarity -1/+1
/davis/left/image_raw             uint8 (frames, rows, columns), grey
/davis/left/image_raw_ts          float64 (frames) [s]
/davis/left/image_raw_event_inds  int64 (frames), the last event before each
================================= ==============================================================

The right camera is ``davis/right``.  Times of the data set are dates.  The size of the sensor is
that of the frames.

References
----------
.. [1] A. Z. Zhu et al., "The Multivehicle Stereo Event Camera Dataset: An Event Camera Dataset for
   3D Perception", RA-L 2018, arXiv:1801.10202.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from adv2e.events import Events
from adv2e.formats import hdf5
from adv2e.formats.event_file import EventFile, Facts
from adv2e.formats.hdf5_writer import Column, Hdf5Writer
from adv2e.formats.tables import Table, open_table
from adv2e.ticks import S

_CAMERA = "davis/left"


def _table(side: str, side_of_frames: str) -> Table:
    images = f"davis/{side_of_frames}/image_raw"
    return Table(f"davis/{side}/events", "xytp", images, f"{images}_ts")


_TABLE = _table("left", "left")


def open_mvsec(path: Path, facts: Facts) -> EventFile:
    """Open a file of this layout; errors as :func:`adv2e.formats.tables.open_table`."""
    with hdf5.opened(path) as file:
        table = _table(*hdf5.choose(file, facts, "davis/*/events", "davis/*/image_raw"))
    return open_table(path, facts, "mvsec", table, S, S)


class MvsecWriter(Hdf5Writer):
    """Writes an HDF5 file in the layout ``mvsec``."""

    layout = "mvsec"

    def columns(self) -> list[Column]:
        """Return the columns of the events."""
        return [Column(_TABLE.events, np.float64, _rows, 4)]

    def seconds(self, begin: int, end: int) -> NDArray[np.float64]:
        """Return times of events [s]."""
        times: NDArray[np.float64] = self.file[_TABLE.events][begin:end, 2]
        return times

    def complete(self) -> None:
        """Write the frames."""
        if not self.request.with_frames:
            return
        self.write_stack(_TABLE.frames)
        before = np.array([*map(self.events_before, range(len(self.frames)))], np.int64)
        self.file[_TABLE.stamps] = np.array([t_ns / 1e9 for t_ns, _ in self.frames], np.float64)
        self.file[f"{_CAMERA}/image_raw_event_inds"] = np.maximum(before - 1, 0)


def _rows(events: Events) -> NDArray[np.float64]:
    signs = events["p"] * 2.0 - 1.0
    return np.stack([events["x"], events["y"], events["t"] / 1e6, signs], axis=1)
