"""Files that end on ``.raw``, as Prophesee's cameras write them: their header says the encoding."""

from __future__ import annotations

from pathlib import Path

from adv2e.errors import DataError
from adv2e.formats.event_file import EventFile, Facts
from adv2e.formats.evt2 import evt2_of, evt21_of
from adv2e.formats.evt3 import evt3_of
from adv2e.formats.percent_header import Header, read_header

_READ = {"EVT2": evt2_of, "EVT21": evt21_of, "EVT3": evt3_of}
_VERSIONS = {"2.0": "EVT2", "2.1": "EVT21", "3.0": "EVT3", "4.0": "EVT4"}


def open_raw(path: Path, facts: Facts) -> EventFile:
    """Open a file in EVT 2.0, EVT 2.1 or EVT 3.0.

    Raises
    ------
    DataError
        Its header says another encoding, or none.
    """
    header = read_header(path)
    encoding, options = _encoding(header)
    if encoding not in _READ:
        raise DataError(
            f"{path}: events in {encoding or 'an encoding that its header does not state'};"
            f" {', '.join(_READ)} are read, as '% evt 3.0' or '% format EVT3;...' in its header"
            " states them; Metavision converts others: metavision_file_to_hdf5,"
            " metavision_file_to_csv"
        )
    if options.get("endianness", header.values.get("endianness", "little")) == "big":
        raise DataError(f"{path}: {encoding} in big-endian words, must be little-endian")
    geometry = header.values.get("geometry", "").partition("x")
    header.tell(
        facts,
        (
            _size(options.get("width") or geometry[0]),
            _size(options.get("height") or geometry[2]),
        ),
    )
    return _READ[encoding](header, facts, options)


def _encoding(header: Header) -> tuple[str, dict[str, str]]:
    """Return what the header says of the encoding: its name, and options."""
    name, *options = header.values.get("format", "").split(";")
    version = header.values.get("evt", "")
    pairs = (option.partition("=") for option in options)
    return (
        name.strip().upper() or _VERSIONS.get(version, version),
        {key.strip().lower(): value.strip() for key, _, value in pairs},
    )


def _size(text: str) -> int | None:
    return int(text) if text.isascii() and text.isdigit() and len(text) < 6 else None
