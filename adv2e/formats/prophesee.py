"""HDF5 of Prophesee's tools, as far as it is not compressed by their own filter.

=========================== ====================================================================
/CD/events                  records of x, y (uint16), p (int16, 1 is ON and 0 is OFF), t (int64, us)
attribute geometry          columns x rows of the sensor, such as 1280x720
=========================== ====================================================================

Their tools compress with ECF (filter 36559), for which h5py needs a plug-in that no package has:
such files are refused in a line that says what helps.  They are not written, as their reader takes
only those compressed so; it reads .raw and .dat as well.

References
----------
.. [1] Prophesee, "HDF5 Event File Format", docs.prophesee.ai, data/file_formats/hdf5.html.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import h5py

from adv2e.errors import DataError
from adv2e.formats import hdf5
from adv2e.formats.event_file import Columns, EventFile, Facts, described_geometry
from adv2e.ticks import US, to_ticks

_EVENTS = "CD/events"


def open_prophesee(path: Path, facts: Facts) -> EventFile:
    """Open a file of this layout.

    Raises
    ------
    DataError
        It is compressed with ECF, or its records have other fields.
    """
    with hdf5.opened(path) as file:
        _events(file)
        found = re.fullmatch(r"(\d{1,6})x(\d{1,6})", _text(file.attrs.get("geometry", "")))
        if found:
            sizes = {"width": int(found[1]), "height": int(found[2])}
            facts.state(described_geometry(sizes), "the attribute geometry")

    def parts() -> Iterator[Columns]:
        with hdf5.opened(path) as file:
            events = _events(file)
            for begin in range(0, events.size, hdf5.PART):
                part = events[begin : begin + hdf5.PART]
                t = to_ticks(part["t"], US, US, f"{path}: {_EVENTS}")
                yield t, part["x"], part["y"], hdf5.signs(part["p"])
                facts.progress(begin + t.size, events.size)

    return EventFile("prophesee", facts, parts)


def _events(file: h5py.File) -> h5py.Dataset:
    events = hdf5.dataset(file, _EVENTS)
    fields = events.dtype.fields or {}
    kinds = {name: kind[0].kind for name, kind in fields.items()}
    if events.ndim != 1 or any(kinds.get(name) not in ("i", "u") for name in "xypt"):
        raise DataError(
            f"{file.filename}: {_EVENTS} must be records of the whole numbers x, y, p, t, got"
            f" {events.dtype}"
        )
    hdf5.check_stored([events], f"{file.filename}: {_EVENTS}")
    return events


def _text(value: object) -> str:
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)
