"""Recordings in the layout of the Event-Camera Dataset (DAVIS240C): a folder or its zip.

``events.txt`` (see :mod:`adv2e.formats.text.reader`) and, if there are frames, ``images.txt`` with
lines ``t name``, t in seconds.  A zip holds them at its root or in one folder.  A zip of a single
text file (as rpg_e2vid takes it) is read as text.

References
----------
.. [1] E. Mueggler et al., "The Event-Camera Dataset and Simulator", IJRR 2017,
   doi:10.1177/0278364917691115.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from adv2e.errors import DataError
from adv2e.files.names import beside
from adv2e.files.zips import Members
from adv2e.formats.event_file import EventFile, Facts
from adv2e.formats.text.reader import lines_of
from adv2e.sources.frame import Pixels, Shot
from adv2e.sources.images.opencv import decode_image
from adv2e.sources.stored import DESCRIPTION, EVENTS, LIST
from adv2e.sources.times.lists import FrameList, decoded, has_lines, members_of, parse_list


def open_davis240c(path: Path, facts: Facts) -> EventFile:
    """Open the recording in a folder or zip.

    Raises
    ------
    DataError
        No ``events.txt`` in it, a line that cannot be read, or an image that is listed is missing;
        a zip that cannot be read.
    """
    files = Members(path)
    if path.is_dir():
        if not files.has(EVENTS):
            raise DataError(f"{path}: no {EVENTS} in it; a folder must be a DAVIS240C recording")
        name = EVENTS
    else:
        found = files.enter(EVENTS) or files.enter("*.txt")
        if len(found) != 1:
            raise DataError(
                f"{path}: must hold one {EVENTS}, at its root or in one folder, or a single text"
                " file"
            )
        (name,) = found
    if files.has(DESCRIPTION):
        text = files.read(DESCRIPTION).decode("utf-8-sig", "replace")
        facts.describe(text, files.label(DESCRIPTION), DESCRIPTION)
    elif not path.is_dir() and (described := beside(path, ".json")).is_file():
        facts.describe_from(described)  # a zip for rpg_e2vid holds nothing but events
    facts.inputs += map(files.label, (name, LIST, DESCRIPTION))
    listed = _listed(files, stated=facts.stated_unit)
    if listed is not None and len(listed.stamps) > 1:
        facts.note_frames(listed.unit, whole=listed.whole)
    if facts.geometry is None and listed is not None:
        first = members_of(listed.stamps[:1], files.label(LIST), files.has)[0]
        rows, columns = decode_image(files.read(first), files.label(first)).image.shape[:2]
        facts.state((columns, rows), first)
    label = files.label(name)
    header = f"the first line of {name}"
    text_file = lines_of(lambda: files.open(name), files.size(name), label, facts, header)
    if listed is None:
        return replace(text_file, layout="davis240c" if name == EVENTS else "text")
    if unit := facts.unit_of_frames(whole=listed.whole):
        listed = _listed(files, time_unit=unit) or listed
    facts.problems += [f"{LIST}: {line}" for line in (listed.unit.doubt, listed.order) if line]
    names = members_of(listed.stamps, files.label(LIST), files.has)
    shots = [
        Shot(stamp.t_ns, files.label(member), partial(_image, files, member))
        for stamp, member in zip(listed.stamps, names, strict=True)
    ]
    return replace(text_file, layout="davis240c", shots=lambda: iter(shots))


def _image(files: Members, name: str) -> Pixels:
    return decode_image(files.read(name), files.label(name))


def _listed(files: Members, **evidence: Any) -> FrameList | None:
    """Return the list of frames, or None without frames."""
    if not files.has(LIST):
        return None
    label = files.label(LIST)
    text = decoded(files.read(LIST), label)
    return parse_list(text, label, **evidence) if has_lines(text) else None
