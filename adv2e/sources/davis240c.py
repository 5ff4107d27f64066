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

from pathlib import Path

from adv2e.errors import DataError
from adv2e.files.zips import Members
from adv2e.sources.base import GivenTimes, Selection
from adv2e.sources.frame import RECORDED, Light
from adv2e.sources.listed import ListedSource
from adv2e.sources.listings import Listing, listed_source
from adv2e.sources.stored import DESCRIPTION, EVENTS, LIST, read_light
from adv2e.sources.times.lists import decoded, first_name, member_of


def is_recording(files: Members) -> bool:
    """Tell whether files have this layout: a list of images that are in folders below it."""
    if not files.has(LIST):
        return False
    if files.has(EVENTS):
        return True
    name = first_name(decoded(files.read(LIST), files.label(LIST)), files.label(LIST))
    return "/" in (member_of(name, files.has) or name)


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
    light, ours = None, files.has(DESCRIPTION)
    if ours:
        light = read_light(files.read(DESCRIPTION), files.label(DESCRIPTION))
    source = listed_source(
        files,
        Listing("davis240c", LIST),
        given,
        selection,
        stated="s" if ours else None,
        light=light or Light("linear", RECORDED),
    )
    source.inputs += map(files.label, (EVENTS, DESCRIPTION))
    return source
