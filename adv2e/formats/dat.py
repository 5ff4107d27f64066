"""Events in DAT, a format of Prophesee's cameras and data sets, in files that end on ``.dat``.

A header of lines (:mod:`adv2e.formats.percent_header`), which states ``Version 2``, ``Width`` and
``Height``, is followed by two bytes, the type and size of an event, and by the events, each two
words of 32 bits, little endian:

==== =====================================================
word bits
==== =====================================================
0    time [us]
1    0-13: column; 14-27: row; 28-31: polarity, ON above 0
==== =====================================================

Times have 32 bits, some 71 minutes; where they begin again at zero, that is counted on reading.
Type 12 is written (contrast detection); type 0, which expelliarmus writes, is the same.  faery
writes times from the first event on, and that as ``% T0`` in the header, which is added here.

References
----------
.. [1] Prophesee, "DAT File Format",
   https://docs.prophesee.ai/stable/data/file_formats/dat.html.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import numpy as np

from adv2e.errors import DataError
from adv2e.events import Events
from adv2e.formats.event_file import Columns, EventFile, Facts
from adv2e.formats.percent_header import header_of, read_header
from adv2e.formats.sink import Request, Writer
from adv2e.formats.words import blocks

_TYPE, _SIZE = 12, 8
_TYPES = (0, _TYPE)
_BLOCK = 1 << 18  # events


def open_dat(path: Path, facts: Facts) -> EventFile:
    """Open a DAT file.

    Raises
    ------
    DataError
        It is of another version, or holds another type of events.
    """
    header = read_header(path)
    version = header.whole("version")
    if version != 2:
        raise DataError(
            f"{path}: its header states {f'version {version}' if version else 'no version'}, must"
            " be version 2; Metavision writes it: metavision_raw_to_dat"
        )
    with path.open("rb") as file:
        file.seek(header.size)
        kind = tuple(file.read(2))
    if not kind:
        facts.problems.append("nothing follows its header")
    elif len(kind) < 2 or kind[0] not in _TYPES or kind[1] != _SIZE:
        held = f"type {kind[0]} of {kind[1]} bytes" if len(kind) == 2 else "cut short"
        raise DataError(
            f"{path}: events, at byte {header.size}: {held}, must be type {_TYPE} (contrast"
            f" detection) of {_SIZE} bytes"
        )
    header.tell(facts, (header.whole("width"), header.whole("height")))
    begin = header.t0

    def parts() -> Iterator[Columns]:
        for words in blocks(path, header.size + 2, "(2,)<u4", _BLOCK, facts):
            where = words[:, 1]
            yield (
                words[:, 0],
                where & 0x3FFF,
                where >> 14 & 0x3FFF,
                (where >> 28 > 0).astype(np.uint8),
            )

    return EventFile("dat", facts, parts, offset_us=begin, bits=32)


class DatWriter(Writer):
    """Writes DAT; see :class:`Writer`."""

    def __init__(self, request: Request, stack: ExitStack, *temporary: Path) -> None:
        (path,) = temporary
        self._file = stack.enter_context(path.open("wb"))
        sizes = f"Width {request.width}", f"Height {request.height}"
        first = "Data file containing CD events."
        self._file.write(header_of(request, first, "Version 2", *sizes) + bytes([_TYPE, _SIZE]))

    def write_events(self, events: Events) -> None:
        """Append events."""
        for begin in range(0, events.size, _BLOCK):
            part = events[begin : begin + _BLOCK]
            words = np.empty((part.size, 2), "<u4")
            words[:, 0] = part["t"]
            polarity, row = part["p"].astype(np.uint32) << 28, part["y"].astype(np.uint32) << 14
            words[:, 1] = polarity | row | part["x"]
            self._file.write(words.data)
