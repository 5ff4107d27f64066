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

from collections import deque
from contextlib import ExitStack, closing
from pathlib import Path

import h5py
import numpy as np
from numpy.typing import NDArray

from adv2e.background import OrderedWork
from adv2e.events import EVENT_DTYPE, Events
from adv2e.files.backlog import Backlog
from adv2e.formats.columns import FILTERS, ChunkedColumns, Column
from adv2e.formats.compression import compress
from adv2e.formats.sink import Request, Writer, to_json

_CACHE_BYTES = 512 << 10
"""Memory for the index of chunks and images, as HDF5 counts it, a tenth of what it takes.

Only the end of the index grows; but below this, storing many images takes longer.
"""


class MonashWriter(Writer):
    """Writes an HDF5 file in the layout ``monash``; its bytes follow from its content."""

    takes_frames = True

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
        self._shapes: list[tuple[int, ...]] = []
        pixel = np.dtype(np.int16 if max(request.width, request.height) <= 32767 else np.uint16)
        columns: dict[str, Column] = {
            "xs": (pixel, lambda events: events["x"]),
            "ys": (pixel, lambda events: events["y"]),
            "ts": (np.dtype(np.float64), lambda events: events["t"] / 1e6),
            "ps": (np.dtype(np.bool_), lambda events: events["p"]),
        }
        self._events = self._file.create_group("events")
        self._columns = ChunkedColumns(self._events, columns, EVENT_DTYPE, self._work)
        self._images = self._file.create_group("images")
        self._indices = _EventIndices()
        self._on = 0

    def write_events(self, events: Events) -> None:
        """Append events."""
        if events.size:
            self._columns.append(events)
            self._on += int(np.count_nonzero(events["p"]))
            if self._request.with_frames:
                self._indices.add_events(events["t"] / 1e6)

    def write_frame(self, t_ns: int, image: NDArray[np.uint8 | np.uint16]) -> None:
        """Append a frame."""
        picture = _eight_bit(image)
        picture = picture[..., ::-1].copy() if picture.ndim == 3 else picture.copy()
        self._shapes.append(picture.shape)

        def take(data: bytes) -> None:
            self._encoded.append(t_ns, np.frombuffer(data, np.uint8))

        self._work.submit(compress, picture, take=take)
        self._indices.add_frame(t_ns / 1e9)

    def finish(self) -> None:
        """Write what is left, the frames and the attributes."""
        self._columns.finish()
        self._work.finish()
        indices = self._indices.finish()
        for number, (shape, index) in enumerate(zip(self._shapes, indices, strict=True)):
            self._add_image(f"image{number:09d}", shape, index)
        self._images.attrs["num_images"] = np.int64(len(indices))
        times = self._events["ts"]
        first, last = (times[0], times[-1]) if times.size else (0.0, 0.0)
        self._file.attrs.update(
            {
                "num_events": np.int64(times.size),
                "num_pos": np.int64(self._on),
                "num_neg": np.int64(times.size - self._on),
                "duration": np.float64(last - first),
                "t0": np.float64(first),
                "tk": np.float64(last),
                "num_imgs": np.int64(len(indices)),
                "num_flow": np.int64(0),
                "sensor_resolution": np.array(
                    [self._request.height, self._request.width], np.int64
                ),
                "source": "unknown",
                "layout": "monash",
                "layout_version": "1",
                "adv2e": to_json(self._request.description),
            }
        )

    def _add_image(self, name: str, shape: tuple[int, ...], event_index: int) -> None:
        image = self._images.create_dataset(name, shape, np.uint8, chunks=shape, **FILTERS)
        t_ns = self._encoded.time(0)
        image.id.write_direct_chunk((0,) * len(shape), self._encoded.take().tobytes())
        image.attrs["size"] = np.array(shape, np.int64)
        image.attrs["timestamp"] = np.float64(t_ns / 1e9)
        image.attrs["timestamp_ns"] = np.int64(t_ns)
        image.attrs["type"] = "greyscale" if len(shape) == 2 else "color_bgr"
        image.attrs["event_idx"] = np.int64(event_index)


def _bound_cache(file: h5py.File) -> None:
    """Keep HDF5 from holding what it has written of the index of the chunks.

    By default that grows to some 15 MiB over half a billion events.
    """
    cache = file.id.get_mdc_config()
    cache.set_initial_size = True
    cache.initial_size = cache.min_size = cache.max_size = _CACHE_BYTES
    file.id.set_mdc_config(cache)


def _eight_bit(image: NDArray[np.uint8 | np.uint16]) -> NDArray[np.uint8]:
    """Return the image as the 8 bit that this layout holds; 16 bit are rounded."""
    if image.dtype == np.uint8:
        return image.astype(np.uint8, copy=False)
    return ((image.astype(np.uint32) + 128) // 257).astype(np.uint8)


class _EventIndices:
    """Finds the last event before each frame; either may come before the other."""

    def __init__(self) -> None:
        self._frames: deque[float] = deque()  # times of those not settled
        self._found: list[int] = []
        self._blocks: deque[NDArray[np.float64]] = deque()  # of times that a frame may yet precede
        self._before = 0  # events before these

    def add_frame(self, seconds: float) -> None:
        self._frames.append(seconds)
        self._settle()

    def add_events(self, seconds: NDArray[np.float64]) -> None:
        self._blocks.append(seconds)
        self._settle()

    def _settle(self) -> None:
        """Settle the frames after which an event has come, and forget events before the others."""
        while self._frames and self._blocks:
            block = self._blocks[0]
            if block[-1] < self._frames[0]:
                self._before += block.size
                self._blocks.popleft()
            else:
                index = int(np.searchsorted(block, self._frames.popleft(), side="left"))
                self._found.append(max(self._before + index - 1, 0))

    def finish(self) -> list[int]:
        """Return the index for each frame."""
        return self._found + [max(self._before - 1, 0)] * len(self._frames)
