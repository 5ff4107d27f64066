"""Recordings in AEDAT-2.0, as jAER writes them, in files that end on ``.aedat``.

Lines that begin with ``#`` and end with a carriage return and a line feed are followed by pairs of
words of 32 bits, big endian: an address, and a time [us].  Addresses of the chips DAVIS:

======= ====================================================================
bits    content
======= ====================================================================
31      0: event, 1: sample of a frame, or of the inertial unit
22-30   row, from the bottom
12-21   column; of events from the right, of samples from the left
11      of events: polarity
10      of events: set if it is no event but an external signal
10-11   of samples: 0 read after the reset, 1 signal, 3 the inertial unit
0-9     of samples: the number read
======= ====================================================================

Those of DVS128: 1-7 column, from the right; 8-14 row, from the bottom; 0 polarity, OFF if set; 15
set if it is no event.  The chip, and with it the size, stands in the line ``# AEChip:``.

A pixel of a frame is the number after the reset less the signal, up to 1023.  The time of a frame
is the mean time of all its samples.  That is the middle of the exposure, with a global shutter as
with a rolling one.

Traps: the header ends where a line does not begin with ``#``, so that an event in one of four rows
would be taken for a line of it: an external signal is written before.  Tonic reads the fifth word
of ``# Creation time:`` as a number.  Tonic and v2e know only events with both coordinates turned
round, EventCV leaves the columns as they are and takes the signal off the next reset.

References
----------
.. [1] iniVation, "AEDAT file formats",
   https://docs.inivation.com/software/software-advanced-usage/file-formats/aedat-2.0.html.
.. [2] jAER, DavisBaseCamera.java and DVS128.java, https://github.com/SensorsINI/jaer.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from adv2e.errors import DataError
from adv2e.events import Events
from adv2e.formats.binary import Numbers, blocks
from adv2e.formats.clock import CONTINUE, Clock
from adv2e.formats.event_file import Columns, EventFile, Facts
from adv2e.formats.writing import Request, Writer, to_line
from adv2e.label import guessed, left_out
from adv2e.sources.frame import Frame, Shot

_CHIPS = {
    "dvs128": (128, 128),
    "tmpdiff128": (128, 128),
    "davis240": (240, 180),
    "dvs240": (240, 180),
    "sbret10": (240, 180),
    "davis346": (346, 260),
    "davi346": (346, 260),
    "davis128": (128, 128),
    "davis208": (208, 192),
    "davis640": (640, 480),
}
_OLD = "dvs128", "tmpdiff128"  # with the other addresses
_WRITTEN = {(240, 180): "DAVIS240C", (346, 260): "Davis346blue"}
_UNKNOWN = (240, 180), (346, 260), (640, 480)  # sizes that are tried where no chip is stated

_PAIR = "(2,)>u4"
_BLOCK = 1 << 18  # pairs
_LONGEST = 1 << 23  # bytes of a header
_WHITE = 1023
_EXTERNAL = 1 << 10
_HEAD = (
    "#!AER-DAT2.0",
    "# This is a raw AE data file written by adv2e",
    "# Data format is int32 address, int32 timestamp (8 bytes total), repeated for each event",
    "# Timestamps tick is 1 us",
    "# Creation time: System.currentTimeMillis() 0",
)
_END = "#End Of ASCII Header"


def open_aedat2(path: Path, facts: Facts) -> EventFile:
    """Open an AEDAT-2.0 file.

    Raises
    ------
    DataError
        It is of another version, or of a chip that is not known.
    """
    lines, begin = _header(path)
    settings = _value(lines, "adv2e ")
    if settings:
        facts.describe(settings, f"{path}: header: adv2e", "the header")
    chip = _value(lines, "AEChip:")
    known = next((name for name in _CHIPS if name in chip.rpartition(".")[2].lower()), None)
    if chip and known is None:
        raise DataError(
            f"{path}: addresses of the chip {chip[:80]!r} are not known, only those of"
            f" {', '.join(name for name in _CHIPS if name.startswith('d'))}"
        )
    if known is not None:
        facts.state(_CHIPS[known], f"the chip {chip}")
    if facts.geometry is None:
        size, old = _likely(path, begin)
        facts.state(size, "that size")
        chosen = f"{size[0]}x{size[1]}"
        told = f"no chip stated: {'a DVS128' if old else 'a DAVIS'} of {chosen} pixels taken, the"
        told += " smallest that all addresses fit"
        facts.problems.append(guessed(told, "size", chosen, f"give --size {chosen}, or another"))
    else:
        old = known in _OLD
        size = facts.geometry
    frames = [] if old else _frames(path, begin, size, facts)
    if frames and "color" in chip.lower():
        facts.problems.append(left_out("frames hold a mosaic of colours, taken as grey"))
    whole = [frame for frame in frames if frame.is_whole]
    if len(whole) < len(frames):
        told = f"{len(frames) - len(whole)} of {len(frames)} frames are not whole: left out"
        facts.problems.append(left_out(told))
    shots = [
        Shot(frame.t_ns, f"{path}: frame {number}", partial(_load, path, begin, frame, size))
        for number, frame in enumerate(sorted(whole, key=lambda frame: frame.t_ns))
    ]

    def parts() -> Iterator[Columns]:
        clock = Clock(facts, bits=32)
        for pairs in blocks(path, begin, _PAIR, _BLOCK, facts):
            t = clock.ticks(pairs[:, 1], str(path))
            address = pairs[:, 0].astype(np.uint32)
            if old:
                is_event = address & 0x8000 == 0
                t, address = t[is_event], address[is_event].astype(np.int32)
                x, y, p = address >> 1 & 0x7F, address >> 8 & 0x7F, 1 - (address & 1)
            else:
                is_event = address & (1 << 31 | _EXTERNAL) == 0
                t, address = t[is_event], address[is_event].astype(np.int32)
                x, y, p = address >> 12 & 0x3FF, address >> 22, address >> 11 & 1
            yield t, size[0] - 1 - x, size[1] - 1 - y, p
        clock.tell()

    return EventFile("aedat2", facts, parts, (lambda: iter(shots)) if shots else None)


def _header(path: Path) -> tuple[list[str], int]:
    """Return the lines of the header, without ``#``, and its size [bytes]."""
    with path.open("rb") as file:
        data = file.read(_LONGEST)
    version = re.match(rb"#!AER-DAT([0-9.]{1,9})", data)
    if version is None:
        raise DataError(f"{path}: does not begin with '#!AER-DAT2.0', as AEDAT-2.0 does")
    if version[1] != b"2.0":
        name = version[1].decode("ascii")
        what = {
            "4": ", which is called .aedat4: rename it",
            "3": ", which is not read; iniVation's DV converts it to AEDAT4, which is",
        }.get(name[0], "; AEDAT-2.0 is read, which jAER writes, and AEDAT4")
        raise DataError(f"{path}: AEDAT-{name}{what}")
    lines, at = [], 0
    while data.startswith(b"#", at):
        end = data.find(b"\n", at)
        if end < 0 or b"\0" in data[at:end]:  # an event in a row that looks like a line
            break
        lines.append(data[at + 1 : end].decode("utf-8", "replace").strip())
        at = end + 1
        if lines[-1].lower().endswith("end of ascii header"):
            break
    return lines, at


def _value(lines: list[str], key: str) -> str:
    return next((line[len(key) :].strip() for line in lines if line.startswith(key)), "")


def _likely(path: Path, begin: int) -> tuple[tuple[int, int], bool]:
    """Return the size of the smallest chip that all addresses fit, and whether it is a DVS128."""
    columns = rows = largest = 0
    for pairs in blocks(path, begin, _PAIR, _BLOCK):
        address = pairs[:, 0].astype(np.uint32)
        largest = max(largest, int(address.max()))
        columns = max(columns, int((address >> 12 & 0x3FF).max()) + 1)
        rows = max(rows, int((address >> 22 & 0x1FF).max()) + 1)
    if 0 < largest < 1 << 16:
        return _CHIPS["dvs128"], True
    for size in _UNKNOWN:
        if columns <= size[0] and rows <= size[1]:
            return size, False
    raise DataError(
        f"{path}: no chip stated, and addresses of {columns}x{rows} pixels fit none that is known"
    )


@dataclass(frozen=True)
class _Frame:
    """Frame of a recording: range of its samples in the file, and its timestamp."""

    begin: int  # pairs
    end: int
    t_ns: int
    is_whole: bool


def _samples(address: NDArray[np.uint32]) -> tuple[Numbers, NDArray[np.bool_]]:
    """Return the indices of words that are samples of frames, and which of these are the signal."""
    kind = address >> 10 & 3
    at = np.flatnonzero((address >> 31 == 1) & (kind <= 1))
    return at, kind[at] == 1


def _frames(path: Path, begin: int, size: tuple[int, int], facts: Facts) -> list[_Frame]:
    """Return the frames of a recording.

    All are read from the same corner on.  It is that at which the fewest pixels were reset and not
    read yet.
    """
    corners = [x << 12 | y << 22 for x in (0, size[0] - 1) for y in (0, size[1] - 1)]
    found: list[list[NDArray[np.int64]]] = [[] for _ in corners]
    # of frames alone, times go on; events beside them need to be asked for
    clock, past = Clock(facts, bits=32, set_back=CONTINUE), 0
    total = np.zeros((3, 1), np.int64)  # samples after the reset, signals, and time of both
    for pairs in blocks(path, begin, _PAIR, _BLOCK):
        address, t = pairs[:, 0].astype(np.uint32), clock.ticks(pairs[:, 1], str(path))
        at, is_signal = _samples(address)
        if at.size:
            sums = total + np.cumsum([~is_signal, is_signal, t[at]], axis=1, dtype=np.int64)
            before = np.concatenate([total, sums[:, :-1]], axis=1)
            place = address[at] & 0x7FFF_F000
            for corner, rows in zip(corners, found, strict=True):
                here = np.flatnonzero((place == corner) & ~is_signal)
                if here.size:
                    rows.append(np.concatenate([at[None, here] + past, before[:, here]]))
            total = sums[:, -1:]
        past += len(pairs)
    marks = [np.concatenate(rows, axis=1) for rows in found if rows]
    if not marks:
        return []
    clock.tell()
    first = min(marks, key=lambda rows: float(np.mean(rows[1] - rows[2])))
    bounds = np.concatenate([first, [[past], *total]], axis=1)
    place, resets, signals, t = np.diff(bounds, axis=1)
    count = size[0] * size[1]
    return [
        _Frame(
            int(bounds[0, k]),
            int(bounds[0, k + 1]),
            int(t[k]) * 1000 // int(resets[k] + signals[k]),
            bool(resets[k] == count and signals[k] == count),
        )
        for k in range(place.size)
    ]


def _load(path: Path, begin: int, frame: _Frame, size: tuple[int, int]) -> Frame:
    width, height = size
    read = np.full((2, height, width), -1, np.int32)
    left = frame.end - frame.begin
    for pairs in blocks(path, begin + 8 * frame.begin, _PAIR, _BLOCK):
        address = pairs[:left, 0].astype(np.uint32)
        at, is_signal = _samples(address)
        sample = address[at].astype(np.int64)
        x, y = sample >> 12 & 0x3FF, height - 1 - (sample >> 22 & 0x1FF)
        if not (x < width).all() or not (y >= 0).all():
            raise DataError(f"{path}: a sample of a frame lies outside {width}x{height}")
        read[is_signal.astype(np.int64), y, x] = sample & 0x3FF
        left -= len(pairs)
        if left <= 0:
            break
    if (read < 0).any():
        raise DataError(f"{path}: a frame holds some pixels twice, and others not at all")
    return Frame((read[0] - read[1]).clip(0, _WHITE).astype(np.uint16), white=float(_WHITE))


class Aedat2Writer(Writer):
    """Writes the events of a DAVIS in AEDAT-2.0; see :class:`Writer`."""

    def __init__(self, request: Request, stack: ExitStack, path: Path) -> None:
        self._file = stack.enter_context(path.open("wb"))
        self._last = request.width - 1, request.height - 1
        chip = _WRITTEN.get((request.width, request.height))
        named = [f"# AEChip: eu.seebetter.ini.chips.davis.{chip}"] if chip else []
        lines = [*_HEAD, *named, f"# adv2e {to_line(request.description)}", _END]
        self._file.write("".join(f"{line}\r\n" for line in lines).encode("ascii"))
        self._is_first = True

    def write_events(self, events: Events) -> None:
        """Append events."""
        for begin in range(0, events.size, _BLOCK):
            part = events[begin : begin + _BLOCK]
            pairs = np.empty((part.size, 2), ">u4")
            x, y = (self._last[k] - part[name].astype(np.int32) for k, name in enumerate("xy"))
            pairs[:, 0] = y << 22 | x << 12 | part["p"].astype(np.int32) << 11
            pairs[:, 1] = part["t"]
            if self._is_first and int(pairs[0, 0]) >> 24 == ord("#"):
                self._file.write(np.array([_EXTERNAL, part["t"][0]], ">u4").data)
            self._is_first = False
            self._file.write(pairs.data)
