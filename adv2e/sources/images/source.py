"""Folders of still images, in the order of their names, with times from beside them."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from adv2e.errors import DataError
from adv2e.sources.images.opencv import IMAGE_SUFFIXES, read_image
from adv2e.sources.images.order import in_order, natural_key
from adv2e.sources.listed import ListedSource, Picture, timed
from adv2e.sources.stored import DESCRIPTION, LIST, light_beside
from adv2e.sources.times.lists import FrameList, read_list
from adv2e.sources.wanted import GivenTimes, Selection

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
    if left_out := len(pictures) - len(times.shots):
        times.notes.append(f"{left_out} images are not in {found} and are left out")
    if unread := _unread(path):
        times.notes.append(
            f"{path}: images that are not read are left out: {len(unread)}, such as {unread[0]}"
        )
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
    try:
        entries = [entry for entry in folder.iterdir() if not entry.name.startswith(".")]
    except OSError as error:
        raise DataError(f"{folder}: {error.strerror}") from error
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
