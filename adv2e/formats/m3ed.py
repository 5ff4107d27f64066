"""HDF5 in the layout of the data set M3ED, of its left camera or the right one.

================================= ==============================================================
/prophesee/left/x, y              uint16, column and row
/prophesee/left/t                 int64 [us]
/prophesee/left/p                 int8, 1 is ON and 0 is OFF
/prophesee/left/ms_map_idx        uint64, for each millisecond the first event at it or after
/prophesee/left/calib/resolution  columns and rows of the sensor
================================= ==============================================================

The right camera is ``prophesee/right``.

References
----------
.. [1] K. Chaney et al., "M3ED: Multi-Robot, Multi-Sensor, Multi-Environment Event Dataset", CVPRW
   2023; github.com/daniilidis-group/m3ed.
"""

from __future__ import annotations

from contextlib import ExitStack
from functools import partial
from pathlib import Path

import numpy as np

from adv2e.events import Events
from adv2e.formats import hdf5
from adv2e.formats.event_file import EventFile, Facts
from adv2e.formats.hdf5_writer import Column, Hdf5Writer, Milliseconds
from adv2e.formats.sink import Request

_CAMERA = "prophesee/left"


def _columns(camera: str) -> tuple[str, str, str, str]:
    return f"{camera}/t", f"{camera}/x", f"{camera}/y", f"{camera}/p"


def open_m3ed(path: Path, facts: Facts) -> EventFile:
    """Open a file of this layout.

    Raises
    ------
    DataError
        Columns of different lengths or kinds, or times beyond 146 years.
    """
    with hdf5.opened(path) as file:
        camera = f"prophesee/{hdf5.choose(file, facts, 'prophesee/*/t')[0]}"
        names = _columns(camera)
        hdf5.describe(file, facts, camera, f"{camera}/calib")
        hdf5.columns(file, names)
    return EventFile("m3ed", facts, partial(hdf5.parts, path, names, facts), times=names[0])


class M3edWriter(Hdf5Writer):
    """Writes an HDF5 file in the layout ``m3ed``."""

    layout = "m3ed"

    def __init__(self, request: Request, stack: ExitStack, *temporary: Path) -> None:
        super().__init__(request, stack, *temporary)
        self._index = Milliseconds(self, f"{_CAMERA}/ms_map_idx")

    def columns(self) -> list[Column]:
        """Return the columns of the events."""
        t, x, y, p = _columns(_CAMERA)
        return [
            Column(t, np.int64, lambda events: events["t"]),
            Column(x, np.uint16, lambda events: events["x"]),
            Column(y, np.uint16, lambda events: events["y"]),
            Column(p, np.int8, lambda events: events["p"]),
        ]

    def chunk_made(self, begin: int, events: Events) -> None:
        """Take note of a chunk."""
        super().chunk_made(begin, events)
        self._index.add(begin, events["t"])

    def flush(self) -> None:
        """Hand over the last of the index."""
        self._index.flush(self.size)

    def complete(self) -> None:
        """Write the size of the sensor."""
        self.file[f"{_CAMERA}/calib/resolution"] = np.array(
            [self.request.width, self.request.height], np.int64
        )
