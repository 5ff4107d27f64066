"""TIFFs of several pages, each of them a frame, with times from beside the file."""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from itertools import accumulate
from pathlib import Path

from adv2e.errors import DataError
from adv2e.files.regular import reading
from adv2e.sources.base import GivenTimes, Selection
from adv2e.sources.frame import Frame
from adv2e.sources.images.headers import Directories, Entry
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
_WHOLE = {1: "B", 3: "H", 4: "I", 16: "Q"}
_LONGEST = 1 << 20
"""Bytes of a value that is no place; a table of 65536 colours takes 393,216."""
_IMAGEJ = re.compile(rb"ImageJ=[^\n]*\nimages=([0-9]{1,9})\n")
_CHANNELS = 7  # no more in ImageJ; writers that leave axes out call frames so
_AXES = re.compile(rb"\n(channels|slices|frames)=([0-9]{1,9})(?=\n)")


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
        with self._opened() as tiff:
            self._pages = _walked(tiff)

    def __len__(self) -> int:
        return len(self._pages)

    @contextmanager
    def _opened(self) -> Iterator[Directories]:
        with reading(self._path), self._path.open("rb") as file:
            yield Directories(file, str(self._path))

    def read(self, number: int) -> bytes:
        """Return a page as a TIFF of its own; DataError if it is not all there."""
        page = self._pages[number]
        with self._opened() as tiff:
            tags, _ = tiff.entries(page.directory)
            packed = [
                tiff.bytes_at(start + page.shift, size) for start, size in _places(tiff, tags)
            ]
            values = {
                tag: (tags[tag].kind, tags[tag].length, tiff.value(tags[tag], _LONGEST))
                for tag in _COPIED
                if tag in tags
            }
        first, kind = (16, 16) if tiff.is_big else (8, 4)
        *starts, end = accumulate(map(len, packed), initial=first)
        if not tiff.is_big and end > (1 << 32) - 2 * _LONGEST:
            raise tiff.error(f"page {number} takes {end:,} bytes, over 4 GB")
        for tag, numbers in zip(_names(tags), (starts, map(len, packed)), strict=True):
            form = f"{tiff.order}{len(packed)}{tiff.pointer}"
            values[tag] = kind, len(packed), struct.pack(form, *numbers)
        head = tiff.head[: first - struct.calcsize("=" + tiff.pointer)]
        begin = end + end % 2
        pointer = struct.pack(tiff.order + tiff.pointer, begin)
        return b"".join([head, pointer, *packed, bytes(end % 2), *_directory(tiff, begin, values)])


def _directory(
    tiff: Directories, at: int, values: dict[int, tuple[int, int, bytes]]
) -> Iterator[bytes]:
    """Yield a directory of these values, and then those that do not fit into it."""
    width = struct.calcsize("=" + tiff.pointer)
    behind = at + struct.calcsize("=" + tiff.counter) + width
    behind += len(values) * struct.calcsize("=" + tiff.entry)
    yield struct.pack(tiff.order + tiff.counter, len(values))
    outside = []
    for tag, (kind, count, value) in sorted(values.items()):
        field = value
        if len(value) > width:
            field = struct.pack(tiff.order + tiff.pointer, behind)
            outside.append(value + bytes(len(value) % 2))
            behind += len(outside[-1])
        yield struct.pack(tiff.order + tiff.entry, tag, kind, count, field)
    yield bytes(width)
    yield from outside


def _walked(tiff: Directories) -> list[_Page]:
    pages: list[_Page] = []
    seen: set[int] = set()
    left, description, at = tiff.size, b"", tiff.first
    while at:
        tags, end = tiff.entries(at)
        left -= end - at
        if at in seen or left < 0:  # or one lies within another
            raise tiff.error("its directories lead in a circle: damaged")
        seen.add(at)
        if not _number(tiff, tags, _KIND, 0) & _REDUCED_OR_MASK:
            pages.append(_Page(at))
            if len(pages) == 1 and _DESCRIPTION in tags:
                description = tiff.value(tags[_DESCRIPTION], _LONGEST)
        (at,) = tiff.unpacked(end, tiff.pointer)
    if not pages:
        raise tiff.error("a TIFF without pictures, or damaged")
    if stated := _IMAGEJ.match(description):
        axes = {name.decode(): int(count) for name, count in _AXES.findall(description)}
        several = [count for count in axes.values() if count > 1]
        if len(several) > 1 or 1 < axes.get("channels", 1) <= _CHANNELS:
            told = ", ".join(f"{count} {name}" for name, count in axes.items())
            raise tiff.error(f"its pages are {told}; must be frames alone, in order of time")
        if int(stated[1]) > len(pages):
            return _without_directories(tiff, pages, int(stated[1]))
    return pages


def _without_directories(tiff: Directories, pages: list[_Page], count: int) -> list[_Page]:
    """Return the pages of a file that has them behind the first, one after the other."""
    tags, _ = tiff.entries(pages[0].directory)
    starts, sizes = zip(*_places(tiff, tags), strict=True)
    begin, size = starts[0], sum(sizes)
    gapless = list(starts) == [*accumulate(sizes[:-1], initial=begin)]
    if len(pages) > 1 or _number(tiff, tags, _COMPRESSION, 1) != 1 or not gapless or not size:
        raise tiff.error(f"{len(pages)} pages in it, where its description has {count}")
    if begin + count * size > tiff.size:
        raise tiff.error(f"cut short: not all of its {count} pages are there")
    return [_Page(pages[0].directory, number * size) for number in range(count)]


def _places(tiff: Directories, tags: dict[int, Entry]) -> list[tuple[int, int]]:
    """Return beginning and length of each strip or tile."""
    found = []
    for name in _names(tags):
        if name not in tags or tags[name].kind not in _WHOLE:
            raise tiff.error(f"a page without tag {name}: damaged")
        form = f"{tiff.order}{tags[name].length}{_WHOLE[tags[name].kind]}"
        found.append(struct.unpack(form, tiff.value(tags[name], tiff.size)))
    starts, sizes = found
    if len(starts) != len(sizes) or sum(sizes) > tiff.size:
        raise tiff.error("a page that is larger than the file: damaged")
    return [*zip(starts, sizes, strict=True)]


def _number(tiff: Directories, tags: dict[int, Entry], name: int, default: int) -> int:
    tag = tags.get(name)
    if tag is None or tag.length != 1 or tag.kind not in _WHOLE:
        return default
    number: int = struct.unpack_from(tiff.order + _WHOLE[tag.kind], tag.field)[0]
    return number


def _names(tags: dict[int, Entry]) -> tuple[int, int]:
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
