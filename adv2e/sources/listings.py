"""Folders and zips of data sets that have a list of their frames, and images below it.

======== ======================================= ==============================================
kind     list                                    a line of it, and where the images are
======== ======================================= ==============================================
tum      ``rgb.txt``                             ``1305031102.175304 rgb/1305031102.175304.png``
euroc    ``data.csv``, in ``cam0``, ``mav0``     ``1403636579763555584,1403636579763555584.png``,
                                                 in ``data/`` beside it
uzh-fpv  ``left_images.txt``,                    ``0 1540821840.60 img/image_0_0.png``
         ``right_images.txt``
======== ======================================= ==============================================

UZH-FPV's recordings of a DAVIS have ``images.txt`` and are read as those of the Event-Camera
Dataset.

References
----------
.. [1] J. Sturm et al., "A Benchmark for the Evaluation of RGB-D SLAM Systems", IROS 2012.
.. [2] M. Burri et al., "The EuRoC micro aerial vehicle datasets", IJRR 2016.
.. [3] J. Delmerico et al., "Are We Ready for Autonomous Drone Racing? The UZH-FPV Drone Racing
   Dataset", ICRA 2019.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path, PurePosixPath

from adv2e.errors import DataError
from adv2e.files.zips import Members
from adv2e.label import guessed, told_of
from adv2e.sources.base import GivenTimes, Selection
from adv2e.sources.frame import Light
from adv2e.sources.images.opencv import IMAGE_SUFFIXES, image_of
from adv2e.sources.listed import ListedSource, Picture, timed
from adv2e.sources.times.lists import decoded, first_name, member_of, members_of, parse_list


@dataclass(frozen=True)
class Listing:
    """A list of frames: what kind of data set has it, its place, and what else is to be known.

    `below` is the folder beside the list that images without one are in, `other` that of another
    camera.
    """

    kind: str
    place: str
    below: str = ""
    other: str = ""


_KNOWN = (
    Listing("tum", "rgb.txt"),
    Listing("euroc", "mav0/cam0/data.csv", "data", "mav0/cam1"),
    Listing("euroc", "cam0/data.csv", "data", "cam1"),
    Listing("euroc", "data.csv", "data"),
    Listing("uzh-fpv", "left_images.txt"),
    Listing("uzh-fpv", "right_images.txt"),
)


def find_listing(files: Members) -> Listing | None:
    """Return the list that a folder or zip has, if there is the image that it names first."""
    for known in _KNOWN:
        try:
            label = files.label(known.place)
            if not files.has(known.place):
                continue
            if not (name := first_name(decoded(files.read(known.place), label), label)):
                continue
        except DataError:  # another table under this name
            continue
        image = member_of(name, partial(_has, files, _folder(files, known, name)))
        if image and PurePosixPath(image).suffix.lower() in IMAGE_SUFFIXES:
            return known
    return None


def open_source(path: Path, given: GivenTimes, selection: Selection) -> ListedSource:
    """Return the frames of a folder with such a list."""
    files = Members(path)
    listing = find_listing(files)
    if listing is None:
        raise DataError(f"{path}: no list of frames in it that is known")
    return open_listing(files, listing, given, selection)


def open_listing(
    files: Members, listing: Listing, given: GivenTimes, selection: Selection
) -> ListedSource:
    """Return the frames of a list that was found in a folder or zip."""
    path = files.path
    source = listed_source(files, listing, given, selection)
    if listing.other and files.has(f"{listing.other}/data.csv"):
        other = files.label(listing.other)
        told = f"its first camera is taken; the second is {other}"
        first = files.label(listing.place.rpartition("/")[0])
        how, why = f"give {first} or {other}", "there are two of them"
        source.notes.append(told_of(path, guessed(told, "camera", "the first", how, why)))
    return source


def listed_source(
    files: Members,
    listing: Listing,
    given: GivenTimes,
    selection: Selection,
    *,
    stated: str | None = None,
    light: Light | None = None,
) -> ListedSource:
    """Return the frames that a list in a folder or zip names.

    `stated` is the unit that its times are known to have, `light` what the frames stand for where
    it is not the images that tell.

    Raises
    ------
    DataError
        The list cannot be read, or an image that it names is missing.
    """
    path, label = files.path, files.label(listing.place)
    found = parse_list(
        decoded(files.read(listing.place), label),
        label,
        time_unit=None if given else given.time_unit,  # else it is that of the other list
        stated=stated,
    )
    folder = _folder(files, listing, found.stamps[0].name or "")
    where = f" in {path}" if path.is_dir() else " in the zip"
    members = members_of(found.stamps, label, partial(_has, files, folder), where=where)
    places = [str(folder / member) for member in members]
    pictures = [Picture(files.label(m), m, partial(image_of, files, m)) for m in places]
    # in their order: which picture a name means is settled
    unnamed = replace(found, stamps=[replace(stamp, name=None) for stamp in found.stamps])
    times = timed(given, pictures, path, label, lambda _: unnamed)
    has_clock = given.fps is None
    return ListedSource(path, listing.kind, times, selection, has_clock=has_clock, light=light)


def _folder(files: Members, listing: Listing, name: str) -> PurePosixPath:
    """Return the folder below which the images are, `name` being that of one."""
    beside = PurePosixPath(listing.place).parent
    inside = beside / listing.below
    return beside if member_of(name, partial(_has, files, beside)) else inside


def _has(files: Members, folder: PurePosixPath, member: str) -> bool:
    return files.has(str(folder / member))
