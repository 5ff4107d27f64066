"""TIFFs of several pages, each of them a frame, with times from beside the file."""

from __future__ import annotations

import os
import re
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from itertools import accumulate
from pathlib import Path
from typing import IO

from adv2e.errors import DataError
from adv2e.files.regular import reading
from adv2e.sources.base import GivenTimes, Selection
from adv2e.sources.frame import Frame
from adv2e.sources.images.headers import is_tiff
from adv2e.sources.images.opencv import decode_image
from adv2e.sources.listed import ListedSource, Picture
from adv2e.sources.npy import timed_beside

# ---- Pages of a TIFF, each as a file of its own: no more than one is in memory.
#
# The directories are walked once. A page is made of its directory and its strips or tiles, packed
# as they are, so that whatever reads a TIFF of one page reads it.
#
# References
# ----------
# .. [1] TIFF Revision 6.0, Adobe, 1992.
# .. [2] libtiff, "The BigTIFF file format".
# .. [3] ImageJ, TiffEncoder: ``images=N`` in the description, and pictures without directories
#    behind the first.


_KIND, _COMPRESSION, _DESCRIPTION = 254, 259, 270
_STRIPS, _TILES = (273, 279), (324, 325)
_COPIED = (
    *(_KIND, 256, 257, 258, _COMPRESSION, 262, 266, 274, 277, 278, 284, 292, 293, 317, 320, 322),
    *(323, 338, 339, 347, 529, 530, 531, 532),
)
"""Tags that say how pixels are stored, but for their places."""
_REDUCED_OR_MASK = 1 | 4
_SIZES = {1: 1, 2: 1, 3: 2, 4: 4, 5: 8, 6: 1, 7: 1, 8: 2, 9: 4, 10: 8, 11: 4, 12: 8, 16: 8}
_WHOLE = {1: "B", 3: "H", 4: "I", 16: "Q"}
_LONGEST = 1 << 20
"""Bytes of a value that is no place; a table of 65536 colours takes 393,216."""
_IMAGEJ = re.compile(rb"ImageJ=[^\n]*\nimages=([0-9]{1,9})\n")
_CHANNELS = 7  # no more in ImageJ; writers that leave axes out call frames so
_AXES = re.compile(rb"\n(channels|slices|frames)=([0-9]{1,9})(?=\n)")


@dataclass(frozen=True)
class _Tag:
    """Type, count, and the field that holds a value or where it is."""

    kind: int
    count: int
    field: bytes


@dataclass(frozen=True)
class _Page:
    """Page: offset of its directory, and of its pixels from those in the directory [bytes]."""

    directory: int
    shift: int = 0


class Pages:
    """The pages of a file, in order, without thumbnails and masks.

    Raises
    ------
    DataError
        No TIFF, or a damaged one; pages of several channels or slices.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        with self._opened() as file:
            self._size = os.fstat(file.fileno()).st_size
            self._head = file.read(8)
            if not is_tiff(self._head):
                raise self._error("not a TIFF, or damaged")
            self._order = "<" if self._head[:2] == b"II" else ">"
            # forms of a pointer, of a number of entries, and of an entry
            self._pointer, self._counter, self._entry = "I", "H", "HHI4s"
            if 43 in self._head[2:4]:
                self._pointer, self._counter, self._entry = "Q", "Q", "HHQ8s"
            self._pages = self._walked(file)

    def __len__(self) -> int:
        return len(self._pages)

    def read(self, number: int) -> bytes:
        """Return a page as a TIFF of its own; DataError if it is not all there."""
        page = self._pages[number]
        with self._opened() as file:
            tags = self._tags(file, page.directory)
            packed = [
                self._bytes(file, start + page.shift, size)
                for start, size in self._places(file, tags)
            ]
            values = {
                tag: (tags[tag].kind, tags[tag].count, self._value(file, tags[tag]))
                for tag in _COPIED
                if tag in tags
            }
        first = 8 if self._pointer == "I" else 16
        *starts, end = accumulate(map(len, packed), initial=first)
        if self._pointer == "I" and end > (1 << 32) - 2 * _LONGEST:
            raise self._error(f"page {number} takes {end:,} bytes, over 4 GB")
        kind = 4 if self._pointer == "I" else 16
        for tag, numbers in zip(_names(tags), (starts, map(len, packed)), strict=True):
            values[tag] = kind, len(packed), self._packed(f"{len(packed)}{self._pointer}", *numbers)
        head = self._head[: first - struct.calcsize("=" + self._pointer)]
        begin = end + end % 2
        whole = [head, self._packed(self._pointer, begin), *packed, bytes(end % 2)]
        return b"".join([*whole, *self._directory(begin, values)])

    def _directory(self, at: int, values: dict[int, tuple[int, int, bytes]]) -> Iterator[bytes]:
        """Yield a directory of these values, and then those that do not fit into it."""
        width = struct.calcsize("=" + self._pointer)
        behind = at + struct.calcsize("=" + self._counter) + width
        behind += len(values) * struct.calcsize("=" + self._entry)
        yield self._packed(self._counter, len(values))
        outside = []
        for tag, (kind, count, value) in sorted(values.items()):
            field = value
            if len(value) > width:
                field = self._packed(self._pointer, behind)
                outside.append(value + bytes(len(value) % 2))
                behind += len(outside[-1])
            yield self._packed(self._entry, tag, kind, count, field)
        yield bytes(width)
        yield from outside

    def _walked(self, file: IO[bytes]) -> list[_Page]:
        pages: list[_Page] = []
        seen: set[int] = set()
        left, description = self._size, b""
        (at,) = self._numbers(file, 4 if self._pointer == "I" else 8, self._pointer)
        while at:
            tags = self._tags(file, at)
            end = at + struct.calcsize("=" + self._counter)
            end += self._count(file, at) * struct.calcsize("=" + self._entry)
            left -= end - at
            if at in seen or left < 0:  # or one lies within another
                raise self._error("its directories lead in a circle: damaged")
            seen.add(at)
            if not self._number(tags, _KIND, 0) & _REDUCED_OR_MASK:
                pages.append(_Page(at))
                if len(pages) == 1 and _DESCRIPTION in tags:
                    description = self._value(file, tags[_DESCRIPTION])
            (at,) = self._numbers(file, end, self._pointer)
        if not pages:
            raise self._error("a TIFF without pictures, or damaged")
        if stated := _IMAGEJ.match(description):
            axes = {name.decode(): int(count) for name, count in _AXES.findall(description)}
            several = [count for count in axes.values() if count > 1]
            if len(several) > 1 or 1 < axes.get("channels", 1) <= _CHANNELS:
                told = ", ".join(f"{count} {name}" for name, count in axes.items())
                raise self._error(f"its pages are {told}; must be frames alone, in order of time")
            if int(stated[1]) > len(pages):
                return self._without_directories(file, pages, int(stated[1]))
        return pages

    def _without_directories(self, file: IO[bytes], pages: list[_Page], count: int) -> list[_Page]:
        """Return the pages of a file that has them behind the first, one after the other."""
        tags = self._tags(file, pages[0].directory)
        places = self._places(file, tags)
        begin, size = places[0][0], sum(length for _, length in places)
        gapless = all(
            place == start
            for (place, _), start in zip(
                places, accumulate((length for _, length in places), initial=begin), strict=False
            )
        )
        if len(pages) > 1 or self._number(tags, _COMPRESSION, 1) != 1 or not gapless or not size:
            raise self._error(f"{len(pages)} pages in it, where its description has {count}")
        if begin + count * size > self._size:
            raise self._error(f"cut short: not all of its {count} pages are there")
        return [_Page(pages[0].directory, number * size) for number in range(count)]

    def _count(self, file: IO[bytes], at: int) -> int:
        (count,) = self._numbers(file, at, self._counter)
        return count

    def _tags(self, file: IO[bytes], at: int) -> dict[int, _Tag]:
        size = self._count(file, at) * struct.calcsize("=" + self._entry)
        data = self._bytes(file, at + struct.calcsize("=" + self._counter), size)
        entries = struct.iter_unpack(self._order + self._entry, data)
        return {tag: _Tag(kind, count, field) for tag, kind, count, field in entries}

    def _places(self, file: IO[bytes], tags: dict[int, _Tag]) -> list[tuple[int, int]]:
        """Return beginning and length of each strip or tile."""
        found = []
        for name in _names(tags):
            if name not in tags or tags[name].kind not in _WHOLE:
                raise self._error(f"a page without tag {name}: damaged")
            form = f"{self._order}{tags[name].count}{_WHOLE[tags[name].kind]}"
            found.append(struct.unpack(form, self._value(file, tags[name], longest=self._size)))
        starts, sizes = found
        if len(starts) != len(sizes) or sum(sizes) > self._size:
            raise self._error("a page that is larger than the file: damaged")
        return [*zip(starts, sizes, strict=True)]

    def _value(self, file: IO[bytes], tag: _Tag, longest: int = _LONGEST) -> bytes:
        size = _SIZES.get(tag.kind, 0) * tag.count
        if not 0 < size <= longest:
            raise self._error(f"a tag of {size:,} bytes: damaged")
        if size <= len(tag.field):
            return tag.field[:size]
        (at,) = struct.unpack(self._order + self._pointer, tag.field)
        return self._bytes(file, at, size)

    def _number(self, tags: dict[int, _Tag], name: int, default: int) -> int:
        tag = tags.get(name)
        if tag is None or tag.count != 1 or tag.kind not in _WHOLE:
            return default
        number: int = struct.unpack_from(self._order + _WHOLE[tag.kind], tag.field)[0]
        return number

    def _numbers(self, file: IO[bytes], at: int, form: str) -> tuple[int, ...]:
        size = struct.calcsize("=" + form)
        return struct.unpack(self._order + form, self._bytes(file, at, size))

    def _packed(self, form: str, *values: int | bytes) -> bytes:
        return struct.pack(self._order + form, *values)

    def _bytes(self, file: IO[bytes], at: int, size: int) -> bytes:
        if at + size > self._size:
            raise self._error(f"cut short, or damaged: {size:,} bytes are expected at byte {at:,}")
        file.seek(at)
        data = file.read(size)
        if len(data) < size:
            raise self._error("cut short while it was read")
        return data

    def _opened(self) -> IO[bytes]:
        with reading(self._path):
            return self._path.open("rb")

    def _error(self, what: str) -> DataError:
        return DataError(f"{self._path}: {what}")


def _names(tags: dict[int, _Tag]) -> tuple[int, int]:
    return _TILES if _TILES[0] in tags else _STRIPS


def open_source(path: Path, given: GivenTimes, selection: Selection) -> ListedSource:
    """Return the pages of a TIFF.

    Raises
    ------
    DataError
        A single page; no times, or another number of times than of pages; a damaged file.
    """
    pages = Pages(path)
    if len(pages) == 1:
        raise DataError(f"{path}: a single picture; give a folder of them, or a TIFF of many pages")
    labels = [f"{path}: page {number}" for number in range(len(pages))]
    pictures = [
        Picture(label, None, partial(_load, pages, number, label))
        for number, label in enumerate(labels)
    ]
    times = timed_beside(path, given, pictures)
    return ListedSource(path, "tiff", times, selection, has_clock=given.fps is None)


def _load(pages: Pages, number: int, label: str) -> Frame:
    return decode_image(pages.read(number), label)
