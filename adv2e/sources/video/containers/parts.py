"""Files that are one part after another, without an index: FLV, GIF, MPEG-PS, Ogg and ASF.

References
----------
.. [1] Adobe, "Flash Video File Format Specification", version 10.1, annex E.
.. [2] CompuServe, "Graphics Interchange Format, Version 89a": 20 (image), 23 (graphic control).
.. [3] ISO/IEC 13818-1, 2.5.3 (program stream) and 2.4.3.6 (PES packet); ISO/IEC 11172-1.
.. [4] RFC 3533, "The Ogg Encapsulation Format Version 0", section 6.
.. [5] Microsoft, "Advanced Systems Format (ASF) Specification", 01.20.06: 3.2, 5.1, 5.2.
"""

from __future__ import annotations

import mmap
import struct
from collections.abc import Callable, Iterator

from adv2e.sources.video.containers.base import Container, DamagedError, cut_short

FLV, GIF, OGG, MPEG_PS = b"FLV", b"GIF8", b"OggS", b"\x00\x00\x01\xba"
ASF = bytes.fromhex("3026b2758e66cf11a6d900aa0062ce6c")
"""How such files begin."""


def _parts(
    data: mmap.mmap, place: int, measure: Callable[[mmap.mmap, int], int], padding: int = 0
) -> Iterator[tuple[int, int]]:
    """Yield where each part begins and ends; zeros, up to `padding` of them, may be at the end.

    `measure` returns the bytes of the part at a place, 0 if none begins there.  Raises DamagedError
    where something else stands between two parts, or the last one is cut.
    """
    while place < len(data):
        try:
            size = measure(data, place)
        except (IndexError, struct.error):
            raise cut_short(len(data) + 1, len(data)) from None
        if size == 0:
            if len(data) - place <= padding and not data[place:].strip(b"\0"):
                return
            raise DamagedError(f"damaged at byte {place}")
        if place + size > len(data):
            raise cut_short(place + size, len(data))
        yield place, place + size
        place += size


def flv(data: mmap.mmap, found: Container) -> None:
    """Note nothing; DamagedError if the tags do not follow one another."""
    (start,) = struct.unpack_from(">I", data, 5)
    for _ in _parts(data, start + 4, _tag):
        pass


def _tag(data: mmap.mmap, place: int) -> int:
    length = int.from_bytes(data[place + 1 : place + 4], "big")
    sound_picture_script = 8, 9, 18
    other = data[place] & 0xDF not in sound_picture_script
    return 0 if other or data[place + 10] + data[place + 9] else 11 + length + 4


_EXTENSION, _IMAGE, _TRAILER, _CONTROL, _TO_BACKGROUND = 0x21, 0x2C, 0x3B, 0xF9, 2


def gif(data: mmap.mmap, found: Container) -> None:
    """Note how many images there are, and whether their pixels are all opaque.

    A transparent pixel of a later image shows the one before, which is opaque if the first image
    covers all with none, and none is taken back to the background.
    """
    images, opaque, holes, more = 0, True, False, ["it has no end mark: it may be cut short"]
    for place, end in _parts(data, 13 + _colour_table(data[10]), _block):
        kind = data[place]
        if kind == _TRAILER:
            follow = "bytes follow its end mark: it may be damaged there"
            more = [follow] if end < len(data) else []
            break
        if kind == _EXTENSION and data[place + 1] == _CONTROL:
            holes = bool(data[place + 3] & 1)
            opaque &= data[place + 3] >> 2 & 7 != _TO_BACKGROUND
        elif kind == _IMAGE:
            box = struct.unpack_from("<HHHH", data, place + 1)
            covers = box == (0, 0, *struct.unpack_from("<HH", data, 6))
            opaque &= images > 0 or (covers and not holes)
            images += 1
    found.pictures, found.opaque = images, opaque
    found.doubts += more


def _colour_table(flags: int) -> int:
    return 3 << ((flags & 7) + 1) if flags & 0x80 else 0


def _block(data: mmap.mmap, place: int) -> int:
    kind = data[place]
    if kind == _TRAILER:
        return 1
    if kind == _EXTENSION:
        end = place + 2
    elif kind == _IMAGE:
        end = place + 11 + _colour_table(data[place + 9])
    else:
        return 0
    while data[end]:
        end += 1 + data[end]
    return end + 1 - place


_SECTOR = 2048


def mpeg_ps(data: mmap.mmap, found: Container) -> None:
    """Note that not all times are stated; DamagedError if packets do not follow one another."""
    found.decoding_times, found.tick_ns = True, 11_112  # of 90 kHz
    for _ in _parts(data, 0, _packet, padding=_SECTOR):
        pass


def _packet(data: mmap.mmap, place: int) -> int:
    start = place
    while data[place : place + 3] == b"\0\0\0" and place - start < _SECTOR:
        place += 1  # stuffing
    if data[place : place + 3] != b"\0\0\1":
        return 0
    code, stuffed = data[place + 3], place - start
    pack, end, least = 0xBA, 0xB9, 0xBB
    if code == end:
        return stuffed + 4
    if code == pack:
        newer = data[place + 4] >> 6 == 1
        return stuffed + (14 + (data[place + 13] & 7) if newer else 12)
    if code < least:
        return 0
    return stuffed + 6 + int.from_bytes(data[place + 4 : place + 6], "big")


def ogg(data: mmap.mmap, found: Container) -> None:
    """Doubt what has no end; DamagedError if pages are missing."""
    numbers: dict[int, int] = {}
    last_page = flags = 4
    for place, _ in _parts(data, 0, _page):
        flags, serial, number = struct.unpack_from("<5xB8xII", data, place)
        if number != numbers.get(serial, number - 1) + 1:
            raise DamagedError(f"damaged before byte {place}: pages are missing")
        numbers[serial] = number
    if not flags & last_page:
        found.doubts.append("its last page has no end mark: it may be cut short")


def _page(data: mmap.mmap, place: int) -> int:
    if data[place : place + 4] != OGG:
        return 0
    segments = data[place + 26]
    return 27 + segments + sum(data[place + 27 : place + 27 + segments])


_FILE_PROPERTIES = bytes.fromhex("a1dcab8c47a9cf118ee400c00c205365")
_STREAM_PROPERTIES = bytes.fromhex("9107dcb7b7a9cf118ee600c00c205365")
_BROADCAST = 1


def asf(data: mmap.mmap, found: Container) -> None:
    """Note that times are those of decoding; DamagedError if packets are missing or damaged."""
    found.decoding_times, found.tick_ns = True, 1_000_000
    (head,) = struct.unpack_from("<Q", data, 16)
    place = data.find(_FILE_PROPERTIES, 30, min(head, len(data)))
    if place < 0:
        return
    layout = "<40xQ8xQQ8xQI4xI"
    size, count, duration, early_ms, flags, each = struct.unpack_from(layout, data, place)
    if flags & _BROADCAST:  # nothing is stated
        return
    if size > len(data):
        raise cut_short(size, len(data))
    first = head + 50
    if not each or first + count * each > len(data):
        raise DamagedError("its headers are damaged")
    for packet in range(first, first + count * each, each):
        if data[packet] != data[first]:  # all begin with the same flags
            raise DamagedError(f"damaged at byte {packet}")
    if data[:head].count(_STREAM_PROPERTIES) == 1:  # else the sound may be longer
        found.end_ns = max(duration * 100 - early_ms * 1_000_000, 0)
