"""Folders that trainers open: what each holds of one recording.

============ ====================================================================================
rvt          ``event_representations_v2/NAME/``: ``event_representations.h5`` (``data``: uint8,
             (windows, 2 bins, rows, columns)), ``timestamps_us.npy`` (their ends),
             ``objframe_idx_2_repr_idx.npy``; ``labels_v2/``: ``labels.npz`` (``labels``,
             ``objframe_idx_2_label_idx``), ``timestamps_us.npy``
evreal       ``events_ts.npy`` (float64 [s]), ``events_xy.npy`` (uint16, (events, 2)),
             ``events_p.npy`` (0, 1), ``images.npy`` (uint8, (images, rows, columns, 1)),
             ``images_ts.npy``, ``image_event_indices.npy`` (events before each image),
             ``metadata.json``
dsec         ``events/left/events.h5``, ``events/left/rectify_map.h5`` (nothing moves),
             ``images/left/rectified/%06d.png``, ``images/timestamps.txt`` [us],
             ``flow/forward/%06d.png``, ``flow/forward_timestamps.txt``,
             ``object_detections/left/tracks.npy`` (as in DSEC-Det)
spikingjelly one ``.npz`` with ``t`` [us], ``x``, ``y``, ``p``
nmnist       one ``.bin`` of N-MNIST
============ ====================================================================================

References
----------
.. [1] github.com/uzh-rpg/RVT, scripts/genx/preprocess_dataset.py.
.. [2] B. Ercan et al., "EVREAL: Towards a Comprehensive Benchmark and Analysis Suite for
   Event-based Video Reconstruction", CVPRW 2023; github.com/ercanburak/EVREAL.
.. [3] M. Gehrig et al., "DSEC: A Stereo Event Camera Dataset for Driving Scenarios", IEEE RA-L
   2021; github.com/uzh-rpg/DSEC.
.. [4] W. Fang et al., "SpikingJelly", Science Advances 9, 2023; spikingjelly/datasets/base.py.
.. [5] G. Orchard et al., "Converting Static Image Datasets to Spiking Neuromorphic Datasets Using
   Saccades", Frontiers in Neuroscience 2015, doi:10.3389/fnins.2015.00437.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import Any, BinaryIO

import h5py
import numpy as np
from numpy.lib import format as npy
from numpy.typing import DTypeLike, NDArray

from adv2e.errors import DataError, UsageError
from adv2e.events import Events
from adv2e.exporting.e2vid import images_of
from adv2e.exporting.sequence import Sequence
from adv2e.exporting.targets import Targets
from adv2e.exporting.voxels import in_windows
from adv2e.formats.reading import events_in_order
from adv2e.formats.writing import open_sink
from adv2e.light.pictures import png_of
from adv2e.representations.histogram import stacked_histogram

Made = tuple[tuple[int, int], int]
"""Size of the sensor [px], and number of items."""

Tell = Callable[[str], None]

_JITTER_US = 2000
"""Most that a label may be off the step of the representations, as RVT allows [us]."""
_SIZES = {"Gen1": (304, 240), "1 Mpx": (1280, 720)}
"""Sensors to whose size RVT cuts labels."""


def write_rvt(sequence: Sequence, folder: Path, how: Mapping[str, Any], tell: Tell) -> Made:
    """Write histograms of a recording and its boxes for RVT.

    Raises
    ------
    DataError
        There are no boxes, or none at a time that a window can end at.
    """
    label, step, bins = str(sequence.file.facts.path), how["window_us"], how["bins"]
    size, first_us, parts = events_in_order(sequence.file)
    if step % 1000:
        raise UsageError("--window: windows of rvt are of whole milliseconds")
    if size not in _SIZES.values():
        known = " or ".join(f"{w}x{h} ({name})" for name, (w, h) in _SIZES.items())
        tell(f"{label}: {size[0]}x{size[1]} pixels: RVT takes {known}, unless its code is changed")
    boxes = _on_sensor(sequence.targets.boxes, size)
    if boxes is None or not boxes.size:
        raise DataError(f"{label}: no boxes, which RVT needs: put NAME_bbox.npy beside it")
    times = np.unique(boxes["t"])
    frames, ends = _aligned(times[times >= first_us + step], step, first_us)
    if not frames:
        raise DataError(f"{label}: no box {step / 1000:g} ms or more after the first event")
    if len(frames) < len(times):
        tell(
            f"{label}: boxes at {len(times) - len(frames)} of {len(times)} times are left out: no"
            f" window of {step / 1000:g} ms ends there"
        )
    name = f"stacked_histogram_dt={step // 1000}_nbins={bins}"
    events_in, labels_in = folder / "event_representations_v2" / name, folder / "labels_v2"
    for place in (events_in, labels_in):
        place.mkdir(parents=True)
    kept = boxes[np.isin(boxes["t"], frames)]
    starts = np.searchsorted(kept["t"], frames)
    np.savez(labels_in / "labels.npz", labels=kept, objframe_idx_2_label_idx=starts)
    np.save(labels_in / "timestamps_us.npy", np.array(frames, np.int64))
    np.save(events_in / "objframe_idx_2_repr_idx.npy", np.searchsorted(ends, frames))
    np.save(events_in / "timestamps_us.npy", np.array(ends, np.int64))
    shape = 2 * bins, size[1], size[0]
    with h5py.File(events_in / "event_representations.h5", "w") as file:
        data = file.create_dataset(
            *("data", (len(ends), *shape), np.uint8),
            **{"chunks": (1, *shape), "compression": "gzip", "compression_opts": 1},
        )
        # as RVT takes them, an event at the start and one at the end belong to a window
        windows = ((end - step, end + 1) for end in ends)
        for number, part in enumerate(in_windows(parts, windows, to_the_end=True)):
            data[number] = stacked_histogram(part.events, bins, size, how["cutoff"])
    return size, len(ends)


def _on_sensor(boxes: NDArray[Any] | None, size: tuple[int, int]) -> NDArray[Any] | None:
    """Return the boxes of which something is left where they are cut to the sensor, so cut."""
    if boxes is None:
        return None
    kept = boxes.copy()
    for low, length, most in (("x", "w", size[0] - 1), ("y", "h", size[1] - 1)):
        end = np.clip(kept[low] + kept[length], 0, most)
        kept[low] = np.clip(kept[low], 0, most)
        kept[length] = end - kept[low]
    return kept[(kept["w"] > 0) & (kept["h"] > 0)]


def _aligned(times: NDArray[np.int64], step: int, first_us: int) -> tuple[list[int], list[int]]:
    """Return the times of labels that a steady step of windows meets, and the ends of windows.

    Between two labels the step is stretched by what it is off, so that a window ends at each.
    """
    if not times.size:
        return [], []
    frames = [int(times[0])]
    ends = list(range(frames[0], first_us + step - 1, -step))[::-1]
    for t in times[1:].tolist():
        count = round((t - frames[-1]) / step)
        if count and abs(t - frames[-1] - count * step) <= _JITTER_US:
            ends += np.linspace(frames[-1], t, count + 1).astype(np.int64)[1:].tolist()
            frames.append(t)
    return frames, ends


def write_evreal(sequence: Sequence, folder: Path, how: Mapping[str, Any], tell: Tell) -> Made:
    """Write a recording and its images, if there are any, for EVREAL."""
    size, _, parts = events_in_order(sequence.file)
    folder.mkdir(parents=True)
    times = [] if sequence.file.shots is None else sequence.image_times_us
    before = np.zeros(len(times), np.int64)
    with ExitStack() as stack:
        ts, xy, p = (
            stack.enter_context(NpyFile(folder / f"events_{name}.npy", dtype, row))
            for name, dtype, row in (("ts", "<f8", ()), ("xy", "<u2", (2,)), ("p", "|u1", ()))
        )
        for events in parts:
            ts.add(events["t"] / 1e6)
            xy.add(np.stack([events["x"], events["y"]], axis=1))
            p.add(events["p"])
            before += np.searchsorted(events["t"], times)
    if not ts.count:
        raise DataError(f"{sequence.file.facts.path}: no events, and EVREAL needs one")
    if times:
        with NpyFile(folder / "images.npy", "|u1", (size[1], size[0], 1)) as images:
            for _, image in images_of(sequence):
                images.add(image[np.newaxis, ..., np.newaxis])
        np.save(folder / "images_ts.npy", np.array(times)[:, np.newaxis] / 1e6)
        np.save(folder / "image_event_indices.npy", before[:, np.newaxis])
    stated = json.dumps({"sensor_resolution": [size[1], size[0]]})
    (folder / "metadata.json").write_text(stated + "\n", "utf-8", newline="\n")
    return size, len(times)


class NpyFile:
    """A ``.npy`` whose rows come in parts; how many there are is written at the end."""

    def __init__(self, path: Path, dtype: DTypeLike, row: tuple[int, ...]) -> None:
        self._path, self._dtype, self._row = path, np.dtype(dtype), row
        self.count = 0

    def __enter__(self) -> NpyFile:
        self._file: BinaryIO = self._path.open("wb")
        self._length = self._header()
        return self

    def _header(self) -> int:
        """Write the header, in which NumPy leaves room for longer numbers of rows."""
        self._file.seek(0)
        shape = (self.count, *self._row)
        told = {"descr": npy.dtype_to_descr(self._dtype), "fortran_order": False, "shape": shape}
        npy.write_array_header_1_0(self._file, told)
        return self._file.tell()

    def add(self, rows: NDArray[Any]) -> None:
        """Append rows."""
        self._file.write(np.ascontiguousarray(rows, self._dtype).tobytes())
        self.count += len(rows)

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        with self._file:
            assert kind is not None or self._header() == self._length


_FLOW_STEPS, _FLOW_ZERO = 128, 1 << 15
"""Flow in DSEC's pictures: 128 for a pixel, from this on."""


def write_dsec(sequence: Sequence, folder: Path, how: Mapping[str, Any], tell: Tell) -> Made:
    """Write a recording, its images, flow and boxes, where there are any, in DSEC's folders."""
    size, _, parts = events_in_order(sequence.file)
    left, targets = folder / "events" / "left", sequence.targets
    left.mkdir(parents=True)
    metadata = {"source": {"name": sequence.file.facts.path.name}}
    _write_events(left / "events.h5", parts, size, metadata, how["threads"], "dsec")
    columns, rows = np.meshgrid(*(np.arange(n, dtype=np.float32) for n in size))
    with h5py.File(left / "rectify_map.h5", "w") as file:
        file["rectify_map"] = np.stack([columns, rows], axis=2)
    times = [] if sequence.file.shots is None else sequence.image_times_us
    if times:
        pictures = folder / "images" / "left" / "rectified"
        pictures.mkdir(parents=True)
        for number, (_, image) in enumerate(images_of(sequence)):
            (pictures / f"{number:06d}.png").write_bytes(png_of(image))
        _write_lines(folder / "images" / "timestamps.txt", times)
    if targets.flow:
        _write_dsec_flow(folder / "flow", targets)
    if targets.boxes is not None:
        tracks = folder / "object_detections" / "left"
        tracks.mkdir(parents=True)
        np.save(tracks / "tracks.npy", targets.boxes)
    return size, 1


def _write_dsec_flow(folder: Path, targets: Targets) -> None:
    (folder / "forward").mkdir(parents=True)
    assert targets.flow_us is not None
    for number, made in enumerate(targets.flow):
        flow = made()
        known = np.all(np.isfinite(flow), axis=0)
        held = np.rint(np.where(known, flow, 0) * _FLOW_STEPS + _FLOW_ZERO)
        known &= np.all((held >= 0) & (held < 1 << 16), axis=0)
        u, v = np.where(known, held, 0).astype(np.uint16)
        picture = np.stack([u, v, known.astype(np.uint16)], axis=2)
        (folder / "forward" / f"{number:06d}.png").write_bytes(png_of(picture))
    lines = [f"{start}, {stop}" for start, stop in targets.flow_us.tolist()]
    listing = folder / "forward_timestamps.txt"
    _write_lines(listing, ["# from_timestamp_us, to_timestamp_us", *lines])


def _write_lines(path: Path, lines: Iterable[Any]) -> None:
    path.write_text("".join(f"{line}\n" for line in lines), "utf-8", newline="\n")


def _write_events(
    path: Path,
    parts: Iterable[Events],
    size: tuple[int, int],
    metadata: dict[str, Any],
    threads: int | None,
    layout: str | None = None,
) -> None:
    with open_sink(
        *(path,), width=size[0], height=size[1], metadata=metadata, layout=layout, threads=threads
    ) as sink:
        for events in parts:
            sink.write_events(events)


def write_spikingjelly(sequence: Sequence, path: Path, how: Mapping[str, Any], tell: Tell) -> Made:
    """Write the events of a recording as arrays of their fields."""
    size, _, parts = events_in_order(sequence.file)
    events = np.concatenate([*parts])
    path.parent.mkdir(parents=True, exist_ok=True)
    x, y = (events[name].astype(np.int32) for name in "xy")
    np.savez_compressed(path, t=events["t"], x=x, y=y, p=events["p"])
    return size, 1


def write_nmnist(sequence: Sequence, path: Path, how: Mapping[str, Any], tell: Tell) -> Made:
    """Write the events of a recording as N-MNIST has them."""
    size, _, parts = events_in_order(sequence.file)
    path.parent.mkdir(parents=True, exist_ok=True)
    _write_events(path, parts, size, {}, how["threads"])
    path.with_name(f"{path.name}.json").unlink()  # export.json tells of all
    return size, 1
