"""HDF5 in the layout of ``event_utils`` and ``event_cnn_minimal`` (Monash University).

=========================== ====================================================================
/events/xs, /events/ys      int16 (uint16 where the sensor is larger), column and row
/events/ts                  float64, seconds
/events/ps                  int8, 1 is ON and 0 is OFF
/images/image%09d           uint8 (rows, columns) or (rows, columns, 3) as BGR; attributes size,
                            timestamp [s], timestamp_ns, type, event_idx
=========================== ====================================================================

Attributes of the root: num_events, num_pos, num_neg, duration, t0, tk, num_imgs, num_flow,
sensor_resolution (height, width), source; and of ours layout, layout_version and adv2e (JSON).

``ps`` has a sign, so that the ``ps * 2 - 1`` of loaders is -1 and not 255, and is no bool, which
HDF5 has none of: h5py stores an enumeration, which MATLAB reads as words.

``event_idx`` is the index of the last event before the frame,
``max(searchsorted(ts, timestamp) - 1, 0)``.

References
----------
.. [1] T. Stoffregen et al., "Reducing the sim-to-real gap for event cameras", ECCV 2020,
   arXiv:2003.09078; github.com/TimoStoff/event_utils, event_cnn_minimal.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack, closing
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from adv2e.background import OrderedWork
from adv2e.events import EVENT_DTYPE, Events
from adv2e.files.backlog import Backlog
from adv2e.formats.compression import compress, compress_shuffled
from adv2e.formats.sink import Request, Writer, to_json
from adv2e.light.pictures import eight_bit

CHUNK = 1 << 16
"""Events of a chunk."""

_FILTERS: dict[str, Any] = {"compression": "gzip", "compression_opts": 1, "track_times": False}
"""Of a dataset whose chunks are zlib streams."""

_CACHE_BYTES = 512 << 10
"""Memory for the index of chunks and images, as HDF5 counts it, a tenth of what it takes.

Only the end of the index grows; but below this, storing many images takes longer.
"""

_COLUMNS: dict[str, Callable[[Events], NDArray[Any]]] = {
    "xs": lambda events: events["x"],
    "ys": lambda events: events["y"],
    "ts": lambda events: events["t"] / 1e6,
    "ps": lambda events: events["p"],
}


class MonashWriter(Writer):
    """Writes an HDF5 file in the layout ``monash``; its bytes follow from its content.

    HDF5 compresses in the thread that writes.  Here whole chunks are compressed beforehand, in
    threads, into what its filters shuffle and deflate would read, and stored as they are, so that
    any reader of HDF5 opens them without plug-ins.
    """

    def __init__(self, request: Request, stack: ExitStack, *temporary: Path) -> None:
        (path,) = temporary
        self._request = request
        # fixed: the oldest structures, which every reader knows and which hold no times
        self._file = stack.enter_context(h5py.File(path, "w", libver=("earliest", "v108")))
        _bound_cache(self._file)
        self._work = OrderedWork(request.threads - 1)
        stack.callback(self._work.abandon)
        # kept aside until the events are all written: the file must not depend on how they come
        self._encoded = stack.enter_context(closing(Backlog(path.parent, limit=0)))
        self._frames: list[tuple[int, tuple[int, ...]]] = []  # times [ns] and shapes
        self._before: list[int | None] = []  # events before each; None: to be looked up
        pixel = np.int16 if max(request.width, request.height) <= 32767 else np.uint16
        group = self._file.create_group("events")
        self._columns = {
            name: group.create_dataset(
                *(name, (0,), dtype),
                **(_FILTERS | {"chunks": (CHUNK,), "maxshape": (None,), "shuffle": True}),
            )
            for name, dtype in zip(_COLUMNS, (pixel, pixel, np.float64, np.int8), strict=True)
        }
        self._images = self._file.create_group("images")
        self._buffer = np.zeros(CHUNK, EVENT_DTYPE)
        self._held = 0  # events in it
        self._ends: list[float] = []  # time of the last event of each chunk [s]
        self._size = self._on = 0

    def write_events(self, events: Events) -> None:
        """Append events."""
        while events.size:
            part, events = np.split(events, [CHUNK - self._held])
            self._buffer[self._held : self._held + part.size] = part
            self._held += part.size
            if self._held == CHUNK:
                self._write_chunk()

    def _write_chunk(self) -> None:
        held = self._buffer[: self._held]
        begin = self._size
        self._size += held.size
        self._on += int(np.count_nonzero(held["p"]))
        self._find_frames(begin, held["t"] / 1e6)
        end = self._size

        def take(chunks: list[bytes]) -> None:
            for column, data in zip(self._columns.values(), chunks, strict=True):
                column.resize((end,))
                column.id.write_direct_chunk((begin,), data)

        self._work.submit(self._compressed, self._buffer, take=take)
        # zeros: the last chunk is stored in full
        self._held, self._buffer = 0, np.zeros(CHUNK, EVENT_DTYPE)

    def _find_frames(self, begin: int, times: NDArray[np.float64]) -> None:
        """Note how many events are before the frames that have come, up to the end of a chunk."""
        for t_ns, _ in self._frames[len(self._before) :]:
            t = t_ns / 1e9
            if t > times[-1]:
                break
            came_late = self._ends and t <= self._ends[-1]
            self._before.append(None if came_late else begin + int(np.searchsorted(times, t)))
        self._ends.append(times[-1])

    def _compressed(self, events: Events) -> list[bytes]:
        return [
            compress_shuffled(_COLUMNS[name](events).astype(column.dtype, copy=False))
            for name, column in self._columns.items()
        ]

    def write_frame(self, t_ns: int, image: NDArray[np.uint8 | np.uint16]) -> None:
        """Append a frame."""
        picture = eight_bit(image)
        picture = picture[..., ::-1].copy() if picture.ndim == 3 else picture.copy()
        self._frames.append((t_ns, picture.shape))

        def take(data: bytes) -> None:
            self._encoded.append(t_ns, np.frombuffer(data, np.uint8))

        self._work.submit(compress, picture, take=take)

    def finish(self) -> None:
        """Write what is left, the frames and the attributes."""
        if self._held:
            self._write_chunk()
        self._work.finish()
        for number, (t_ns, shape) in enumerate(self._frames):
            image = self._images.create_dataset(
                f"image{number:09d}", shape, np.uint8, chunks=shape, **_FILTERS
            )
            image.id.write_direct_chunk((0,) * len(shape), self._encoded.take().tobytes())
            image.attrs["size"] = np.array(shape, np.int64)
            image.attrs["timestamp"] = np.float64(t_ns / 1e9)
            image.attrs["timestamp_ns"] = np.int64(t_ns)
            image.attrs["type"] = "greyscale" if len(shape) == 2 else "color_bgr"
            image.attrs["event_idx"] = np.int64(max(self._events_before(number) - 1, 0))
        self._images.attrs["num_images"] = np.int64(len(self._frames))
        times = self._columns["ts"]
        first, last = (times[0], times[-1]) if self._size else (0.0, 0.0)
        self._file.attrs.update(
            {
                "num_events": np.int64(self._size),
                "num_pos": np.int64(self._on),
                "num_neg": np.int64(self._size - self._on),
                "duration": np.float64(last - first),
                "t0": np.float64(first),
                "tk": np.float64(last),
                "num_imgs": np.int64(len(self._frames)),
                "num_flow": np.int64(0),
                "sensor_resolution": np.array(
                    [self._request.height, self._request.width], np.int64
                ),
                "source": "unknown",
                "layout": "monash",
                "layout_version": "2",
                "adv2e": to_json(self._request.description),
            }
        )

    def _events_before(self, number: int) -> int:
        """Return how many events are before a frame; those after which it came are read again."""
        known = self._before[number] if number < len(self._before) else None
        if known is not None:
            return known
        t = self._frames[number][0] / 1e9
        begin = int(np.searchsorted(self._ends, t)) * CHUNK
        times = self._columns["ts"][begin : begin + CHUNK]
        return min(begin, self._size) + int(np.searchsorted(times, t))


def _bound_cache(file: h5py.File) -> None:
    """Keep HDF5 from holding what it has written of the index of the chunks.

    By default that grows to some 15 MiB over half a billion events.
    """
    cache = file.id.get_mdc_config()
    cache.set_initial_size = True
    cache.initial_size = cache.min_size = cache.max_size = _CACHE_BYTES
    file.id.set_mdc_config(cache)
