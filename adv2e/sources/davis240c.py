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
from adv2e.sources.base import RECORDED, GivenTimes, Light, Pixels, Selection, Shot
from adv2e.sources.listed import ListedSource, Picture, given_shots
from adv2e.sources.opencv import decode_image, read_image
from adv2e.sources.stored import DESCRIPTION, MOST_BYTES, light_beside, read_light
from adv2e.sources.times import Stamp, parse_list, read_text
from adv2e.zips import UNREADABLE, open_member

LIST = "images.txt"


def is_recording(folder: Path) -> bool:
    """Tell whether a folder has this layout: a list of images that are in folders below it."""
    if not (folder / LIST).is_file():
        return False
    stamps, _ = parse_list(read_text(folder / LIST), str(folder / LIST))
    below = any(len(PurePosixPath(stamp.name or "").parts) > 1 for stamp in stamps)
    return below or (folder / "events.txt").is_file()


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
    stamps, unit = parse_list(read_text(path / LIST), label)
    pictures = []
    for stamp in _named(stamps, label):
        file = path / str(stamp.name)
        if not file.is_file():
            raise DataError(f"{label} line {stamp.line}: no image {file}")
        pictures.append(Picture(str(file), file.name, partial(read_image, file)))
    light = light_beside(path)
    return _source(path, label, stamps, unit, pictures, given, selection, light)


def _open_zip(path: Path, given: GivenTimes, selection: Selection) -> ListedSource:
    try:
        archive = zipfile.ZipFile(path)  # stays open as long as its members may be read
        names = set(archive.namelist())
        listed = _list_in(path, names)
        with open_member(archive, listed) as file:
            text = file.read().decode("utf-8-sig")
    except UNREADABLE as error:
        raise DataError(f"{path}: not a zip that can be read, or damaged") from error
    label = f"{path}: {listed}"
    stamps, unit = parse_list(text, label)
    pictures = []
    for stamp in _named(stamps, label):
        member = str(PurePosixPath(listed).parent / str(stamp.name))
        if member not in names:
            raise DataError(f"{label} line {stamp.line}: no image {member} in the zip")
        load = partial(_read_member, archive, member, f"{path}: {member}")
        pictures.append(Picture(f"{path}: {member}", PurePosixPath(member).name, load))
    light = _light_in(archive, str(PurePosixPath(listed).parent / DESCRIPTION), path)
    return _source(path, label, stamps, unit, pictures, given, selection, light)


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


def _named(stamps: list[Stamp], label: str) -> list[Stamp]:
    if stamps[0].name is None:
        raise DataError(f"{label} line {stamps[0].line}: expected 'time name' of an image")
    return stamps


def _source(
    path: Path,
    label: str,
    stamps: list[Stamp],
    unit: str,
    pictures: list[Picture],
    given: GivenTimes,
    selection: Selection,
    stored: Light | None,
) -> ListedSource:
    light = stored or Light("linear", RECORDED)
    if given:
        shots = given_shots(given, pictures, path)
    else:
        pairs = zip(stamps, pictures, strict=True)
        shots = [Shot(stamp.t_ns, picture.label, picture.load) for stamp, picture in pairs]
    source = ListedSource(
        path, "davis240c", shots, selection, has_clock=given.fps is None, light=light
    )
    if given:
        source.notes.append(f"{given} replaces the times in {label}")
    elif unit:
        source.notes.append(f"{label}: {unit}")
    return source
