"""Parts of a conversion: the events of a share of the pixels, in a file until all are merged.

Pixels know nothing of each other, so their events may be made apart, by other processes or on other
machines.  What the readout does to events follows when they are merged.

The file is nothing but a store.  A line of JSON says what it is a part of; blocks of at most
:data:`BLOCK` events follow, each behind its numbers of events and bytes, with its bytes grouped by
rank and deflated, with a checksum; a block of no events, with JSON likewise deflated, is the end.
"""

from __future__ import annotations

import json
import struct
import time
import zlib
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from adv2e.background import OrderedWork
from adv2e.causes import CAUSED_DTYPE
from adv2e.config import Config
from adv2e.config.active_effects import active_hooks
from adv2e.conversion.pipeline import decoding_of
from adv2e.conversion.reading import Decoding, Reading
from adv2e.conversion.simulation import share_of_events
from adv2e.effects.reorder_buffer import count_before
from adv2e.errors import DataError
from adv2e.events import EVENT_DTYPE, Events
from adv2e.files.staging import Staging, writing
from adv2e.formats.compression import compress_shuffled
from adv2e.light.decoding import kernel_table
from adv2e.pixel.array import Share, pixels_of_share

BLOCK = 1 << 16
"""Most events of a block."""

_HEAD = struct.Struct("<II")
_LONGEST = 1 << 16
"""Bytes of the longest line."""


def make_part(
    reading: Reading, path: Path, key: str, share: Share, *, config: Config, causes: bool
) -> None:
    """Convert a share of the pixels to a part; what is there is replaced at the end.

    Parameters
    ----------
    reading : Reading
        Input, within its context.
    path : Path
    key : str
        Of what this is a part: it is read with the same one only.
    share : (int, int)
        See :func:`adv2e.pixel.array.pixels_of_share`.
    config : Config
    causes : bool
        The events know theirs.

    Raises
    ------
    Adv2eError
        As :func:`adv2e.conversion.pipeline.convert_reading`.
    """
    began = time.perf_counter()
    recording = reading.source
    decoder, fitting = decoding_of(recording, config)
    width, height = (recording.width, recording.height) if fitting is None else fitting.size
    begin, end = pixels_of_share(width * height, share)
    if path.is_symlink():  # what it leads to is not ours to replace
        path.unlink()
    with Staging(True, reading.inputs) as staging:
        temporary = staging.file(path)
        staging.prepare()
        with writing(path):
            file = temporary.open("wb")
        with file, OrderedWork(reading.threads - 1) as work:
            store = _Store(file, path, key, work)
            if begin < end:
                hooks = active_hooks(config)
                table = kernel_table(decoder, config.sampling, hooks, fitting)
                decoding = Decoding(
                    decoder, table is not None, False, config.frames.full_scale, fitting=fitting
                )
                for events in share_of_events(
                    ((still.t_ns, still.light) for still in reading.stills(decoding)),
                    config,
                    share,
                    hooks=hooks,
                    threads=reading.threads,
                    table=table,
                    causes=causes,
                ):
                    store.add(events)
                    del events  # or they would stay while the next ones are made
            store.finish()
            work.finish()
            store.end({"seconds": round(time.perf_counter() - began, 3)})


class _Store:
    """Writes a part."""

    def __init__(self, file: BinaryIO, path: Path, key: str, work: OrderedWork) -> None:
        self._file, self._path, self._work = file, path, work
        self._held: list[Events] = []
        self._count = 0
        self._write(json.dumps({"key": key}).encode("ascii") + b"\n")

    def add(self, events: Events) -> None:
        self._held.append(events)
        self._count += events.size
        if self._count >= BLOCK:
            self._flush(self._count - self._count % BLOCK)

    def finish(self) -> None:
        self._flush(self._count)

    def end(self, told: dict[str, Any]) -> None:
        self._block(0, zlib.compress(json.dumps(told).encode("ascii")))

    def _flush(self, count: int) -> None:
        """Write so many events."""
        if not count:
            return
        events = np.concatenate(self._held)
        for begin in range(0, count, BLOCK):
            block = events[begin : min(begin + BLOCK, count)].copy()
            self._work.submit(_compressed, block, take=lambda made: self._block(*made))
        self._held = [events[count:].copy()]
        self._count -= count

    def _block(self, count: int, data: bytes) -> None:
        self._write(_HEAD.pack(count, len(data)) + data)

    def _write(self, data: bytes) -> None:
        with writing(self._path):
            self._file.write(data)


def _compressed(events: Events) -> tuple[int, bytes]:
    return events.size, compress_shuffled(events)


def told_of_part(path: Path, key: str, causes: bool) -> dict[str, Any] | None:
    """Return the record at the end of a part; None: the part is missing or incomplete."""
    told: dict[str, Any] = {}
    try:
        for _ in read_part(path, key, causes, told):
            pass
    except (DataError, OSError):
        return None
    return told


def read_part(
    path: Path, key: str, causes: bool, told: dict[str, Any] | None = None
) -> Iterator[Events]:
    """Yield the events of a part, block by block; `told` takes what its end tells.

    Raises
    ------
    DataError
        It is damaged, or of something else.
    OSError
        It cannot be read.
    """
    dtype = CAUSED_DTYPE if causes else EVENT_DTYPE
    damaged = DataError(f"{path}: is damaged, or no part of this conversion: call again")
    with path.open("rb") as file:
        try:
            if json.loads(file.readline(_LONGEST)) != {"key": key}:
                raise damaged
            while True:
                count, length = _HEAD.unpack(file.read(_HEAD.size))
                if count > BLOCK or length > 2 * BLOCK * dtype.itemsize:
                    raise damaged
                data = file.read(length)
                if len(data) < length:
                    raise damaged
                if not count:
                    break
                yield _events(data, count, dtype)
            if file.read(1):
                raise damaged
            found = json.loads(_inflated(data, _LONGEST))
            if told is not None:
                told |= found
        except (ValueError, TypeError, struct.error, zlib.error, RecursionError):
            raise damaged from None


def _events(data: bytes, count: int, dtype: np.dtype[Any]) -> Events:
    values = np.frombuffer(_inflated(data, count * dtype.itemsize), np.uint8)
    return values.reshape(dtype.itemsize, count).T.copy().view(dtype).reshape(count)


def _inflated(data: bytes, most: int) -> bytes:
    """Return inflated data of at most `most` bytes; ValueError if the input is incomplete."""
    inflating = zlib.decompressobj()
    found = inflating.decompress(data, most + 1)
    if not inflating.eof or inflating.unused_data:
        raise ValueError
    return found


def merged(parts: Sequence[Iterator[Events]]) -> Iterator[Events]:
    """Yield the events of all parts by time, those of one time in the order of the parts.

    Memory is that of about two blocks a part.
    """
    firsts = ((part, next(part, None)) for part in parts)
    begun = [(part, first) for part, first in firsts if first is not None]
    held = [first for _, first in begun]
    going = dict(enumerate(part for part, _ in begun))
    while going:
        # at this time and after, more may come
        until = min(int(held[k]["t"][-1]) for k in going)
        cuts = [count_before(events, until) for events in held]
        yield from _by_time([events[:cut] for events, cut in zip(held, cuts, strict=True)])
        held = [events[cut:] for events, cut in zip(held, cuts, strict=True)]
        for k, part in list(going.items()):
            if int(held[k]["t"][-1]) > until:
                continue
            more = next(part, None)
            if more is None:
                del going[k]
            else:
                held[k] = np.concatenate([held[k], more])
    yield from _by_time(held)


def _by_time(pieces: list[Events]) -> Iterator[Events]:
    """Yield sorted pieces as one, if there is any event."""
    if sum(events.size for events in pieces):
        together = np.concatenate(pieces)
        yield together[np.argsort(together["t"], kind="stable")]
