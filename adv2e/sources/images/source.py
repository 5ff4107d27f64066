"""Folders of still images: their order by name, and times from beside them."""

from __future__ import annotations

import re
import unicodedata
from collections import defaultdict
from collections.abc import Callable, Sequence
from decimal import Decimal
from functools import cache, partial
from itertools import groupby, pairwise
from os.path import commonprefix
from pathlib import Path, PurePosixPath
from statistics import mean, median
from typing import Any

from adv2e.errors import DataError
from adv2e.files.regular import reading
from adv2e.label import guessed, left_out, told_of
from adv2e.sources.base import GivenTimes, Selection
from adv2e.sources.images.opencv import IMAGE_SUFFIXES, read_image
from adv2e.sources.listed import ListedSource, Picture, timed
from adv2e.sources.stored import DESCRIPTION, LIST, light_beside
from adv2e.sources.times.lists import FrameList, read_list

# ---- Order of pictures by their names: that in which they were most likely taken.
#
# Numbers count as numbers, and a name comes before those that continue it: ``IMG.jpg`` before
# ``IMG (1).jpg``.  Upper and lower case are the same, and so are composed and decomposed letters.
# All names together tell what can be read in two ways, and the way that is taken is told:
#
# - ``3081.8`` is a decimal number, or 3081 and a whole number of smaller units without the zeros in
#   front.  Where the order depends on it, that way is taken in which steps are more even.
# - ``-3`` is negative where other names have a number without the minus; else it has a dash.
# - ``0a`` is hexadecimal where all names are, and are evenly spaced so.


_WHOLE = re.compile(r"(\d+)")
_DECIMAL = re.compile(r"((?<![\d.,])\d+[.,]\d+(?:e[+-]\d{1,2})?(?![.,]?\d)|\d+(?:e[+-]\d{1,2})?)")
_HEXADECIMAL = re.compile(r"(?:0x)?[0-9a-f]{1,16}")
_HASH = re.compile(r"(?=.*[a-f])(?=.*\d)[0-9a-f-]{16,}")
_SIGN = re.compile(r"[-+−]$")
_EVEN = 0.1
"""Steps that differ by less than this share from the usual one, on average, are even."""

Key = Callable[[str], Any]


def natural_key(name: str) -> Any:
    """Return a key that sorts names with their numbers as numbers, each by itself."""
    return _key(name), name


def in_order(names: Sequence[str]) -> tuple[list[str], list[str]]:
    """Return the names of files of one folder in order, and what is to be told of it, in lines."""
    stems = {name: _stem(name) for name in names}
    signs = _signs(stems.values())
    whole: Key = cache(partial(_key, signs=signs))
    decimal: Key = cache(partial(_key, signs=signs, form=_DECIMAL))
    key, told = _settled(sorted(stems.values()), whole, decimal, signed=bool(signs))
    ordered = sorted(names, key=lambda name: (key(stems[name]), stems[name], name))
    if any(text.endswith(("-", "−")) for _, text in signs):
        told.append(f"numbers with a minus are negative, and come first: {_last(ordered[0])}")
    elif names and all(stem[:1] in ("-", "−") and stem[1:2].isdecimal() for stem in stems.values()):
        told.append(f"the - before the numbers is taken as a dash: {_last(ordered[0])} comes first")
    for before, after in pairwise(ordered):
        if key(stems[before]) == key(stems[after]):
            both = f"{_last(before)} and {_last(after)}"
            told.append(f"{both} are of one name or number, and are two frames")
            break
    kinds = [list(kind) for _, kind in groupby(ordered, lambda name: whole(stems[name])[0])]
    if len(kinds) > 1 and all(len(kind) > 1 for kind in kinds):
        both = " and ".join(_last(kind[0]) for kind in kinds[:2])
        told.append(f"names of {len(kinds)} kinds, such as {both}, are taken one after the other")
    if len(names) > 1 and all(map(_HASH.fullmatch, _rests(list(stems.values())))):
        told.append(f"names such as {_last(ordered[0])} hardly tell an order: give a list of times")
    how = "give --timestamps FILE that names them in order"
    return ordered, [guessed(line, "order of frames", "by name", how) for line in told]


def _last(name: str) -> str:
    return PurePosixPath(name).name


def _stem(name: str) -> str:
    return unicodedata.normalize("NFC", PurePosixPath(name).stem).casefold()


def _key(stem: str, signs: Sequence[Any] = (), form: re.Pattern[str] = _WHOLE) -> list[Any]:
    """Return texts and numbers in turn; `signs` are places and texts that end in a sign."""
    parts: list[Any] = form.split(stem)
    for at in range(1, len(parts), 2):
        number, before = Decimal(parts[at].replace(",", ".")), parts[at - 1]
        parts[at] = number
        if (at, before) in signs:
            parts[at - 1 : at + 1] = before[:-1], number if before.endswith("+") else -number
    return parts


def _signs(stems: Any) -> list[tuple[int, str]]:
    """Return the places and texts of which the last letter is a sign: others differ in it alone."""
    found = defaultdict(set)
    for stem in stems:
        parts = _WHOLE.split(stem)
        for at in range(1, len(parts), 2):
            found[at, _SIGN.sub("", parts[at - 1])].add(parts[at - 1])
    return [
        (at, text)
        for (at, bare), texts in found.items()
        if len(texts) > 1 and any(one.endswith(("-", "−")) for one in texts)
        for text in texts - {bare}
    ]


def _settled(stems: list[str], whole: Key, decimal: Key, *, signed: bool) -> tuple[Key, list[str]]:
    """Return the key that sorts stems, and what is to be told where another would sort otherwise.

    `whole` takes the numbers in them for whole numbers, `decimal` for such; `signed` are those of
    which some are negative.
    """
    rests = dict(zip(stems, _rests(stems), strict=True))
    if all(map(_HEXADECIMAL.fullmatch, rests.values())):
        numbers = {stem: int(rest, 16) for stem, rest in rests.items()}
        pair = _other_way(stems, numbers.__getitem__, whole)
        if pair and _unevenness([list(numbers.values())]) < _EVEN:
            told = "names are taken for hexadecimal numbers, which are evenly spaced"
            return numbers.__getitem__, [f"{told}: {pair[0]} before {pair[1]}"]
    pair = _other_way(stems, decimal, whole)
    if pair is None:
        return whole, []
    told = "digits after the point in the names are taken as"
    if signed or _steps_are_decimal(stems, decimal, whole):
        return decimal, [f"{told} decimals, not as whole numbers: {pair[0]} before {pair[1]}"]
    told += " whole numbers, not as decimals"
    return whole, [f"{told}: {pair[1]} before {pair[0]}"]


def _rests(stems: Sequence[str]) -> list[str]:
    """Return the rest of each stem after the words with which all begin."""
    same = commonprefix(list(stems))  # noqa: RUF071 - of letters is meant
    begin = len(re.sub(r"[^\W_]*$", "", same))
    return [stem[begin:] for stem in stems]


def _other_way(stems: Sequence[str], key: Key, other: Key) -> tuple[str, str] | None:
    """Return two neighbours of an order that another order has the other way round, if any."""
    pairs = pairwise(sorted(stems, key=key))
    return next((pair for pair in pairs if other(pair[0]) > other(pair[1])), None)


def _steps_are_decimal(stems: Sequence[str], decimal: Key, whole: Key) -> bool:
    """Tell whether numbers with points are more even as decimals, none of them being twice there.

    As whole numbers, the digits after the point are of a unit that the longest of them fits.
    """
    if len({*map(tuple, map(decimal, stems))}) < len({*map(tuple, map(whole, stems))}):
        return False
    split = [_DECIMAL.split(stem) for stem in stems]
    odd = (at for parts in split for at in range(1, len(parts), 2) if not parts[at].isdecimal())
    place, series = min(odd), defaultdict(list)
    for parts in split:
        if len(parts) > place:
            series[tuple(parts[:place])].append(parts[place].replace(",", "."))
    most = max(len(number.partition(".")[2]) for one in series.values() for number in one)
    wholes = [[_of_units(number, most) for number in one] for one in series.values()]
    decimals = [[Decimal(number) for number in one] for one in series.values()]
    return _unevenness(decimals) < _unevenness(wholes)


def _of_units(number: str, digits: int) -> Decimal:
    """Return a number whose digits after the point count units of so many digits."""
    before, _, after = number.partition("e")[0].partition(".")
    return Decimal(f"{before}.{after:>0{digits}}")


def _unevenness(series: Sequence[Sequence[Any]]) -> float:
    """Return the mean deviation of steps from the median, as a share of it, each at most 1."""
    steps = [after - before for one in series for before, after in pairwise(sorted(one))]
    usual = median(steps) if steps else 0
    return mean(min(1.0, float(abs(step - usual) / usual)) for step in steps) if usual else 1.0


LISTS = ("images.txt", "timestamps.txt", "info.txt")
"""Lists of times that are looked for in the folder, then beside it."""

_BESIDE = {"rgb": "rgb.txt", "depth": "depth.txt", "data": "data.csv", "img": "left_images.txt"}
"""Lists beside folders of these names, in data sets: see :mod:`adv2e.sources.listings`."""

UNREAD = (
    *(
        ".apng",
        ".mpo",
        ".jpe",
        ".jfif",
        ".heic",
        ".heif",
        ".avif",
        ".jxl",
        ".jp2",
        ".gif",
        ".pbm",
        ".pam",
        ".tga",
        ".psd",
    ),
    *(".dpx", ".cin", ".dng", ".cr2", ".cr3", ".nef", ".arw", ".raf", ".orf", ".rw2"),
)
"""Still images that are not read: they are not left out without a word."""


def open_source(path: Path, given: GivenTimes, selection: Selection) -> ListedSource:
    """Return the frames of a folder of images.

    Times are those given, else those of the first list found: ``images.txt`` (``t name``, of the
    Event-Camera Dataset), ``timestamps.txt`` (one time a line, of vid2e), ``info.txt`` (``path
    t_us``, of DVS-Voltmeter), in the folder or beside it.
    """
    names, told = in_order(_image_names(path))
    files = [path / name for name in names]
    pictures = [Picture(str(f), str(f.absolute()), partial(read_image, f)) for f in files]
    if not pictures:
        raise _no_images(path)
    if len(pictures) == 1:
        pictures[0].load()  # if it holds several, that is what is to be told
    found = found_list(path)
    label = None if found is None else str(found)
    missing = f"one of {', '.join(LISTS)} there"
    times = timed(given, pictures, path, label, partial(_read, given), missing, told)
    if rest := len(pictures) - len(times.shots):
        line = f"{rest} images are not in {found} and are left out"
        times.notes.append(left_out(line, f"{rest} images that the list does not name"))
    if unread := _unread(path):
        line = f"images that are not read are left out: {len(unread)}, such as {unread[0]}"
        times.notes.append(told_of(path, left_out(line)))
    # the folder may be that of the frames of a recording of ours
    ours = found.with_name(DESCRIPTION) if found is not None and found.name == LIST else None
    light = None if ours is None else light_beside(ours)
    has_clock = given.fps is None
    source = ListedSource(path, "images", times, selection, has_clock=has_clock, light=light)
    source.inputs += filter(None, [ours])
    return source


def _read(given: GivenTimes, name: str) -> FrameList:
    return read_list(Path(name), time_unit=given.time_unit)


def image_files(folder: Path) -> list[Path]:
    """Return the images in a folder, in the order of their names; hidden files left out."""
    return [folder / name for name in in_order(_image_names(folder))[0]]


def _image_names(folder: Path) -> list[str]:
    with reading(folder):
        entries = [entry for entry in folder.iterdir() if not entry.name.startswith(".")]
    return [e.name for e in entries if e.suffix.lower() in IMAGE_SUFFIXES and e.is_file()]


def found_list(folder: Path) -> Path | None:
    """Return the list of times in a folder, or beside it; None: there is none."""
    whole = folder.absolute()
    places = [place / name for place in (folder, whole.parent) for name in LISTS]
    if whole.name in _BESIDE:
        places.append(whole.parent / _BESIDE[whole.name])
    return next((place for place in places if place.is_file()), None)


def _unread(folder: Path) -> list[str]:
    """Return the names of images that are not read."""
    names = [e.name for e in folder.iterdir() if e.suffix.lower() in UNREAD]
    return sorted((name for name in names if not name.startswith(".")), key=natural_key)


def _is_video(path: Path) -> bool:
    from adv2e.sources import VIDEO_SUFFIXES  # noqa: PLC0415 - it names this module

    return path.suffix.lower() in VIDEO_SUFFIXES and path.is_file()


def _no_images(folder: Path) -> DataError:
    below = [entry for entry in sorted(folder.iterdir()) if entry.is_dir() and image_files(entry)]
    if below:
        return DataError(f"{folder}: no images in it; there are some in {below[0]}")
    if unread := _unread(folder):
        return DataError(f"{folder}: {unread[0]} is not read; convert its images, to PNG or TIFF")
    videos = sorted(entry.name for entry in folder.iterdir() if _is_video(entry))
    if videos:
        return DataError(
            f"{folder}: no images in it, but videos, such as {videos[0]}: give one, or convert all"
            f" with 'adv2e batch {folder} DEST'"
        )
    known = " ".join(suffix.lstrip(".") for suffix in IMAGE_SUFFIXES)
    return DataError(f"{folder}: no images in it ({known})")
