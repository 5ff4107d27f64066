"""Events as text, one a line: the ``events.txt`` of the Event-Camera Dataset (DAVIS240C).

Each line is ``seconds x y polarity``, the seconds with nine decimals, polarity 0 (OFF) or 1 (ON),
ended by a line feed; there is no header.

References
----------
.. [1] E. Mueggler, H. Rebecq, G. Gallego, T. Delbruck, D. Scaramuzza, "The event-camera dataset and
   simulator", IJRR 36(2), 2017, doi:10.1177/0278364917691115.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import ExitStack
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.background import OrderedWork
from adv2e.compiled import kernel
from adv2e.events import EVENT_DTYPE, Events
from adv2e.files.staging import Staging
from adv2e.formats.writing import Request, Writer

_BLOCK = 1 << 14  # events formatted at once
_LONGEST = 48  # bytes of the longest line, and what the kernel may write beyond its end


@kernel
def _fill_prefix(prefix: Any, negative: bool, seconds: int) -> int:
    """Write sign, whole seconds and point to `prefix`; return their length."""
    digits = 1
    limit = 10
    while digits < 18 and seconds >= limit:
        digits += 1
        limit *= 10
    length = digits + 2 if negative else digits + 1
    prefix[0] = 45  # '-', or overwritten
    for k in range(digits):
        prefix[length - 2 - k] = 48 + seconds % 10
        seconds //= 10
    prefix[length - 1] = 46  # '.'
    return length


@kernel
def format_lines(
    t: Any, x: Any, y: Any, p: Any, numbers: Any, lengths: Any, triples: Any, prefix: Any, out: Any
) -> int:
    """Write one line an event to `out`; return the number of bytes.

    Looks digits up in tables; the whole seconds, which rarely change, are kept in `prefix`.
    """
    at = 0
    begin = np.int64(1)  # of the second in `prefix`; none begins here
    length = 0
    for i in range(t.shape[0]):
        time = t[i]
        size = -time if time < 0 else time
        micro = size - begin
        if length == 0 or micro < 0 or micro >= 1_000_000 or (prefix[0] == 45) != (time < 0):
            seconds = size // 1_000_000
            begin = seconds * 1_000_000
            micro = size - begin
            length = _fill_prefix(prefix, time < 0, seconds)
        for k in range(length):
            out[at + k] = prefix[k]
        at += length
        high = micro // 1000
        low = micro - high * 1000
        for k in range(3):
            out[at + k] = triples[high, k]
            out[at + 3 + k] = triples[low, k]
            out[at + 6 + k] = 48
        out[at + 9] = 32
        at += 10
        for k in range(6):
            out[at + k] = numbers[x[i], k]
        at += lengths[x[i]]
        for k in range(6):
            out[at + k] = numbers[y[i], k]
        at += lengths[y[i]]
        out[at] = 48 + p[i]
        out[at + 1] = 10
        at += 2
    return at


@cache
def _tables() -> tuple[NDArray[np.uint8], NDArray[np.int64], NDArray[np.uint8]]:
    """Return all 16-bit numbers, each with a space; the lengths of these; all triples of digits."""
    numbers = b"".join(b"%-6d" % n for n in range(1 << 16))
    lengths = np.searchsorted([10, 100, 1000, 10000], np.arange(1 << 16), side="right") + 2
    triples = b"".join(b"%03d" % n for n in range(1000))
    return (
        np.frombuffer(numbers, np.uint8).reshape(-1, 6).copy(),
        lengths.astype(np.int64),
        np.frombuffer(triples, np.uint8).reshape(-1, 3).copy(),
    )


def formatted(events: Events) -> memoryview:
    """Return the lines of `events`, a block of them, as bytes."""
    events = np.require(events, EVENT_DTYPE, ["C", "W"])  # one type for the compiled code
    numbers, lengths, triples = _tables()
    out = np.empty(events.size * _LONGEST, np.uint8)
    columns = events["t"], events["x"], events["y"], events["p"]
    size = format_lines(*columns, numbers, lengths, triples, np.empty(24, np.uint8), out)
    return out[:size].data


def blocks_of(events: Events) -> Iterator[Events]:
    """Yield the events in blocks that are formatted at once."""
    for begin in range(0, events.size, _BLOCK):
        yield events[begin : begin + _BLOCK]


def text_blocks(events: Events) -> Iterator[memoryview]:
    """Yield the lines of `events` as bytes, block by block."""
    return map(formatted, blocks_of(events))


class TextWriter(Writer):
    """Writes a text file of events, which is formatted in threads."""

    def __init__(self, request: Request, stack: ExitStack, *temporary: Path) -> None:
        (text,) = temporary
        self._file = stack.enter_context(text.open("wb"))
        self._work = OrderedWork(request.threads - 1)
        stack.callback(self._work.abandon)

    def write_events(self, events: Events) -> None:
        """Append events."""
        for block in blocks_of(events):
            self._work.submit(formatted, block, take=self._file.write)

    def finish(self) -> None:
        """Write the remaining lines."""
        self._work.finish()


class StandardOutput(Writer):
    """Writes events as text to standard output, flushed with every write."""

    @staticmethod
    def stage(path: Path, staging: Staging) -> list[Path]:
        """Return no names: there are no files."""
        return []

    def __init__(self, request: Request, stack: ExitStack, *temporary: Path) -> None:
        if sys.stdout is None:  # closed before the program began: nobody reads
            raise BrokenPipeError

    def write_events(self, events: Events) -> None:
        """Write the lines of `events`."""
        for block in text_blocks(events):
            sys.stdout.buffer.write(block)
        sys.stdout.buffer.flush()
