"""Lists of frames in text files: the time of each, and which image is meant.

What the columns are is settled in :mod:`adv2e.sources.times.columns`, the unit of the times in
:mod:`adv2e.sources.times.units`.
"""

from __future__ import annotations

import codecs
import re
from dataclasses import dataclass
from decimal import Decimal
from itertools import pairwise
from pathlib import Path
from typing import Any

from adv2e.errors import DataError
from adv2e.files.regular import read_text_bytes
from adv2e.sources.times.columns import Line, Table, table_of
from adv2e.sources.times.instants import Stamp, parse_ns, seconds
from adv2e.sources.times.units import Unit, frame_unit


@dataclass(frozen=True)
class FrameList:
    """A list of frames.

    Attributes
    ----------
    stamps : list of Stamp
        In the order of time.
    columns : str
        What its columns were taken for, and the unit of its times.
    unit : Unit
        That unit, and what is to be told of it.
    order : str
        What is to be told of the order that its lines had; may be empty.
    whole : bool
        All its times are written as whole numbers.
    """

    stamps: list[Stamp]
    columns: str
    unit: Unit
    order: str = ""
    whole: bool = False

    def told(self, label: str) -> tuple[list[str], list[str]]:
        """Return doubts about the list `label`, and notes on it."""
        notes = [f"times from {label}: {self.columns}"]
        if self.order:
            notes.append(f"{label}: {self.order}")
        return [f"{label}: {self.unit.doubt}"] if self.unit.doubt else [], notes


def first_name(text: str, label: str) -> str:
    """Return the name on the first line of a list; "" if lines have none."""
    table = table_of(text, label)
    return _name(table.lines[0], table) or ""


def read_list(path: Path, **evidence: Any) -> FrameList:
    """Read a list of frames from a file; parameters and errors as :func:`parse_list`.

    What lies beside our own ``adv2e.json`` is in seconds.
    """
    if path.name == "images.txt" and path.with_name("adv2e.json").is_file():
        evidence.setdefault("stated", "s")
    return parse_list(_text(path), str(path), **evidence)


def _text(path: Path) -> str:
    try:
        return decoded(read_text_bytes(path), str(path))
    except OSError as error:
        raise DataError(f"{path}: {error.strerror}") from error


def decoded(data: bytes, label: str) -> str:
    """Return the text of a list; DataError unless it is text."""
    wide = data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
    try:
        # names are bytes: those that are not UTF-8 are what Python makes of such names of files
        text = data.decode("utf-16") if wide else data.decode("utf-8-sig", "surrogateescape")
    except UnicodeDecodeError as error:
        raise DataError(f"{label}: not a text file; one time a line is expected") from error
    if "\0" in text:
        raise DataError(f"{label}: not a text file; one time a line is expected")
    return text


def parse_list(
    text: str,
    label: str,
    *,
    time_unit: str | None = None,
    stated: str | None = None,
    own_step_s: float | None = None,
) -> FrameList:
    """Read a list of frames.

    Lines with names may stand in any order and are sorted by time (a name tells which frame is
    meant); lines without must increase, since their order is that of the frames.

    Parameters
    ----------
    text, label : str
        The list, and the name of its file, for messages.
    time_unit : {'s', 'ms', 'us', 'ns'}, optional
        What the user says of the unit.
    stated, own_step_s
        What else tells of it; see :func:`adv2e.sources.times.units.frame_unit`.

    Raises
    ------
    DataError
        Columns whose meaning is open, a line that is unlike the others or whose time cannot be
        read, a time that occurs twice, times that do not increase, or an empty list; the text names
        the line.
    """
    table = table_of(text, label)
    fields = [line.fields[table.time] for line in table.lines]
    unit = frame_unit(
        [Decimal(field) for field in fields],
        given=time_unit,
        stated=table.unit or stated,
        own_step_s=own_step_s,
    )
    stamps = [_stamp(line, table, unit, label) for line in table.lines]
    order = ""
    if table.name is not None:
        order = _disorder(stamps)
        stamps = sorted(stamps, key=lambda stamp: stamp.t_ns)
    _check_order(stamps, label)
    whole = not any(re.search("[.eE]", field) for field in fields)
    return FrameList(stamps, table.described(unit.name), unit, order, whole)


def _stamp(line: Line, table: Table, unit: Unit, label: str) -> Stamp:
    try:
        t_ns = parse_ns(line.fields[table.time], unit.ns)
    except ValueError as error:
        raise DataError(
            f"{label} line {line.number}: {error}; a time in {unit.name} is expected there"
        ) from error
    return Stamp(t_ns, line.number, _name(line, table))


def _name(line: Line, table: Table) -> str | None:
    return None if table.name is None else line.fields[table.name].replace("\\", "/")


def _disorder(stamps: list[Stamp]) -> str:
    for before, stamp in pairwise(stamps):
        if stamp.t_ns < before.t_ns:
            return f"line {stamp.line} is earlier than one before it: sorted by time"
    return ""


def _check_order(stamps: list[Stamp], label: str) -> None:
    for before, stamp in pairwise(stamps):
        if stamp.t_ns <= before.t_ns:
            raise DataError(
                f"{label} line {stamp.line}: times must increase; {seconds(stamp.t_ns)} s is not"
                f" after the {seconds(before.t_ns)} s of line {before.line}"
            )
