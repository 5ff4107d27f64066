"""Poses, measurements of an IMU, and exposures: text with a line for each time.

======================= ===================================== ==================================
written                 a line of it                          read of
======================= ===================================== ==================================
``groundtruth.txt``     ``t px py pz qx qy qz qw``            TUM RGB-D, EuRoC, UZH-FPV, DAVIS240C
``imu.txt``             ``t ax ay az gx gy gz``               EuRoC, UZH-FPV, DAVIS240C
``accelerometer.txt``   ``t ax ay az``                        TUM RGB-D
``exposures.txt``       ``start end`` of each frame           DSEC
======================= ===================================== ==================================

Times are written in seconds with nine decimals; all other numbers stay as they were written.  A
heading tells the columns, as EuRoC (quaternions from w on) and UZH-FPV (rates before
accelerations) have one; without, they are those above.  Poses and measurements are those of the
rig: they do not turn with the frames.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from decimal import Decimal

import numpy as np

from adv2e.errors import DataError
from adv2e.label import Line, guessed, left_out, told_of
from adv2e.side.placement import Clock, Placement
from adv2e.sources.times.rates import NUMBER, SETTLED, UNITS, frame_unit, nine_decimals, parse_ns

COLUMNS = {
    "poses": ("t", "px", "py", "pz", "qx", "qy", "qz", "qw"),
    "imu": ("t", "ax", "ay", "az", "gx", "gy", "gz"),
    "accelerometer": ("t", "ax", "ay", "az"),
    "exposures": ("t", "end"),
}
"""Columns that are written of each kind."""

_ROLES = {
    "t": r"()t|()ts|()time.*|()stamp.*|()(?:exposure_?)?start.*",
    "end": r"()(?:exposure_?)?end.*",
    "g": r"(?:ang|gyr|omega|w_|g)\w*?_?([xyz])",
    "a": r"(?:lin|acc|a)\w*?_?([xyz])",
    "q": r"q\w*?_?([xyzw])",
    "p": r"(?:p\w*?_?|t_?)?([xyz])",
}

_COUNTS = re.compile(r"\W*(id|n|no|count|index|seq\w*)", re.IGNORECASE)
"""Columns that count the lines."""


@dataclass(frozen=True)
class Table:
    """Lines with times.

    Attributes
    ----------
    kind, label : str
        One of :data:`COLUMNS`, and the file.
    times : list of tuple of int
        One of each line, or, of exposures, two [ns].
    values : list of str
        The rest of each line.
    told : list of str
        What is to be told of it.
    """

    kind: str
    label: str
    times: list[tuple[int, ...]]
    values: list[str]
    told: list[str]

    def written(self, place: Placement, clock: Clock) -> Iterator[tuple[str, bytes]]:
        """Yield name and bytes of the lines that are wanted, on the clock of the events.

        Raises
        ------
        DataError
            None is wanted.
        """
        pairs = [clock.of(column) for column in np.array(self.times, np.int64).T]
        wanted = np.all([inside for _, inside in pairs], axis=0)
        stamps = zip(*(times.tolist() for times, _ in pairs), strict=True)
        lines = "".join(
            " ".join([*map(nine_decimals, times), *filter(None, [rest])]) + "\n"
            for times, rest, is_in in zip(stamps, self.values, wanted, strict=True)
            if is_in
        )
        if not lines:
            raise DataError(f"{self.label}: none of its times is in the part that is converted")
        name = "groundtruth" if self.kind == "poses" else self.kind
        yield f"{name}.txt", lines.encode()


def parse_table(text: str, label: str, kind: str) -> Table:
    """Read a table of a kind: one of :data:`COLUMNS`.

    Raises
    ------
    DataError
        Columns or times cannot be told, a line is unlike the others, or there is none; the text
        names the line.
    """
    lines = [(n, line.strip()) for n, line in enumerate(text.splitlines(), 1) if line.strip()]
    body = [(n, _fields(line)) for n, line in lines if NUMBER.fullmatch(_fields(line)[0])]
    if not body:
        raise DataError(f"{label}: no lines of numbers in it")
    width = len(body[0][1])
    heads = [line for n, line in lines if n < body[0][0]]
    columns, names = _columns(heads, width, kind, label)
    for number, fields in body:
        if len(fields) != width or not all(map(NUMBER.fullmatch, fields)):
            raise DataError(f"{label} line {number}: must be {width} numbers, as those before it")
    clocks = 2 if kind == "exposures" else 1
    stated = _unit(heads, names, columns[0])
    unit, told = unit_of([fields[columns[0]] for _, fields in body], stated, label)
    times, values = [], []
    for number, fields in body:
        try:
            times.append(tuple(parse_ns(fields[at], unit) for at in columns[:clocks]))
        except ValueError as error:
            raise DataError(f"{label} line {number}: {error}") from None
        values.append(" ".join(fields[at] for at in columns[clocks:]))
    left = [word for at, word in enumerate(names) if at not in columns]
    left = [re.sub(r"\[.*", "", word) for word in left if not _COUNTS.fullmatch(word)]
    if left:
        line = f"columns that are not carried: {', '.join(left)}"
        told.append(told_of(label, left_out(line, f"{kind}: {line}")))
    return Table(kind, label, times, values, told)


def unit_of(times: Sequence[str], stated: str | None, label: str) -> tuple[int, list[str]]:
    """Return the unit of times as they are written [ns], and what is doubtful of it, in lines.

    Data sets that write parts of a number mean seconds.
    """
    if stated is not None or any("." in time for time in times):
        return UNITS[stated or "s"], []
    unit = frame_unit(list(map(Decimal, times)))
    how = "a heading such as 'time [ns]' settles it"
    doubt = unit.doubt.replace(SETTLED, how)
    told = guessed(doubt, "time unit", unit.name, how) if isinstance(unit.doubt, Line) else doubt
    return unit.ns, [told_of(label, told)] if doubt else []


def _fields(line: str) -> list[str]:
    return re.split(r"[,;\s]+", line.rstrip(",; "))


def _unit(heads: Sequence[str], names: Sequence[str], time: int) -> str | None:
    """Return the unit that the word for the times states, or else a comment of it alone."""
    word = names[time] if names else ""
    found = re.search(r"[\[(_ ](ns|us|ms|s)\b", word) or re.search(
        r"\[(ns|us|ms|s)\]", " ".join(heads).split("]")[0] + "]"
    )
    return found[1] if found and found[1] in UNITS else None


def _columns(
    heads: Sequence[str], width: int, kind: str, label: str
) -> tuple[list[int], list[str]]:
    """Return where the columns of a kind are, and what a heading calls all."""
    wanted = COLUMNS[kind]
    for head in reversed(heads):
        bound = re.sub(r"\s+(?=[(\[])", "", head.lstrip("#% "))
        bound = re.sub(r"(\[[^\]]*\])", lambda unit: unit[0].replace(" ", "."), bound)
        words = _fields(bound)
        roles = [_role(word) for word in words]
        if len(words) == width and set(wanted) <= set(roles):
            return [roles.index(one) for one in wanted], words
    if width == len(wanted) and not any(
        len(_fields(head.lstrip("#% "))) == width for head in heads
    ):
        return list(range(width)), []
    raise DataError(
        f"{label}: {width} columns that no heading tells: must be {' '.join(wanted)}, or have a"
        " heading with these words"
    )


def _role(word: str) -> str:
    """Return the column that a word of a heading stands for; "" for others."""
    bare = re.sub(r"[\[(].*", "", word).strip("#% \"'").lower()
    for role, form in _ROLES.items():
        if found := re.fullmatch(form, bare):
            return role + next(filter(None, found.groups()), "")
    return ""
