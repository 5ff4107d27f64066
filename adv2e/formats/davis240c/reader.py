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

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from adv2e.errors import DataError
from adv2e.files.zips import Members
from adv2e.formats.builder import RecordingBuilder
from adv2e.formats.recording import Recording
from adv2e.formats.text.reader import read_lines
from adv2e.sources.frame import Pixels
from adv2e.sources.images.opencv import decode_image
from adv2e.sources.stored import DESCRIPTION, EVENTS, LIST
from adv2e.sources.times.columns import has_lines
from adv2e.sources.times.lists import FrameList, decoded, parse_list
from adv2e.sources.times.names import members_of


def read_davis240c(path: Path, builder: RecordingBuilder) -> Recording:
    """Return the recording in a folder or zip; `builder` is a new one.

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
        builder.describe(text, files.label(DESCRIPTION), DESCRIPTION)
    listed = _listed(files, stated=builder.stated_unit)
    if listed is not None and len(listed.stamps) > 1:
        builder.note_frames(listed.unit, whole=listed.whole)
    with files.open(name) as file:
        geometry = read_lines(file, files.size(name), files.label(name), builder)
    times, names = None, []
    if listed is not None:
        if unit := builder.unit_of_frames(whole=listed.whole):
            listed = _listed(files, time_unit=unit) or listed
        told = listed.unit.doubt, listed.order
        builder.problems += [f"{LIST}: {line}" for line in told if line]
        names = members_of(listed.stamps, files.label(LIST), files.has)
        times = np.array([stamp.t_ns for stamp in listed.stamps], np.int64)

    def images() -> Iterator[Pixels]:
        for name in names:
            yield decode_image(files.read(name), files.label(name))

    if builder.geometry is None and names:
        rows, columns = next(images()).image.shape[:2]
        builder.state((columns, rows), names[0])
    builder.state(geometry, f"the first line of {name}")
    return builder.finish("davis240c" if name == EVENTS else "text", times, images)


def _listed(files: Members, **evidence: Any) -> FrameList | None:
    """Return the list of frames, or None without frames."""
    if not files.has(LIST):
        return None
    label = files.label(LIST)
    text = decoded(files.read(LIST), label)
    return parse_list(text, label, **evidence) if has_lines(text) else None
