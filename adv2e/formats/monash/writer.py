"""HDF5 in the layout of ``event_utils`` and ``event_cnn_minimal`` (Monash University).

=========================== ====================================================================
/events/xs, /events/ys      int16 (uint16 where the sensor is larger), column and row
/events/ts                  float64, seconds
/events/ps                  int8, 1 is ON and 0 is OFF
/images/image%09d           uint8 (rows, columns) or (rows, columns, 3) as BGR; attributes size,
                            timestamp [s], timestamp_ns, type, event_idx
/events/causes              with causes: see :mod:`adv2e.formats.causes`
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

import numpy as np
from numpy.typing import NDArray

from adv2e.formats.hdf5_writer import FILTERS, Column, Hdf5Writer


class MonashWriter(Hdf5Writer):
    """Writes an HDF5 file in the layout ``monash``."""

    layout = "monash"
    version = "2"

    def columns(self) -> list[Column]:
        """Return the columns of the events."""
        large = max(self.request.width, self.request.height) > 32767
        pixel = np.uint16 if large else np.int16
        return [
            Column("events/xs", pixel, lambda events: events["x"]),
            Column("events/ys", pixel, lambda events: events["y"]),
            Column("events/ts", np.float64, lambda events: events["t"] / 1e6),
            Column("events/ps", np.int8, lambda events: events["p"]),
        ]

    def picture(self, image: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """Return a frame, grey or BGR."""
        return image[..., ::-1] if image.ndim == 3 else image

    def seconds(self, begin: int, end: int) -> NDArray[np.float64]:
        """Return times of events [s]."""
        times: NDArray[np.float64] = self.file["events/ts"][begin:end]
        return times

    def complete(self) -> None:
        """Write the frames and the attributes."""
        images = self.file.create_group("images")
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
        times = self.file["events/ts"]
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
