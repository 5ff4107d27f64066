"""Folders of still images, in natural order of their names, with times from beside them."""

from __future__ import annotations

import re
from functools import partial
from pathlib import Path

from adv2e.errors import DataError
from adv2e.sources.images.opencv import IMAGE_SUFFIXES, read_image
from adv2e.sources.listed import ListedSource, Picture, timed
from adv2e.sources.stored import light_beside
from adv2e.sources.times.lists import FrameList, read_list
from adv2e.sources.wanted import GivenTimes, Selection

LISTS = ("images.txt", "timestamps.txt", "info.txt")
"""Lists of times that are looked for in the folder, then beside it."""

_BESIDE = {"rgb": "rgb.txt", "depth": "depth.txt", "data": "data.csv", "img": "left_images.txt"}
"""Lists beside folders of these names, in data sets: see :mod:`adv2e.sources.listings`."""

_UNREAD = (
    *(".heic", ".heif", ".avif", ".jxl", ".jp2", ".gif", ".pbm", ".pam", ".tga", ".psd"),
    *(".dpx", ".cin", ".dng", ".cr2", ".cr3", ".nef", ".arw", ".raf", ".orf", ".rw2"),
)
"""Still images that are not read: they are not left out without a word."""


def open_source(path: Path, given: GivenTimes, selection: Selection) -> ListedSource:
    """Return the frames of a folder of images.

    Times are those given, else those of the first list found: ``images.txt`` (``t name``, of the
    Event-Camera Dataset), ``timestamps.txt`` (one time a line, of vid2e), ``info.txt`` (``path
    t_us``, of DVS-Voltmeter), in the folder or beside it.
    """
    pictures = [
        Picture(str(f), str(f.absolute()), partial(read_image, f)) for f in image_files(path)
    ]
    if not pictures:
        raise _no_images(path)
    if len(pictures) == 1:
        pictures[0].load()  # if it holds several, that is what is to be told
    found = found_list(path)
    label = None if found is None else str(found)
    missing = f"one of {', '.join(LISTS)} there"
    times = timed(given, pictures, path, label, partial(_read, given), missing)
    if left_out := len(pictures) - len(times.shots):
        times.notes.append(f"{left_out} images are not in {found} and are left out")
    if unread := _unread(path):
        times.notes.append(
            f"{path}: images that are not read are left out: {len(unread)}, such as {unread[0]}"
        )
    # the folder may be that of the frames of a recording of ours
    light = light_beside(found.parent) if found is not None and found.name == "images.txt" else None
    return ListedSource(path, "images", times, selection, has_clock=given.fps is None, light=light)


def _read(given: GivenTimes, name: str) -> FrameList:
    return read_list(Path(name), time_unit=given.time_unit)


def image_files(folder: Path) -> list[Path]:
    """Return the images in a folder, in natural order of their names; hidden files left out."""
    try:
        entries = [entry for entry in folder.iterdir() if not entry.name.startswith(".")]
    except OSError as error:
        raise DataError(f"{folder}: {error.strerror}") from error
    images = [e for e in entries if e.suffix.lower() in IMAGE_SUFFIXES and e.is_file()]
    return sorted(images, key=lambda entry: natural_key(entry.name))


def natural_key(name: str) -> tuple[list[tuple[bool, int, str]], str]:
    """Return a key that sorts names with their numbers as numbers: frame2 before frame10."""
    parts = re.split(r"([0-9]+)", name)
    return [(part.isdecimal(), int(part) if part.isdecimal() else 0, part) for part in parts], name


def found_list(folder: Path) -> Path | None:
    """Return the list of times in a folder, or beside it; None: there is none."""
    whole = folder.absolute()
    places = [place / name for place in (folder, whole.parent) for name in LISTS]
    if whole.name in _BESIDE:
        places.append(whole.parent / _BESIDE[whole.name])
    return next((place for place in places if place.is_file()), None)


def _unread(folder: Path) -> list[str]:
    """Return the names of images that are not read."""
    names = [e.name for e in folder.iterdir() if e.suffix.lower() in _UNREAD]
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
