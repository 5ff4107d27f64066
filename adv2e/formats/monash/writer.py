"""HDF5 in the layout of ``event_utils`` and ``event_cnn_minimal`` (Monash University).

=========================== ====================================================================
/events/xs, /events/ys      int16 (uint16 where the sensor is larger), column and row
/events/ts                  float64, seconds
/events/ps                  bool, true is ON
/images/image%09d           uint8 (rows, columns) or (rows, columns, 3) as BGR; attributes size,
                            timestamp [s], timestamp_ns, type, event_idx
=========================== ====================================================================

Attributes of the root: num_events, num_pos, num_neg, duration, t0, tk, num_imgs, num_flow,
sensor_resolution (height, width), source; and of ours layout, layout_version and adv2e (JSON).

``event_idx`` is the index of the last event before the frame,
``max(searchsorted(ts, timestamp) - 1, 0)``.

References
----------
.. [1] T. Stoffregen et al., "Reducing the sim-to-real gap for event cameras", ECCV 2020,
   arXiv:2003.09078; github.com/TimoStoff/event_utils, event_cnn_minimal.
"""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from adv2e.background import OrderedWork
from adv2e.events import EVENT_DTYPE, Events
from adv2e.files.staging import Staging
from adv2e.formats.columns import FILTERS, ChunkedColumns, Column, encode_image
from adv2e.formats.sink import FileSink, to_json
from adv2e.formats.spool import FrameSpool, StoredFrame

_CACHE_BYTES = 512 << 10
"""Memory for the index of chunks and images, as HDF5 counts it, a tenth of what it takes.

Only the end of the index grows; but below this, storing many images takes longer.
"""


class MonashSink(FileSink):
    """An HDF5 file in the layout ``monash``; its bytes follow from its content.

    Parameters
    ----------
    path : Path
        The file.
    width, height : int
        Geometry [pixels].
    description : dict
        Content of the attribute ``adv2e``.
    staging : Staging
        Takes it.
    with_frames : bool
        Store frames.
    threads : int
        Threads that compress.
    """

    def __init__(
        self,
        path: Path,
        *,
        width: int,
        height: int,
        description: dict[str, Any],
        staging: Staging,
        with_frames: bool,
        threads: int,
    ) -> None:
        self._temporary = staging.file(path)
        super().__init__(path, staging)
        self.wants_frames = with_frames
        self._shape = (height, width)
        self._description = to_json(description)
        self._threads = threads
        self._totals = _Totals()
        self._indices = _EventIndices()
        self._file: h5py.File | None = None
        self._work: OrderedWork | None = None
        self._spool: FrameSpool | None = None
        self._columns: ChunkedColumns | None = None

    def _open(self) -> None:
        self._work = OrderedWork(self._threads - 1)
        # fixed: the oldest structures, which every reader knows and which hold no times
        self._file = h5py.File(self._temporary, "w", libver=("earliest", "v108"))
        pixel = np.dtype(np.int16 if max(self._shape) <= 32767 else np.uint16)
        _bound_cache(self._file)
        columns = {
            "xs": Column(pixel, lambda events: events["x"]),
            "ys": Column(pixel, lambda events: events["y"]),
            "ts": Column(np.dtype(np.float64), lambda events: events["t"] / 1e6),
            "ps": Column(np.dtype(np.bool_), lambda events: events["p"]),
        }
        group = self._file.create_group("events")
        self._columns = ChunkedColumns(group, columns, EVENT_DTYPE, self._work)
        self._file.create_group("images")
        if self.wants_frames:
            self._spool = FrameSpool(self._temporary.parent)

    def _write_events(self, events: Events) -> None:
        assert self._columns is not None
        if events.size:
            self._columns.append(events)
            if self.wants_frames:
                self._indices.add_events(events["t"])
            self._totals.add(events)

    def _write_frame(self, t_ns: int, image: NDArray[Any]) -> None:
        assert self._work is not None
        assert self._spool is not None
        picture = _eight_bit(image)
        picture = picture[..., ::-1].copy() if picture.ndim == 3 else picture.copy()
        self._indices.add_frame(t_ns / 1e9)
        spool, shape = self._spool, picture.shape
        self._work.submit(encode_image, picture, take=lambda data: spool.add(t_ns, shape, data))

    def _finish(self) -> None:
        assert self._file is not None
        assert self._columns is not None
        assert self._work is not None
        self._columns.finish()
        self._work.finish()
        indices = self._indices.finish()
        for number, frame in enumerate(self._spool or ()):
            _add_image(self._file["images"], number, frame, indices[number])
        self._file["images"].attrs["num_images"] = np.int64(len(indices))
        attributes = self._file.attrs
        for name, value in self._totals.attributes().items():
            attributes[name] = value
        attributes["num_imgs"] = np.int64(len(indices))
        attributes["num_flow"] = np.int64(0)
        attributes["sensor_resolution"] = np.array(self._shape, np.int64)
        attributes["source"] = "unknown"
        attributes["layout"] = "monash"
        attributes["layout_version"] = "1"
        attributes["adv2e"] = self._description
        self._file.close()
        if self._spool is not None:
            self._spool.close()

    def _abandon(self) -> None:
        if self._work is not None:
            self._work.abandon()
        for part in (self._spool, self._file):
            if part is not None:
                with suppress(Exception):  # each must be closed, whatever became of the other
                    part.close()


def _bound_cache(file: h5py.File) -> None:
    """Keep HDF5 from holding what it has written of the index of the chunks.

    By default that grows to some 15 MiB over half a billion events.
    """
    cache = file.id.get_mdc_config()
    cache.set_initial_size = True
    cache.initial_size = cache.min_size = cache.max_size = _CACHE_BYTES
    file.id.set_mdc_config(cache)


def _eight_bit(image: NDArray[Any]) -> NDArray[np.uint8]:
    """Return the image as the 8 bit that this layout holds; 16 bit are rounded."""
    if image.dtype == np.uint8:
        return image
    return ((image.astype(np.uint32) + 128) // 257).astype(np.uint8)


def _add_image(group: h5py.Group, number: int, frame: StoredFrame, event_index: int) -> None:
    image = group.create_dataset(
        f"image{number:09d}",
        frame.shape,
        np.uint8,
        chunks=frame.shape,
        track_times=False,
        **FILTERS,
    )
    image.id.write_direct_chunk((0,) * len(frame.shape), frame.data)
    image.attrs["size"] = np.array(frame.shape, np.int64)
    image.attrs["timestamp"] = np.float64(frame.t_ns / 1e9)
    image.attrs["timestamp_ns"] = np.int64(frame.t_ns)
    image.attrs["type"] = "greyscale" if len(frame.shape) == 2 else "color_bgr"
    image.attrs["event_idx"] = np.int64(event_index)


class _Totals:
    """Counts and span of the events."""

    def __init__(self) -> None:
        self._count = 0
        self._on = 0
        self._first = 0.0
        self._last = 0.0

    def add(self, events: Events) -> None:
        """Count some events, one at least."""
        if not self._count:
            self._first = float(events["t"][0]) / 1e6
        self._last = float(events["t"][-1]) / 1e6
        self._count += events.size
        self._on += int(np.count_nonzero(events["p"]))

    def attributes(self) -> dict[str, Any]:
        return {
            "num_events": np.int64(self._count),
            "num_pos": np.int64(self._on),
            "num_neg": np.int64(self._count - self._on),
            "duration": np.float64(self._last - self._first),
            "t0": np.float64(self._first),
            "tk": np.float64(self._last),
        }


class _EventIndices:
    """Finds the last event before each frame; either may come before the other."""

    def __init__(self) -> None:
        self._count = 0
        self._last = -np.inf
        self._waiting: list[float] = []
        self._late: list[NDArray[np.float64]] = []  # times of events that a frame may yet precede
        self._found: list[int] = []

    def add_frame(self, seconds: float) -> None:
        """Note a frame; it is settled once an event at or after its time has come."""
        if seconds > self._last:
            self._waiting.append(seconds)
            self._late.clear()
            return
        times = np.concatenate(self._late)
        before = int(np.searchsorted(times, seconds, side="left"))
        self._found.append(max(self._count - times.size + before - 1, 0))
        self._late = [times[before:]]

    def add_events(self, t_us: NDArray[np.int64]) -> None:
        """Settle the frames that come before the last of these events, one at least."""
        self._last = float(t_us[-1]) / 1e6
        seconds = t_us / 1e6
        if self._waiting:
            settled = int(np.searchsorted(self._waiting, self._last, side="right"))
            before = np.searchsorted(seconds, self._waiting[:settled], side="left")
            self._found.extend(max(self._count + int(n) - 1, 0) for n in before)
            del self._waiting[:settled]
            self._late.clear()
        if not self._waiting:
            self._late.append(seconds)
        self._count += t_us.size

    def finish(self) -> list[int]:
        """Return the index for each frame."""
        return self._found + [max(self._count - 1, 0)] * len(self._waiting)
