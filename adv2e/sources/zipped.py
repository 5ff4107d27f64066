"""Zips: recordings of data sets, and images like those of a folder, with times from beside them.

Nothing is unpacked: each image is read when it is wanted.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path, PurePosixPath

from adv2e.errors import DataError
from adv2e.files.zips import Members
from adv2e.label import left_out
from adv2e.sources import davis240c
from adv2e.sources.base import GivenTimes, Selection
from adv2e.sources.images.opencv import IMAGE_SUFFIXES, image_of
from adv2e.sources.images.source import LISTS, in_order
from adv2e.sources.listed import ListedSource, Picture, timed
from adv2e.sources.listings import find_listing, open_listing
from adv2e.sources.stored import LIST
from adv2e.sources.times.lists import FrameList, decoded, parse_list


def open_source(path: Path, given: GivenTimes, selection: Selection) -> ListedSource:
    """Return the frames of a zip, in the order of their names where no list has them.

    Raises
    ------
    DataError
        No images, or images in several folders; a zip that cannot be read; what goes wrong with
        images and lists.
    """
    files = Members(path)
    lists = files.enter(LIST)
    if len(lists) > 1 or (lists and davis240c.is_recording(files)):
        return davis240c.open_source(path, given, selection)
    names = files.archived()
    for top in ("", *sorted({name.partition("/")[0] + "/" for name in names if "/" in name})):
        if listing := find_listing(files.below(top)):
            return open_listing(files.below(top), listing, given, selection)
    files = files.below("")
    images, told = in_order(images_in(files))
    if not images:
        known = " ".join(suffix.lstrip(".") for suffix in IMAGE_SUFFIXES)
        raise DataError(f"{path}: no {LIST} in it, and no images ({known})")
    folders = sorted({name.rpartition("/")[0] or "." for name in images})
    if len(folders) > 1:
        raise DataError(
            f"{path}: images in more than one folder of it, {folders[0]} and {folders[1]}; make a"
            " zip of each"
        )
    pictures = [Picture(files.label(n), n, partial(image_of, files, n)) for n in images]
    found = _found_list(PurePosixPath(folders[0]), files)
    label = None if found is None else files.label(found)

    def read(label: str) -> FrameList:
        text = decoded(files.read(found or ""), label)
        return parse_list(text, label, time_unit=given.time_unit)

    missing = f"one of {', '.join(LISTS)} in it"
    times = timed(given, pictures, path, label, read, missing, told)
    if rest := len(pictures) - len(times.shots):
        line = f"{rest} images are not in {label} and are left out"
        times.notes.append(left_out(line, f"{rest} images that {found} does not name"))
    return ListedSource(path, "images", times, selection, has_clock=given.fps is None)


def images_in(files: Members) -> list[str]:
    """Return the images of a zip, in no order; hidden files left out."""
    return list(filter(_is_image, files.archived()))


def _is_image(name: str) -> bool:
    file = name.rpartition("/")[2]
    return file.lower().endswith(IMAGE_SUFFIXES) and not file.startswith(".")


def _found_list(folder: PurePosixPath, files: Members) -> str | None:
    """Return the list in the folder of the images, or beside it; None: there is none."""
    places = [str(place / name) for place in (folder, folder.parent) for name in LISTS]
    return next(filter(files.has, places), None)
