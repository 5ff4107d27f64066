"""HDF5 recordings of DDD17 and DDD20: packets of cAER, as they came from a DAVIS346B in a car.

=========================== ====================================================================
/dvs/data                   (rows, 3) of bytes of any number: time of the computer [us] in digits,
                            head and body of a packet; rows behind the last packet are empty
/dvs/timestamp              int64, time of the computer [us]
head, 28 bytes              int16 type and source; int32 bytes of an item, place of its time, how
                            often the time has wrapped, capacity, number of items, valid ones
items of type 0, special    uint32: bit 0 valid, bits 1..7 kind (0: wrapped, 1: reset); int32 time
items of type 1, polarity   uint32: bit 0 valid, bit 1 ON, bits 2..16 row, bits 17..31 column; time
items of type 2, frame      nine of 32 bits: valid and channels; begin and end of the readout; begin
                            and end of the exposure; columns, rows; two of the region; uint16 pixels
=========================== ====================================================================

All numbers are little-endian, and times are microseconds of 31 bits.  The body has room for as many
items as the capacity says, of which the number counts.  A frame is at the middle of its exposure,
as cAER has it (the readers published with the data take the end of its readout, which is some
milliseconds later).  Where the clock of the camera was set back to zero, times go on from those
before.

What ``export_ddd20_hdf.py`` makes of them is another layout:

=========================== ====================================================================
/event                      uint32 (events, 4): time [us], column, row, polarity 0/1
/frame                      uint8 (frames, 260, 346)
/frame_ts                   float32 [s], steps of which are 61 us after ten minutes
=========================== ====================================================================

References
----------
.. [1] J. Binas et al., "DDD17: End-To-End DAVIS Driving Dataset", 2017, arXiv:1711.01458.
.. [2] Y. Hu et al., "DDD20 End-to-End Event Camera Driving Dataset", 2020, arXiv:2005.08605;
   github.com/SensorsINI/ddd20-utils, interfaces/caer.py, record.py.
.. [3] libcaer, include/libcaer/events/common.h, polarity.h, frame.h, special.h.
"""

from __future__ import annotations

import struct
from collections.abc import Generator, Iterator
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from adv2e.errors import DataError
from adv2e.formats import hdf5
from adv2e.formats.clock import CONTINUE, Clock
from adv2e.formats.event_file import Columns, EventFile, Facts
from adv2e.formats.hdf5_layouts import Layout
from adv2e.label import guessed, left_out
from adv2e.sources.frame import Frame, Shot
from adv2e.ticks import S

_SPECIAL, _POLARITY, _FRAME, _IMU = range(4)
_IMU_HERE = "IMU in dvs/data"

_HEAD = struct.Struct("<hhiiiiii")
_FRAME_HEAD = 36
_WRAP = 1 << 31
_WRAPS = range(1 << 21)
"""More wraps are beyond 142 years."""
_ROWS = 64
"""Rows read at once, of which each may be a frame."""
_SIZE = (346, 260)

_EXPORTED = Layout(
    name="ddd20", events="event", order="txyp", frames="frame", stamps="frame_ts", stamps_ns=S
)
"""Layout of what is exported."""

_UPSIDE_DOWN = (
    "the cameras of DDD17 and DDD20 were mounted upside down: --rotate180 turns frames and events"
)


@dataclass(frozen=True)
class _Packet:
    row: int
    kind: int
    wraps: int
    items: NDArray[np.uint8]
    """A row of bytes for each."""


def open_ddd(path: Path, facts: Facts) -> EventFile:
    """Open a recording of packets; its first frame is looked for.

    Raises
    ------
    DataError
        A row that is no packet, or frames that are not of one channel.
    """
    seen = Facts(path)
    with closing(_frames(path, seen)) as frames:
        first = next(frames, None)
    with hdf5.opened(path) as file:
        facts.uncarried += [*seen.uncarried, *(name for name in file if name != "dvs")]
    if first is None:
        size = f"{_SIZE[0]}x{_SIZE[1]}"
        told = f"no frame tells the size of the sensor: {size} taken, as in all of DDD17 and DDD20"
        facts.problems.append(guessed(told, "size", size, f"give --size {size}"))
        facts.state(_SIZE, "DDD17")
        shots = None
    else:
        rows, columns = first.load().image.shape[:2]
        facts.state((columns, rows), "the first frame")
        shots = partial(_frames, path, facts)
    _tell_upside_down(facts)
    return EventFile("ddd", facts, partial(_events, path, facts), shots)


def open_exported(path: Path, facts: Facts) -> EventFile:
    """Open an exported recording."""
    file = _EXPORTED.open(path, facts)
    facts.state(_SIZE, "DDD20")
    _tell_upside_down(facts)
    return file


def _tell_upside_down(facts: Facts) -> None:
    """Tell of the way in which the cameras were mounted, unless the user knows."""
    if not facts.selection.rotate180:
        facts.problems.append(_UPSIDE_DOWN)


def _events(path: Path, facts: Facts) -> Iterator[Columns]:
    """Yield the events, and tell what was wrong with them."""
    waiting: list[tuple[NDArray[np.int64], NDArray[np.uint32]]] = []
    held = invalid = 0
    clock = _Clock(facts)
    for packet in _packets(path, facts):
        if packet.kind == _SPECIAL:
            clock.note(packet)
        elif packet.kind == _POLARITY and len(packet.items):
            times, words = clock.times(packet), _words(packet, 0).view("<u4")
            valid = words & 1 == 1
            invalid += words.size - int(np.count_nonzero(valid))
            waiting.append((times[valid], words[valid]))
            held += words.size
        if held >= hdf5.PART:
            yield _columns(waiting)
            waiting, held = [], 0
    if waiting:
        yield _columns(waiting)
    if invalid:
        facts.tell(left_out(f"{invalid} events are marked as invalid: left out"))
    clock.tell()


def _columns(waiting: list[tuple[NDArray[np.int64], NDArray[np.uint32]]]) -> Columns:
    times = np.concatenate([t for t, _ in waiting])
    words = np.concatenate([word for _, word in waiting])
    pairs = (words >> 17, (words >> 2) & 0x7FFF, (words >> 1) & 1)
    x, y, p = (column.astype(kind) for column, kind in zip(pairs, ("u2", "u2", "i1"), strict=True))
    return times, x, y, p


def _frames(path: Path, facts: Facts) -> Generator[Shot, None, None]:
    clock = _Clock(facts)
    for packet in _packets(path, facts):
        if packet.kind == _SPECIAL:
            clock.note(packet)
        elif packet.kind == _POLARITY and len(packet.items):
            clock.times(packet)
        elif packet.kind == _FRAME:
            for number, item in enumerate(packet.items):
                label = f"{path}: dvs/data row {packet.row}"
                info, _, _, begin, end = item[:20].view("<i4").tolist()
                if info & 1:
                    middle = begin + (end - begin) % _WRAP // 2
                    t_us = packet.wraps * _WRAP + middle + clock.offset
                    yield Shot(t_us * 1000, label, partial(_load, path, packet.row, number))


def _load(path: Path, row: int, number: int) -> Frame:
    label = f"{path}: dvs/data row {row}"
    with hdf5.opened(path) as file:
        (packet,) = _packets_of(_data(file), row, row + 1, str(path))
        item = packet.items[number]
    columns, rows = item[20:28].view("<i4").tolist()
    channels = int(item[0]) >> 1 & 7
    if channels > 1:
        raise DataError(f"{label}: a frame of {channels} channels, must be grey")
    end = _FRAME_HEAD + 2 * rows * columns
    if min(rows, columns) < 1 or end > item.size:
        raise DataError(
            f"{label}: a frame of {columns}x{rows} pixels in {item.size - _FRAME_HEAD} bytes"
        )
    return Frame(item[_FRAME_HEAD:end].view("<u2").astype(np.uint16).reshape(rows, columns))


def _packets(path: Path, facts: Facts) -> Iterator[_Packet]:
    with hdf5.opened(path) as file:
        data = _data(file)
        rows = data.shape[0]
        for begin in range(0, rows, _ROWS):
            end = min(begin + _ROWS, rows)
            for packet in _packets_of(data, begin, end, str(path)):
                if packet.kind == _IMU and _IMU_HERE not in facts.uncarried:
                    facts.uncarried.append(_IMU_HERE)
                yield packet
            facts.progress(end, rows)


def _data(file: h5py.File) -> h5py.Dataset:
    data = hdf5.dataset(file, "dvs/data")
    if h5py.check_vlen_dtype(data.dtype) != np.uint8 or data.shape[1:] != (3,):
        raise DataError(f"{file.filename}: dvs/data must be rows of three times bytes")
    hdf5.check_stored([data], f"{file.filename}: dvs/data")
    return data


def _packets_of(data: h5py.Dataset, begin: int, end: int, path: str) -> Iterator[_Packet]:
    for row, (head, body) in enumerate(data[begin:end, 1:], begin):
        if not head.size and not body.size:
            continue
        label = f"{path}: dvs/data row {row}"
        if head.size != _HEAD.size:
            raise DataError(f"{label}: a head of {head.size} bytes, must be {_HEAD.size}")
        kind, _, size, _, wraps, capacity, number, _ = _HEAD.unpack(head.tobytes())
        least = _FRAME_HEAD if kind == _FRAME else 8
        if size < least or size % 4 or not 0 <= number <= capacity or wraps not in _WRAPS:
            raise DataError(
                f"{label}: its head states {number} of {capacity} items of {size} bytes,"
                f" {wraps} wraps: damaged"
            )
        if body.size != size * capacity:
            raise DataError(
                f"{label}: holds {body.size} bytes of items, its head states {capacity} of {size}"
            )
        yield _Packet(row, kind, wraps, body.reshape(capacity, size)[:number])


def _words(packet: _Packet, place: int) -> NDArray[Any]:
    """Return one number of 32 bits of each item."""
    words = np.ascontiguousarray(packet.items).view("<i4")[:, place]
    return np.ascontiguousarray(words)


class _Clock(Clock):
    """The clock of packets, which goes on where it was set back, even if nothing says so."""

    def __init__(self, facts: Facts) -> None:
        super().__init__(facts, bits=31, set_back=CONTINUE)

    def note(self, packet: _Packet) -> None:
        """Take note of special events."""
        kinds = _words(packet, 0).view("<u4") >> 1 & 0x7F
        self.announced |= bool(np.any(kinds <= 1))

    def times(self, packet: _Packet) -> NDArray[np.int64]:
        """Return the times of the items of a packet, none of them empty [us]."""
        times = _words(packet, 1).astype(np.int64) + packet.wraps * _WRAP
        return self.ticks(times, f"{self._facts.path}: dvs/data row {packet.row}")
