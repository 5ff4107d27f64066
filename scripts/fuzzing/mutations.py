"""Changes to files that a fault of a disk, a careless writer or an enemy makes."""

from __future__ import annotations

import random
import re
import struct
import zlib

ODD_NUMBERS = (
    *("0", "-1", "1", "255", "256", "65535", "65536", "2147483647", "4294967295", "4294967296"),
    *("9223372036854775807", "9223372036854775808", "18446744073709551615", "-9223372036854775808"),
    *("1e9", "1e13", "1e300", "1e999", "-1e13", "nan", "inf", "-inf", "1e-320", "0.0000000001"),
    *("9" * 40, "9" * 5000, "0x10", "1_000", "٣", "", " ", "true", "null"),
)
"""Numbers, and what stands where one should, for files of text."""

ODD_INTEGERS = (0, 1, 0x7F, 0x80, 0xFF, 0x7FFF, 0x8000, 0xFFFF, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF,
                1 << 40, (1 << 63) - 1, 1 << 63, (1 << 64) - 1)  # fmt: skip

ODD_TEXT = (
    *(b"\0", b"\xff\xfe", b"\xef\xbb\xbf", b"\r", b"\n\n", b"#", b"[" * 3000, b"{" * 3000, b"&a"),
    *(
        b"*a",
        b"../" * 5,
        b"/dev/zero",
        b"\\",
        b"%d",
        b"\xf0\x9f\x98\x80",
        b"- " * 2000,
        b"!!python/x",
    ),
)

_NUMBER = re.compile(rb"-?[0-9]+(\.[0-9]+)?([eE][+-]?[0-9]+)?")


def mutated(data: bytes, draw: random.Random, *, text: bool) -> bytes:
    """Return `data` changed in one to four ways.

    Parameters
    ----------
    data : bytes
    draw : random.Random
    text : bool
        Numbers in it are written in digits.
    """
    ways = [*_OF_TEXT, *_OF_ALL] if text else _OF_ALL
    for _ in range(draw.choice((1, 1, 2, 4))):
        data = draw.choice(ways)(bytearray(data), draw)
    if data.startswith(b"\x89PNG") and draw.random() < 0.8:
        data = _with_checksums(data)
    return bytes(data)


def _flip_bits(data: bytearray, draw: random.Random) -> bytearray:
    for _ in range(draw.choice((1, 1, 3, 16)) if data else 0):
        data[_place(data, draw)] ^= 1 << draw.randrange(8)
    return data


def _set_bytes(data: bytearray, draw: random.Random) -> bytearray:
    for _ in range(draw.choice((1, 2, 8)) if data else 0):
        data[_place(data, draw)] = draw.choice((0, 0xFF, 0x7F, 0x80, draw.randrange(256)))
    return data


def _set_integer(data: bytearray, draw: random.Random) -> bytearray:
    size = draw.choice((2, 4, 8))
    if len(data) >= size:
        place = min(_place(data, draw), len(data) - size)
        value = draw.choice(ODD_INTEGERS) & ((1 << 8 * size) - 1)
        data[place : place + size] = value.to_bytes(size, draw.choice(("little", "big")))
    return data


def _truncate(data: bytearray, draw: random.Random) -> bytearray:
    return data[: draw.randrange(len(data) + 1)]


def _remove(data: bytearray, draw: random.Random) -> bytearray:
    first, last = _stretch(data, draw)
    del data[first:last]
    return data


def _repeat(data: bytearray, draw: random.Random) -> bytearray:
    first, last = _stretch(data, draw)
    data[first:first] = data[first:last] * draw.choice((1, 1, 50))
    return data


def _clear(data: bytearray, draw: random.Random) -> bytearray:
    first, last = _stretch(data, draw)
    data[first:last] = bytes([draw.choice((0, 0xFF))]) * (last - first)
    return data


def _insert(data: bytearray, draw: random.Random) -> bytearray:
    place = _place(data, draw) if data else 0
    data[place:place] = draw.randbytes(draw.choice((1, 4, 100)))
    return data


def _append(data: bytearray, draw: random.Random) -> bytearray:
    return data + draw.randbytes(draw.choice((1, 1000)))


def _change_number(data: bytearray, draw: random.Random) -> bytearray:
    numbers = list(_NUMBER.finditer(bytes(data)))
    if numbers:
        first, last = draw.choice(numbers).span()
        data[first:last] = draw.choice(ODD_NUMBERS).encode()
    return data


def _insert_text(data: bytearray, draw: random.Random) -> bytearray:
    place = _place(data, draw) if data else 0
    data[place:place] = draw.choice(ODD_TEXT)
    return data


def _swap_lines(data: bytearray, draw: random.Random) -> bytearray:
    lines = bytes(data).split(b"\n")
    draw.shuffle(lines)
    return bytearray(b"\n".join(lines))


_OF_ALL = (_flip_bits, _set_bytes, _set_integer, _set_integer, _truncate, _remove, _repeat, _clear,
           _insert, _append)  # fmt: skip
_OF_TEXT = (_change_number,) * 5 + (_insert_text,) * 2 + (_swap_lines,)


def _place(data: bytearray, draw: random.Random) -> int:
    """Return a place in `data`; headers are at the beginning, and indices at the end."""
    size = len(data)
    near = draw.randrange(min(size, 200))
    return draw.choice((near, near, size - 1 - near, draw.randrange(size)))


def _stretch(data: bytearray, draw: random.Random) -> tuple[int, int]:
    first = draw.randrange(len(data) + 1)
    return first, min(len(data), first + draw.choice((1, 4, 64, 1024)))


def _with_checksums(data: bytes) -> bytes:
    """Return a PNG whose chunks have the sums that belong to them, so that it is read further."""
    out, place = bytearray(data[:8]), 8
    while place + 12 <= len(data):
        (size,) = struct.unpack_from(">I", data, place)
        size = min(size, len(data) - place - 12)
        kind_and_data = data[place + 4 : place + 8 + size]
        out += struct.pack(">I", size) + kind_and_data
        out += struct.pack(">I", zlib.crc32(kind_and_data))
        place += 12 + size
    return bytes(out)
