"""Headers of lines that begin with ``%``, which RAW and DAT files of Prophesee begin with.

A line is ``% key value``; the line ``% end`` ends the header, or the first line of another kind.
This program writes a line ``% adv2e`` with its settings as JSON.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

from adv2e.errors import DataError
from adv2e.formats.event_file import Facts, described_geometry
from adv2e.formats.sink import Request, to_line
from adv2e.ticks import US, check_time

_LONGEST = 1 << 20  # bytes of a header
_LINE = re.compile(rb"%[ \r\n]")


@dataclass(frozen=True)
class Header:
    """The header of a file.

    Attributes
    ----------
    path : Path
        The file.
    values : dict
        By key, in lower case.
    size : int
        Where the header ends [bytes].
    """

    path: Path
    values: dict[str, str]
    size: int

    def whole(self, key: str) -> int | None:
        """Return the whole number that a line gives, or None without that line.

        Raises
        ------
        DataError
            It is none.
        """
        value = self.values.get(key)
        if value is None:
            return None
        if not re.fullmatch(r"[0-9]{1,18}", value):
            raise DataError(
                f"{self.path}: header: {key!r} must be a whole number, not {value[:40]!r}"
            )
        return int(value)

    @property
    def t0(self) -> int:
        """Time [us] that faery took off all times and states; DataError if it cannot be."""
        t0_us = self.whole("t0") or 0
        check_time(t0_us * US, f"{self.path}: header: 't0'")
        return t0_us

    def tell(self, facts: Facts, geometry: tuple[int | None, int | None]) -> None:
        """Hand the description in the header to `facts`, and the geometry, (width, height)."""
        if "adv2e" in self.values:
            facts.describe(self.values["adv2e"], f"{self.path}: header: adv2e", "the header")
        sizes = {"width": geometry[0], "height": geometry[1]}
        facts.state(described_geometry(sizes), "the header")


def read_header(path: Path) -> Header:
    """Read the header of a file; one without a header has no values.

    Raises
    ------
    DataError
        A line of it does not end.
    """
    with path.open("rb") as file:
        data = file.read(_LONGEST)
    values: dict[str, str] = {}
    at = 0
    while _LINE.match(data, at):
        end = data.find(b"\n", at)
        if end < 0:
            raise DataError(f"{path}: header: a line, at byte {at}, does not end")
        line = data[at + 1 : end].decode("utf-8", "replace").strip()
        at = end + 1
        if line == "end":
            break
        key, _, value = line.partition(" ")
        values[key.lower()] = value.strip()
    return Header(path, values, at)


def raw_header(request: Request, version: str) -> bytes:
    """Return the whole header of a RAW file in EVT of that version, such as 3.0."""
    encoding = f"EVT{version[0]};height={request.height};width={request.width}"
    geometry = f"geometry {request.width}x{request.height}"
    return header_of(request, f"evt {version}", f"format {encoding}", geometry) + b"% end\n"


def header_of(request: Request, *lines: str) -> bytes:
    """Return a header of such lines and the settings; the end is for the caller to add."""
    settings = f"adv2e {to_line(request.description)}"
    return "".join(f"% {line}\n" for line in (*lines, settings)).encode("ascii")
