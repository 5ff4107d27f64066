"""Bytes that come through standard input, of which no more is believed than comes."""

from __future__ import annotations

import sys
from typing import BinaryIO

from adv2e.errors import DataError

NAME = "standard input"

_PIECE = 1 << 20


def standard_input() -> BinaryIO:
    """Return the stream; DataError if nothing can come through it."""
    if sys.stdin is None or sys.stdin.closed:
        raise DataError(f"{NAME}: is closed; frames must come through it")
    if sys.stdin.isatty():
        raise DataError(f"{NAME}: is a terminal; frames must come through it, as from ffmpeg")
    return sys.stdin.buffer


class Stream:
    """A stream whose beginning can be looked at before it is read."""

    def __init__(self, file: BinaryIO) -> None:
        self._file, self._seen = file, b""

    def peek(self, size: int) -> bytes:
        """Return the next bytes, fewer only where it ends; they are still to be read."""
        self._seen = self.read(size)
        return self._seen

    def read(self, size: int) -> bytes:
        """Return so many bytes, fewer only where it ends; those that never come take no memory."""
        pieces, self._seen = [self._seen[:size]], self._seen[size:]
        left = size - len(pieces[0])
        while left and (piece := self._file.read(min(left, _PIECE))):
            pieces.append(piece)
            left -= len(piece)
        return b"".join(pieces)

    def line(self, longest: int) -> bytes:
        """Return the bytes up to the end of a line, that included; no more than `longest`."""
        found = bytearray()
        while len(found) < longest and (byte := self.read(1)):
            found += byte
            if byte == b"\n":
                break
        return bytes(found)
