"""HDF5 in the layout of v2e.

=========================== ====================================================================
/events                     uint32 (events, 4): time [us], column, row, polarity 0/1
/frame                      uint8 (frames, rows, columns), grey
/frame_ts                   uint32 (frames) [us]
/frame_idx                  uint64 (frames), how many events are before each
=========================== ====================================================================

v2e makes its times in single precision, so that they have steps of 2 us from 16.8 s on and of 64 us
after nine minutes; in files of ours each microsecond is there.  A polarity of -1 became 4294967295
in files of some versions.  The size of the sensor is that of the frames.

References
----------
.. [1] Y. Hu, S.-C. Liu, T. Delbruck, "v2e: From Video Frames to Realistic DVS Events", 2021,
   arXiv:2006.07722; github.com/SensorsINI/v2e, v2ecore/emulator.py.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from adv2e.errors import OutputError
from adv2e.events import Events
from adv2e.formats.event_file import EventFile, Facts
from adv2e.formats.hdf5_writer import Column, Hdf5Writer
from adv2e.formats.tables import Table, open_table
from adv2e.ticks import US

_TABLE = Table("events", "txyp", "frame", "frame_ts")


def open_v2e(path: Path, facts: Facts) -> EventFile:
    """Open a file of this layout; errors as :func:`adv2e.formats.tables.open_table`."""
    return open_table(path, facts, "v2e", _TABLE, US, US)


class V2eWriter(Hdf5Writer):
    """Writes an HDF5 file in the layout ``v2e``."""

    layout = "v2e"

    def columns(self) -> list[Column]:
        """Return the columns of the events."""
        return [Column("events", np.uint32, _rows, 4)]

    def write_frame(self, t_ns: int, image: NDArray[np.uint8 | np.uint16]) -> None:
        """Append a frame."""
        if not 0 <= _us(t_ns) < 1 << 32:
            raise OutputError(
                f"{self.request.path}: a frame at {t_ns / 1e9:.6f} s does not fit the layout v2e,"
                " which holds times from 0 to 4294.967295 s; --t0 zero may help, or another layout"
            )
        super().write_frame(t_ns, image)

    def seconds(self, begin: int, end: int) -> NDArray[np.float64]:
        """Return times of events [s]."""
        times: NDArray[np.float64] = self.file["events"][begin:end, 0] / 1e6
        return times

    def complete(self) -> None:
        """Write the frames."""
        if not self.request.with_frames:
            return
        self.write_stack("frame")
        count = len(self.frames)
        self.file["frame_ts"] = np.array([_us(t_ns) for t_ns, _ in self.frames], np.uint32)
        self.file["frame_idx"] = np.array([*map(self.events_before, range(count))], np.uint64)


def _us(t_ns: int) -> int:
    return (t_ns + 500) // 1000


def _rows(events: Events) -> NDArray[np.int64]:
    return np.stack([events[name].astype(np.int64) for name in "txyp"], axis=1)
