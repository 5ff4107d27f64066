"""Layouts of HDF5: in which datasets the events and frames are, and how they are read.

Layouts differ in names, data types and units, which a :class:`Layout` holds; one reader takes it
(:meth:`Layout.open`), and one writer (:mod:`adv2e.formats.hdf5_writer`).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from decimal import Decimal
from functools import partial
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import DTypeLike, NDArray

from adv2e.errors import DataError
from adv2e.formats import hdf5
from adv2e.formats.clock import unwrapped
from adv2e.formats.event_file import Columns, EventFile, Facts
from adv2e.label import told_of
from adv2e.sources.frame import Frame, Shot
from adv2e.sources.times.rates import Unit, frame_unit
from adv2e.ticks import NS, US, S, to_ticks

_COARSE_US = 1 << 24
"""Times from which on single precision has steps of more than 1 us [us]."""
_FEW = 100
"""Number of times below which all may be even by chance."""

_KINDS = {"t": "fiu", "x": "iu", "y": "iu", "p": "biuf"}
"""Kinds of numbers that columns may be of."""


@dataclass(frozen=True, kw_only=True)
class Layout:
    """Datasets of a layout, and what is in them.

    A ``*`` in names is the camera, left or right, of which one is read; see :meth:`of`.

    Attributes
    ----------
    name, version : str
        What it is called.
    events : str
        Dataset of the events; with ``{}`` one dataset for each column, the braces its name.
    order : str
        The columns t, x, y and p in the order in which they are written, which is that within a
        single dataset; empty: that is of records.
    kinds : tuple of data type
        Of the columns as they are written, in that order.
    unit_ns : int
        Unit of the times [ns].
    unit_varies : bool
        Files of others may have another unit, which is told from the times.
    is_signed : bool
        Polarities are written as -1 and 1, not 0 and 1.
    index : str
        Dataset with the first event of each millisecond.  With it, times are in `unit_ns`.
    offset : str
        Dataset with a number that is to be added to all times [us].
    frames, stamps : str
        Dataset of the frames, and of their times; without these, a group of images that have their
        times as attributes.
    stamps_ns : int
        Unit of the times of the frames [ns].
    before, last : str
        Dataset with the number of events before each frame, or of the last of these.
    """

    name: str
    events: str
    version: str = "1"
    order: str = "xytp"
    kinds: tuple[DTypeLike, ...] = ()
    unit_ns: int = US
    unit_varies: bool = False
    is_signed: bool = False
    index: str = ""
    offset: str = ""
    frames: str = ""
    stamps: str = ""
    stamps_ns: int = US
    before: str = ""
    last: str = ""

    @property
    def columns(self) -> dict[str, str]:
        """Datasets by the columns that they hold; empty: one dataset holds all."""
        if "{}" not in self.events:
            return {}
        return {column: self.events.format(column) for column in self.order}

    @property
    def datasets(self) -> list[str]:
        """Datasets of times, columns, rows and polarities, or the one that holds all."""
        return [self.columns[column] for column in "txyp"] if self.columns else [self.events]

    def of(self, side: str, side_of_frames: str | None = None) -> Layout:
        """Return the layout of one camera, and of the same one's frames or those of the other."""
        names = {
            name: getattr(self, name).replace("*", side_of_frames or side)
            for name in ("frames", "stamps", "before", "last")
        }
        events, index = (text.replace("*", side) for text in (self.events, self.index))
        return replace(self, events=events, index=index, **names)

    def open(self, path: Path, facts: Facts) -> EventFile:
        """Open a file of this layout.

        Raises
        ------
        DataError
            Datasets of other shapes, lengths or kinds; times that are not finite or beyond 146
            years; a broken image; or something that is not in the file itself.
        """
        with hdf5.opened(path) as file:
            here = self
            if "*" in self.events:
                here = self.of(*hdf5.choose(file, facts, self.events.format("t"), self.frames))
            group = here.events.rpartition("/")[0]
            hdf5.describe(file, facts, here.events, group, f"{group}/calib")
            facts.uncarried += hdf5.besides(file, group)
            offset = 0
            if self.offset and hdf5.find(file, self.offset) is not None:
                offset = hdf5.number(file, self.offset)
            images = _Images(file, self.frames, facts) if here.frames and not here.stamps else None
            unit_ns = here._unit_ns(here._stored(file), file, facts)
            if images is not None:
                shots = images.shots(path, facts)
            else:
                shots = here._shots(file, path, facts) if here.frames else []
        if abs(offset) > 1 << 53:
            raise DataError(f"{path}: {self.offset} of {offset} us is beyond 146 years")
        return EventFile(
            self.name,
            facts,
            partial(here._parts, path, facts),
            (lambda: iter(shots)) if shots else None,
            unit_ns=unit_ns,
            offset_us=offset,
            times=here.datasets[0],
            order="" if self.columns else self.order,
        )

    def _stored(self, file: h5py.File) -> list[h5py.Dataset]:
        """Return the datasets of the events; DataError if they cannot be these."""
        names = self.datasets
        found = [hdf5.dataset(file, name) for name in names]
        events = found[0]
        kind = events.dtype
        if self.columns:
            if len({column.shape for column in found}) != 1 or events.ndim != 1:
                shapes = ", ".join(f"{n} {c.shape}" for n, c in zip(names, found, strict=True))
                raise DataError(f"{file.filename}: columns must be of one length, got {shapes}")
            for column, kinds in zip(found, _KINDS.values(), strict=True):
                if column.dtype.kind not in kinds:
                    raise DataError(
                        f"{file.filename}: {column.name[1:]} must hold numbers, not {column.dtype}"
                    )
        elif self.order:
            if events.ndim != 2 or events.shape[1] != 4 or kind.kind not in "iuf":
                raise DataError(
                    f"{file.filename}: {self.events} must be (events, 4) numbers, got"
                    f" {events.shape} of {kind}"
                )
        else:
            fields = {name: field[0].kind for name, field in (kind.fields or {}).items()}
            if events.ndim != 1 or any(fields.get(name) not in ("i", "u") for name in "xypt"):
                raise DataError(
                    f"{file.filename}: {self.events} must be records of the whole numbers x, y, p,"
                    f" t, got {kind}"
                )
        what = names[0].rpartition("/")[0] if self.columns else self.events
        hdf5.check_stored(found, f"{file.filename}: {what}")
        return found

    def _part(self, stored: list[h5py.Dataset], begin: int) -> list[NDArray[Any]]:
        """Return times, columns, rows and polarities of some events."""
        part = [dataset[begin : begin + hdf5.PART] for dataset in stored]
        if self.columns:
            return part
        rows = part[0]
        return [rows[:, self.order.index(name)] if self.order else rows[name] for name in "txyp"]

    def _unit_ns(self, stored: list[h5py.Dataset], file: h5py.File, facts: Facts) -> int:
        if not self.unit_varies or (self.index and hdf5.find(file, self.index) is not None):
            return self.unit_ns
        t, x, y, _ = self._part(stored, 0)
        facts.time_unit = facts.time_unit or hdf5.unit_of(stored[0])
        return facts.unit_of_events(t, x, y, facts.geometry, whole=t.dtype.kind != "f").ns

    def _parts(self, path: Path, facts: Facts) -> Iterator[Columns]:
        late = odd = last = 0
        with hdf5.opened(path) as file:
            stored = self._stored(file)
            count = stored[0].shape[0]
            for begin in range(0, count, hdf5.PART):
                t, x, y, p = self._part(stored, begin)
                if self.order and not self.columns and t.dtype.kind != "f":
                    late += int(np.count_nonzero(t >= _COARSE_US))
                    odd += int(np.count_nonzero((t >= _COARSE_US) & (t % 2 == 1)))
                    last = max(last, int(t.max()))
                x, y = (_whole(v, f"{path}: {self.events}, {n}") for n, v in (("x", x), ("y", y)))
                yield t, x, y, hdf5.signs(p)
                facts.progress(begin + t.size, count)
        if late >= _FEW and not odd and not facts.description:
            facts.tell(
                f"times were made in single precision: from {_COARSE_US / 1e6:.1f} s on they have"
                f" steps of 2 us and more, at the end of {float(np.spacing(np.float32(last))):g} us"
            )

    def _shots(self, file: h5py.File, path: Path, facts: Facts) -> list[Shot]:
        """Return the frames of the dataset, if there are any."""
        stack = self._stack(file)
        if stack is None:
            return []
        facts.state((stack.shape[2], stack.shape[1]), f"/{self.frames}")
        label = f"{path}: {self.stamps}"
        stamps = hdf5.read_all(hdf5.dataset(file, self.stamps), label).reshape(-1)
        if stamps.size != stack.shape[0]:
            raise DataError(f"{label} holds {stamps.size} times for {stack.shape[0]} frames")
        times = to_ticks(unwrapped(stamps), self.stamps_ns, NS, label)
        if stamps.dtype.kind == "f" and stamps.dtype.itemsize < 8:
            step_us = float(np.spacing(stamps.max())) * self.stamps_ns / US
            if step_us > 1:
                facts.problems.append(
                    f"/{self.stamps} is of single precision: times of frames have steps of up to"
                    f" {step_us:.3g} us"
                )
        return [
            Shot(t_ns, f"{path}: {self.frames} {number}", partial(self._frame, path, number))
            for number, t_ns in enumerate(times.tolist())
        ]

    def _stack(self, file: h5py.File) -> h5py.Dataset | None:
        if hdf5.find(file, self.frames) is None:
            return None
        stack = hdf5.dataset(file, self.frames)
        if stack.ndim != 3 or 0 in stack.shape[1:] or stack.dtype not in (np.uint8, np.uint16):
            raise DataError(
                f"{file.filename}: {self.frames} must be (frames, rows, columns) of 8 or 16 bits,"
                f" got {stack.shape} of {stack.dtype}"
            )
        return stack if stack.shape[0] else None

    def _frame(self, path: Path, number: int) -> Frame:
        with hdf5.opened(path) as file:
            stack = self._stack(file)
            assert stack is not None
            return Frame(np.ascontiguousarray(stack[number]))


def _whole(values: NDArray[Any], label: str) -> NDArray[Any]:
    if values.dtype.kind != "f":
        return values
    values = np.rint(values.astype(np.float64))
    if not np.all(np.abs(values) < 1 << 31):  # nor is NaN
        raise DataError(f"{label} holds numbers that are no coordinates")
    return values.astype(np.int64)


class _Images:
    """Images in a group, in the order of their names, each with its time in an attribute."""

    def __init__(self, file: h5py.File, group: str, facts: Facts) -> None:
        images = hdf5.find(file, group)
        if isinstance(images, h5py.Dataset):
            raise DataError(f"{facts.path}: {group} is a dataset, must be a group of images")
        self._group = group
        self._names = [f"{group}/{name}" for name in sorted(images if images is not None else ())]
        found = [hdf5.dataset(file, name) for name in self._names]
        if found:
            height, width = _shape(facts.path, found[0])[:2]
            facts.state((width, height), "the first image")
        is_exact = all("timestamp_ns" in image.attrs for image in found)
        self._attribute = "timestamp_ns" if is_exact else "timestamp"
        self._stamps = [_stamp(facts.path, image, self._attribute) for image in found]
        self._whole = all(stamp.dtype.kind != "f" for stamp in self._stamps)
        if len(found) > 1 and not is_exact:
            facts.note_frames(self._unit(None, facts.stated_unit), whole=self._whole)

    def _unit(self, given: str | None, stated: str | None) -> Unit:
        if self._attribute == "timestamp_ns":
            return Unit("ns")
        values = [Decimal(stamp.item()) for stamp in self._stamps]
        return frame_unit(values, given=given, stated=stated)

    def shots(self, path: Path, facts: Facts) -> list[Shot]:
        """Return the frames, once the unit of the times of the events is known."""
        unit = self._unit(facts.unit_of_frames(whole=self._whole), facts.stated_unit)
        if unit.doubt:
            facts.problems.append(told_of(self._group, unit.doubt))
        shots = []
        for name, stamp in zip(self._names, self._stamps, strict=True):
            (t_ns,) = to_ticks(stamp, unit.ns, NS, f"{path}: /{name}: {self._attribute}").tolist()
            shots.append(Shot(t_ns, f"{path}: {name}", partial(_image, path, name)))
        return shots


def _stamp(path: Path, image: h5py.Dataset, name: str) -> NDArray[Any]:
    if name in image.attrs:
        stamp = np.asarray(image.attrs[name])
        if stamp.size == 1 and stamp.dtype.kind in "iuf":
            if not np.all(np.isfinite(stamp)):
                raise DataError(f"{path}: {image.name}: {name} holds NaN or infinite times")
            return stamp.reshape(1)
    raise DataError(f"{path}: {image.name} has no attribute timestamp [s]")


def _shape(path: Path, image: h5py.Dataset) -> tuple[int, ...]:
    shape = tuple(image.shape)
    if len(shape) not in (2, 3) or (len(shape) == 3 and shape[2] not in (1, 3)) or 0 in shape:
        raise DataError(f"{path}: {image.name[1:]} is no image, but of shape {shape}")
    if image.dtype.kind not in "uif":
        raise DataError(f"{path}: {image.name[1:]} is no image, but of {image.dtype}")
    return shape


def _image(path: Path, name: str) -> Frame:
    with hdf5.opened(path) as file:
        found = hdf5.dataset(file, name)
        shape = _shape(path, found)
        image = hdf5.read_all(found, f"{path}: {name}")
    if len(shape) == 3:
        image = image[..., 0] if shape[2] == 1 else image[..., ::-1]
    return Frame(np.ascontiguousarray(image))


MONASH = Layout(
    name="monash",
    version="2",
    events="events/{}s",
    kinds=(np.int16, np.int16, np.float64, np.int8),
    unit_ns=S,
    unit_varies=True,
    frames="images",
)
"""Layout of ``event_utils`` and ``event_cnn_minimal`` (Monash University).

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
HDF5 has none of: h5py stores an enumeration, which MATLAB reads as words.  Polarities that are read
may be bool, 0/1 or -1/+1; times are seconds, unless they tell another unit
(:mod:`adv2e.sources.times.rates`); frames come in the order of their names.

``event_idx`` is the index of the last event before the frame,
``max(searchsorted(ts, timestamp) - 1, 0)``.

References
----------
.. [1] T. Stoffregen et al., "Reducing the sim-to-real gap for event cameras", ECCV 2020,
   arXiv:2003.09078; github.com/TimoStoff/event_utils, event_cnn_minimal.
"""

DSEC = Layout(
    name="dsec",
    events="events/{}",
    kinds=(np.uint16, np.uint16, np.uint32, np.uint8),
    unit_varies=True,
    index="ms_to_idx",
    offset="t_offset",
)
"""Layout of the data set DSEC, which loaders of DSEC, RVT and TUM-VIE read.

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

V2E = Layout(
    name="v2e",
    events="events",
    order="txyp",
    kinds=(np.uint32,),
    frames="frame",
    stamps="frame_ts",
    before="frame_idx",
)
"""Layout of v2e.

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

MVSEC = Layout(
    name="mvsec",
    events="davis/*/events",
    kinds=(np.float64,),
    unit_ns=S,
    is_signed=True,
    frames="davis/*/image_raw",
    stamps="davis/*/image_raw_ts",
    stamps_ns=S,
    last="davis/*/image_raw_event_inds",
)
"""Layout of the data set MVSEC, of its left DAVIS or the right one.

================================= ==============================================================
/davis/left/events                float64 (events, 4): column, row, time [s], polarity -1/+1
/davis/left/image_raw             uint8 (frames, rows, columns), grey
/davis/left/image_raw_ts          float64 (frames) [s]
/davis/left/image_raw_event_inds  int64 (frames), the last event before each
================================= ==============================================================

Times of the data set are dates.  The size of the sensor is that of the frames.

References
----------
.. [1] A. Z. Zhu et al., "The Multivehicle Stereo Event Camera Dataset: An Event Camera Dataset for
   3D Perception", RA-L 2018, arXiv:1801.10202.
"""

M3ED = Layout(
    name="m3ed",
    events="prophesee/*/{}",
    order="txyp",
    kinds=(np.int64, np.uint16, np.uint16, np.int8),
    index="prophesee/*/ms_map_idx",
)
"""Layout of the data set M3ED, of its left camera or the right one.

================================= ==============================================================
/prophesee/left/x, y              uint16, column and row
/prophesee/left/t                 int64 [us]
/prophesee/left/p                 int8, 1 is ON and 0 is OFF
/prophesee/left/ms_map_idx        uint64, for each millisecond the first event at it or after
/prophesee/left/calib/resolution  columns and rows of the sensor
================================= ==============================================================

References
----------
.. [1] K. Chaney et al., "M3ED: Multi-Robot, Multi-Sensor, Multi-Environment Event Dataset", CVPRW
   2023; github.com/daniilidis-group/m3ed.
"""

PROPHESEE = Layout(name="prophesee", events="CD/events", order="")
"""Layout of Prophesee's tools, as far as it is not compressed by their own filter.

=========================== ====================================================================
/CD/events                  records of x, y (uint16), p (int16, 1 is ON and 0 is OFF), t (int64, us)
attribute geometry          columns x rows of the sensor, such as 1280x720
=========================== ====================================================================

Their tools compress with ECF (filter 36559), for which h5py needs a plug-in that no package has:
such files are refused in a line that says what helps.  They are not written, as their reader takes
only those compressed so; it reads .raw and .dat as well.

References
----------
.. [1] Prophesee, "HDF5 Event File Format", docs.prophesee.ai, data/file_formats/hdf5.html.
"""
