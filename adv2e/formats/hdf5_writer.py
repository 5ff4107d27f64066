"""Writers of the layouts of HDF5: chunks compressed in threads, frames written last.

HDF5 compresses in the thread that writes.  Here whole chunks are compressed in threads, into what
its filters shuffle and deflate would read, and stored as they are, so that any reader of HDF5 opens
them without plug-ins.  The bytes of a file follow from its content.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack, closing
from functools import partial
from itertools import takewhile
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

import cv2
import h5py
import numpy as np
from numpy.typing import DTypeLike, NDArray

from adv2e.background import OrderedWork
from adv2e.causes import CAUSED_DTYPE
from adv2e.errors import OutputError
from adv2e.events import EVENT_DTYPE, Events
from adv2e.files.backlog import Backlog
from adv2e.formats import causes
from adv2e.formats.hdf5_layouts import DSEC, M3ED, MONASH, MVSEC, V2E, Layout
from adv2e.formats.writing import Pieces, Request, Writer, compress, compress_shuffled, to_json
from adv2e.light.pictures import eight_bit
from adv2e.ticks import S

CHUNK = 1 << 16
"""Rows of a chunk."""

FILTERS: dict[str, Any] = {"compression": "gzip", "compression_opts": 1, "track_times": False}
"""Options of a dataset whose chunks are zlib streams."""

_CACHE_BYTES = 512 << 10
"""Memory for the index of chunks and images, as HDF5 counts it, a tenth of what it takes.

Only the end of the index grows; but below this, storing many images takes longer.
"""

_WORD = 1 << 32
"""Range of the times of DSEC [us]."""

Values = NDArray[Any]


class Column(NamedTuple):
    """A dataset with a row for each item."""

    name: str
    dtype: DTypeLike
    of: Callable[[Values], Values]
    """Function from some items to the rows of the column."""
    width: int = 0
    """Numbers in a row; 0: it has one dimension."""


_CAUSES = Column(causes.DATASET, np.uint8, lambda events: events["cause"])


class Columns:
    """Datasets that grow together, a chunk at a time, by items that come in any number.

    Parameters
    ----------
    file : h5py.File
        Where they are made.
    work : OrderedWork
        Compresses.
    dtype : data type
        Of the items.
    columns : list of Column
    told : callable, optional
        Is told the items of each chunk, and how many were before.
    """

    def __init__(
        self,
        file: h5py.File,
        work: OrderedWork,
        dtype: DTypeLike,
        columns: list[Column],
        told: Callable[[int, Values], None] | None = None,
    ) -> None:
        self.size = 0
        self._work, self._columns, self._told = work, columns, told
        self._datasets = [_dataset(file, column) for column in columns]
        self._pieces = Pieces(CHUNK, dtype)

    def append(self, items: Values) -> None:
        """Add items at the end."""
        for chunk in self._pieces.add(items):
            self._hand_over(chunk)

    def flush(self) -> None:
        """Hand over what waits for its chunk to be full: nothing may come after that."""
        if (rest := self._pieces.take()).size:
            self._hand_over(rest)

    def _hand_over(self, items: Values) -> None:
        begin = self.size
        self.size = end = begin + items.size
        if self._told is not None:
            self._told(begin, items)

        def take(chunks: list[bytes]) -> None:
            for dataset, data in zip(self._datasets, chunks, strict=True):
                dataset.resize(end, axis=0)
                dataset.id.write_direct_chunk((begin,) + (0,) * (dataset.ndim - 1), data)

        self._work.submit(self._compressed, items, take=take)

    def _compressed(self, items: Values) -> list[bytes]:
        chunks = []
        for column, dataset in zip(self._columns, self._datasets, strict=True):
            values = np.zeros(dataset.chunks, dataset.dtype)  # the last chunk is stored in full
            values[: items.size] = column.of(items)
            chunks.append(compress_shuffled(values))
        return chunks


def _dataset(file: h5py.File, column: Column) -> h5py.Dataset:
    row = (column.width,) if column.width else ()
    return file.create_dataset(
        *(column.name, (0, *row), column.dtype),
        **(FILTERS | {"chunks": (CHUNK, *row), "maxshape": (None, *row), "shuffle": True}),
    )


class Hdf5Writer(Writer):
    """Writes an HDF5 file; its subclasses say in which layout.

    Attributes
    ----------
    layout : Layout
    file : h5py.File
    work : OrderedWork
        Compresses; it is finished before :meth:`complete`.
    size, on : int
        Events, and ON events, that were written.
    frames : list of (int, tuple)
        Time [ns] and shape of each frame.
    """

    layout: ClassVar[Layout]

    def __init__(self, request: Request, stack: ExitStack, path: Path) -> None:
        self.request = request
        # fixed: the oldest structures, which every reader knows and which hold no times
        self.file = stack.enter_context(h5py.File(path, "w", libver=("earliest", "v108")))
        _bound_cache(self.file)
        self.work = OrderedWork(request.threads - 1)
        stack.callback(self.work.abandon)
        # kept aside until the events are all written: the file must not depend on how they come
        self._encoded = stack.enter_context(closing(Backlog(path.parent, limit=0)))
        self.frames: list[tuple[int, tuple[int, ...]]] = []
        self._before: list[int | None] = []  # events before each; None: to be looked up
        self._ends: list[float] = []  # time of the last event of each chunk [s]
        self.on = 0
        columns, dtype = self._columns(), EVENT_DTYPE
        if request.causes:
            columns, dtype = [*columns, _CAUSES], CAUSED_DTYPE
        self._events = Columns(self.file, self.work, dtype, columns, self.chunk_made)
        if request.causes:
            self.file[_CAUSES.name].attrs["names"] = causes.NAMES
        self._index = Milliseconds(self, self.layout.index) if self.layout.index else None

    @property
    def size(self) -> int:
        """Events that were written."""
        return self._events.size

    def _columns(self) -> list[Column]:
        layout = self.layout
        if not layout.columns:
            return [Column(layout.events, layout.kinds[0], self._rows, len(layout.order))]
        large = max(self.request.width, self.request.height) > 32767
        return [
            Column(
                layout.columns[name],
                np.uint16 if large and kind is np.int16 else kind,
                partial(self._stored, name),
            )
            for name, kind in zip(layout.order, layout.kinds, strict=True)
        ]

    def _rows(self, events: Events) -> Values:
        return np.stack([self._stored(name, events) for name in self.layout.order], axis=1)

    def _stored(self, name: str, events: Events) -> Values:
        if name == "t":
            return (
                self.times_us(events) / 1e6 if self.layout.unit_ns == S else self.times_us(events)
            )
        if name == "p" and self.layout.is_signed:
            return events["p"] * 2.0 - 1.0
        return events[name]

    def times_us(self, events: Events) -> NDArray[np.int64]:
        """Return the times of some events as the layout counts them [us]."""
        return events["t"]

    def chunk_made(self, begin: int, events: Events) -> None:
        """Take note of a chunk, `begin` events after the first."""
        self.on += int(np.count_nonzero(events["p"]))
        last = events["t"][-1] / 1e6
        waiting = (t_ns / 1e9 for t_ns, _ in self.frames[len(self._before) :])
        reached = list(takewhile(lambda t: t <= last, waiting))
        if reached:
            times = events["t"] / 1e6
            for t in reached:
                came_late = self._ends and t <= self._ends[-1]
                self._before.append(None if came_late else begin + int(np.searchsorted(times, t)))
        self._ends.append(last)
        if self._index is not None:
            self._index.add(begin, self.times_us(events))

    def write_events(self, events: Events) -> None:
        """Append events."""
        self._events.append(events)

    def picture(self, image: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """Return a frame, grey or RGB, as the layout stores it; here grey, of colour the luma."""
        return image if image.ndim == 2 else np.asarray(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY))

    def write_frame(self, t_ns: int, image: NDArray[np.uint8 | np.uint16]) -> None:
        """Append a frame."""
        picture = self.picture(eight_bit(image)).copy()
        self.frames.append((t_ns, picture.shape))

        def take(data: bytes) -> None:
            self._encoded.append(t_ns, np.frombuffer(data, np.uint8))

        self.work.submit(compress, picture, take=take)

    def next_frame(self) -> bytes:
        """Return the next frame, compressed."""
        return self._encoded.take().tobytes()

    def events_before(self, number: int) -> int:
        """Return the number of events before a frame; may read the timestamps around it again."""
        known = self._before[number] if number < len(self._before) else None
        if known is not None:
            return known
        t = self.frames[number][0] / 1e9
        begin = int(np.searchsorted(self._ends, t)) * CHUNK
        times = self._seconds(begin, begin + CHUNK)
        return min(begin, self.size) + int(np.searchsorted(times, t))

    def _seconds(self, begin: int, end: int) -> Values:
        layout = self.layout
        part = self.file[layout.datasets[0]][begin:end]
        times: Values = part if layout.columns else part[:, layout.order.index("t")]
        return times if layout.unit_ns == S else times / 1e6

    def finish(self) -> None:
        """Write the remaining events, and the attributes."""
        self._events.flush()
        if self._index is not None:
            self._index.flush(self.size)
        self.work.finish()
        self.complete()
        self.file.attrs.update(
            {
                "sensor_resolution": np.array([self.request.height, self.request.width], np.int64),
                "layout": self.layout.name,
                "layout_version": self.layout.version,
                "adv2e": to_json(self.request.description),
            }
        )

    def complete(self) -> None:
        """Write the datasets behind the events; here the frames, if they are in one dataset.

        Raises
        ------
        OutputError
            They differ in size.
        """
        layout = self.layout
        if not (layout.stamps and self.request.with_frames):
            return
        shapes = {shape for _, shape in self.frames}
        if len(shapes) > 1:
            sizes = ", ".join(f"{columns}x{rows}" for rows, columns in sorted(shapes))
            raise OutputError(f"{self.request.path}: frames of several sizes: {sizes}")
        shape = shapes.pop() if shapes else (self.request.height, self.request.width)
        stack = self.file.create_dataset(
            *(layout.frames, (len(self.frames), *shape), np.uint8),
            **(FILTERS | {"chunks": (1, *shape), "maxshape": (None, *shape)}),
        )
        for number in range(len(self.frames)):
            stack.id.write_direct_chunk((number, 0, 0), self.next_frame())
        t_ns = np.array([t_ns for t_ns, _ in self.frames], np.int64)
        in_seconds = layout.stamps_ns == S
        stamps = t_ns / 1e9 if in_seconds else ((t_ns + 500) // 1000).astype(np.uint32)
        self.file[layout.stamps] = stamps
        before = np.array([*map(self.events_before, range(len(self.frames)))], np.int64)
        if layout.before:
            self.file[layout.before] = before.astype(np.uint64)
        if layout.last:
            self.file[layout.last] = np.maximum(before - 1, 0)


class MonashWriter(Hdf5Writer):
    """Writes an HDF5 file in the layout ``monash``."""

    layout = MONASH

    def picture(self, image: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """Return a frame, grey or BGR."""
        return image[..., ::-1] if image.ndim == 3 else image

    def complete(self) -> None:
        """Write the frames and the attributes."""
        images = self.file.create_group(self.layout.frames)
        for number, (t_ns, shape) in enumerate(self.frames):
            image = images.create_dataset(
                f"image{number:09d}", shape, np.uint8, chunks=shape, **FILTERS
            )
            image.id.write_direct_chunk((0,) * len(shape), self.next_frame())
            image.attrs["size"] = np.array(shape, np.int64)
            image.attrs["timestamp"] = np.float64(t_ns / 1e9)
            image.attrs["timestamp_ns"] = np.int64(t_ns)
            image.attrs["type"] = "greyscale" if len(shape) == 2 else "color_bgr"
            image.attrs["event_idx"] = np.int64(max(self.events_before(number) - 1, 0))
        images.attrs["num_images"] = np.int64(len(self.frames))
        times = self.file[self.layout.datasets[0]]
        first, last = (times[0], times[-1]) if self.size else (0.0, 0.0)
        self.file.attrs.update(
            {
                "num_events": np.int64(self.size),
                "num_pos": np.int64(self.on),
                "num_neg": np.int64(self.size - self.on),
                "duration": np.float64(last - first),
                "t0": np.float64(first),
                "tk": np.float64(last),
                "num_imgs": np.int64(len(self.frames)),
                "num_flow": np.int64(0),
                "source": "unknown",
            }
        )


class DsecWriter(Hdf5Writer):
    """Writes an HDF5 file in the layout ``dsec``."""

    layout = DSEC

    _offset: int | None = None
    _words: list[int]
    """Events before each multiple of 2**32 us, of which the datasets hold the rest at first."""

    def times_us(self, events: Events) -> NDArray[np.int64]:
        """Return the times of some events, from the offset on [us]."""
        return events["t"] - (self._offset or 0)

    def chunk_made(self, begin: int, events: Events) -> None:
        """Take note of a chunk."""
        if self._offset is None:
            first = int(events["t"][0])
            self._offset, self._words = 0 if 0 <= first < _WORD else first, [0]
        super().chunk_made(begin, events)
        times = self.times_us(events)
        while times[-1] >= len(self._words) * _WORD:
            self._words.append(begin + int(np.searchsorted(times, len(self._words) * _WORD)))

    def complete(self) -> None:
        """Write the offset, the size of the sensor, and times of 64 bits where they are needed."""
        if self._offset is not None and len(self._words) > 1:
            self._widen()
        self.file[self.layout.offset] = np.int64(self._offset or 0)
        self.file["events/width"] = np.int64(self.request.width)
        self.file["events/height"] = np.int64(self.request.height)

    def _widen(self) -> None:
        """Put times of 64 bits, of which only the lower 32 were kept, in the place of those."""
        times = self.layout.datasets[0]
        short = self.file[times]
        wide = self.file.create_dataset(
            *("events/wide", short.shape, np.int64),
            **(FILTERS | {"chunks": (CHUNK,), "maxshape": (None,), "shuffle": True}),
        )
        for begin in range(0, self.size, CHUNK):
            part = short[begin : begin + CHUNK].astype(np.int64)
            numbers = np.arange(begin, begin + part.size)
            words = np.searchsorted(self._words, numbers, side="right") - 1
            wide[begin : begin + part.size] = part + words * _WORD
        del self.file[times]
        self.file.move("events/wide", times)


class V2eWriter(Hdf5Writer):
    """Writes an HDF5 file in the layout ``v2e``."""

    layout = V2E


class MvsecWriter(Hdf5Writer):
    """Writes an HDF5 file in the layout ``mvsec``, as its left camera."""

    layout = MVSEC.of("left")


class M3edWriter(Hdf5Writer):
    """Writes an HDF5 file in the layout ``m3ed``, as its left camera."""

    layout = M3ED.of("left")

    def complete(self) -> None:
        """Write the size of the sensor."""
        size = np.array([self.request.width, self.request.height], np.int64)
        self.file["prophesee/left/calib/resolution"] = size


class Milliseconds:
    """Index of time: for each millisecond the first event at it or after.

    Parameters
    ----------
    writer : Hdf5Writer
    name : str
        Of the dataset.
    """

    _MOST_US = 1 << 40
    _BLOCK = 1 << 20  # entries made at once

    def __init__(self, writer: Hdf5Writer, name: str) -> None:
        column = Column(name, np.uint64, lambda values: values)
        self._writer = writer
        self._index = Columns(writer.file, writer.work, np.uint64, [column])
        self._next = 0

    def add(self, begin: int, times_us: NDArray[np.int64]) -> None:
        """Add the entries up to the last of the times of a chunk, which begin at zero or after.

        Raises
        ------
        OutputError
            The times go on for more than 12 days.
        """
        last = int(times_us[-1])
        if last >= self._MOST_US:
            raise OutputError(
                f"{self._writer.request.path}: an event {last / 86_400e6:.1f} days after time zero"
                f" or the first does not fit the layout {self._writer.layout.name}, which has an"
                " entry for each millisecond; --t0 zero may help, or the layout monash"
            )
        while self._next <= last // 1000:
            end = min(last // 1000 + 1, self._next + self._BLOCK)
            wanted = np.arange(self._next, end) * 1000
            self._index.append((begin + np.searchsorted(times_us, wanted)).astype(np.uint64))
            self._next = end

    def flush(self, size: int) -> None:
        """Add the last entry, after all events, and hand over what waits."""
        self._index.append(np.array([size], np.uint64))
        self._index.flush()


def _bound_cache(file: h5py.File) -> None:
    """Keep HDF5 from holding what it has written of the index of the chunks.

    By default that grows to some 15 MiB over half a billion events.
    """
    cache = file.id.get_mdc_config()
    cache.set_initial_size = True
    cache.initial_size = cache.min_size = cache.max_size = _CACHE_BYTES
    file.id.set_mdc_config(cache)
