"""Recordings in the layout of the Event-Camera Dataset (DAVIS240C): a folder or its zip.

``images.txt`` has lines ``t name``, t in seconds and the name with its folder
(``images/frame_00000000.png``).  Stamps are sorted, since some recordings store them out of
order, and stay on the recording's clock, on which its events are.

References
----------
.. [1] E. Mueggler et al., "The Event-Camera Dataset and Simulator", IJRR 2017,
   doi:10.1177/0278364917691115.
"""

from __future__ import annotations

import zipfile
from functools import partial
from pathlib import Path, PurePosixPath

from adv2e.errors import DataError
from adv2e.files.zips import UNREADABLE, open_member
from adv2e.sources.frame import RECORDED, Light, Pixels, Shot
from adv2e.sources.images.opencv import decode_image, read_image
from adv2e.sources.listed import ListedSource, Picture, given_shots, told
from adv2e.sources.stored import DESCRIPTION, MOST_BYTES, light_beside, read_light
from adv2e.sources.times.lists import FrameList, decoded, first_name, parse_list, read_list
from adv2e.sources.times.names import member_of, members_of
from adv2e.sources.wanted import GivenTimes, Selection

LIST = "images.txt"


def is_recording(folder: Path) -> bool:
    """Tell whether a folder has this layout: a list of images that are in folders below it."""
    if not (folder / LIST).is_file():
        return False
    if (folder / "events.txt").is_file():
        return True
    name = first_name(folder / LIST)
    return "/" in (member_of(name, lambda member: (folder / member).is_file()) or name)


def open_source(path: Path, given: GivenTimes, selection: Selection) -> ListedSource:
    """Return the frames of a recording, a folder or a zip.

    Raises
    ------
    DataError
        Not such a recording, or an image that is listed is missing.
    """
    if path.is_dir():
        return _open_folder(path, given, selection)
    return _open_zip(path, given, selection)


def _open_folder(path: Path, given: GivenTimes, selection: Selection) -> ListedSource:
    label = str(path / LIST)
    found = read_list(path / LIST, time_unit=_unit(given))
    members = members_of(
        found.stamps,
        label,
        lambda member: (path / member).is_file(),
        where=f" in {path}",
        folder=path,
        anywhere=given.images_anywhere,
    )
    files = [path / member for member in members]
    pictures = [Picture(str(f), str(f.absolute()), partial(read_image, f)) for f in files]
    return _source(path, label, found, pictures, given, selection, light_beside(path))


def _open_zip(path: Path, given: GivenTimes, selection: Selection) -> ListedSource:
    try:
        archive = zipfile.ZipFile(path)  # stays open as long as its members may be read
        names = set(archive.namelist())
        listed = _list_in(path, names)
        with open_member(archive, listed) as file:
            data = file.read()
    except UNREADABLE as error:
        raise DataError(f"{path}: not a zip that can be read, or damaged") from error
    label = f"{path}: {listed}"
    top = listed.removesuffix(LIST)
    stated = "s" if top + DESCRIPTION in names else None
    found = parse_list(decoded(data, label), label, time_unit=_unit(given), stated=stated)
    members = members_of(
        found.stamps, label, lambda member: top + member in names, where=" in the zip"
    )
    pictures = []
    for member in members:
        name = f"{path}: {top}{member}"
        pictures.append(
            Picture(name, top + member, partial(_read_member, archive, top + member, name))
        )
    light = _light_in(archive, top + DESCRIPTION, path)
    return _source(path, label, found, pictures, given, selection, light)


def _unit(given: GivenTimes) -> str | None:
    """Return the unit that the user says the list has; with another list it is that one's."""
    return None if given else given.time_unit


def _list_in(path: Path, names: set[str]) -> str:
    depths = {name: len(PurePosixPath(name).parts) for name in names}
    lists = [
        name
        for name, depth in sorted(depths.items())
        if PurePosixPath(name).name == LIST and depth <= 2 and not name.startswith("__MACOSX/")
    ]
    if len(lists) != 1:
        raise DataError(
            f"{path}: {'more than one' if lists else 'no'} {LIST} in it; a DAVIS240C zip has it at"
            " its root or in one folder"
        )
    return lists[0]


def _light_in(archive: zipfile.ZipFile, member: str, path: Path) -> Light | None:
    if member not in archive.namelist():
        return None
    label = f"{path}: {member}"
    try:
        with archive.open(member) as file:
            text = file.read(MOST_BYTES + 1)
    except UNREADABLE as error:
        raise DataError(f"{label}: cannot be read from the zip, or damaged") from error
    return read_light(text, label)


def _read_member(archive: zipfile.ZipFile, member: str, label: str) -> Pixels:
    try:
        with open_member(archive, member) as file:
            data = file.read()
    except UNREADABLE as error:
        raise DataError(f"{label}: cannot be read from the zip, or damaged") from error
    return decode_image(data, label)


def _source(
    path: Path,
    label: str,
    found: FrameList,
    pictures: list[Picture],
    given: GivenTimes,
    selection: Selection,
    stored: Light | None,
) -> ListedSource:
    light = stored or Light("linear", RECORDED)
    if given:
        timed = given_shots(given, pictures, path)
        timed.notes.append(f"{given} replaces the times in {label}")
    else:
        pairs = zip(found.stamps, pictures, strict=True)
        shots = [Shot(stamp.t_ns, picture.label, picture.load) for stamp, picture in pairs]
        timed = told(found, label, shots)
    return ListedSource(
        path, "davis240c", timed, selection, has_clock=given.fps is None, light=light
    )
