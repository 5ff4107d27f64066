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

from dataclasses import replace
from functools import partial
from pathlib import Path

from adv2e.errors import DataError
from adv2e.files.zips import Members
from adv2e.sources.frame import RECORDED, Light, Pixels
from adv2e.sources.images.opencv import decode_image
from adv2e.sources.listed import ListedSource, Picture, timed
from adv2e.sources.stored import DESCRIPTION, EVENTS, LIST, read_light
from adv2e.sources.times.lists import decoded, first_name, parse_list
from adv2e.sources.times.names import member_of, members_of
from adv2e.sources.wanted import GivenTimes, Selection


def is_recording(folder: Path) -> bool:
    """Tell whether a folder has this layout: a list of images that are in folders below it."""
    if not (folder / LIST).is_file():
        return False
    if (folder / EVENTS).is_file():
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
    files = Members(path)
    lists = files.enter(LIST)
    if len(lists) != 1:
        raise DataError(
            f"{path}: {'more than one' if lists else 'no'} {LIST} in it; a DAVIS240C zip has it at"
            " its root or in one folder"
        )
    label = files.label(LIST)
    found = parse_list(
        decoded(files.read(LIST), label),
        label,
        time_unit=None if given else given.time_unit,  # else it is that of the other list
        stated="s" if files.has(DESCRIPTION) else None,
    )
    members = members_of(
        found.stamps,
        label,
        files.has,
        where=f" in {path}" if path.is_dir() else " in the zip",
    )
    pictures = [Picture(files.label(m), m, partial(_read_image, files, m)) for m in members]
    # in their order: which picture a name means is settled
    unnamed = replace(found, stamps=[replace(stamp, name=None) for stamp in found.stamps])
    times = timed(given, pictures, path, label, lambda _: unnamed)
    light = None
    if files.has(DESCRIPTION):
        light = read_light(files.read(DESCRIPTION), files.label(DESCRIPTION))
    return ListedSource(
        path,
        "davis240c",
        times,
        selection,
        has_clock=given.fps is None,
        light=light or Light("linear", RECORDED),
    )


def _read_image(files: Members, member: str) -> Pixels:
    return decode_image(files.read(member), files.label(member))
