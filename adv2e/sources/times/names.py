"""Which picture a name in a list means.

Lists are written elsewhere, on another system even, and folders are moved.  A name is therefore
matched whole, and where that fails by its end: ``C:/clip/left/0001.png`` is ``left/0001.png`` of
this folder.  Never do two lines take one picture.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from pathlib import Path

from adv2e.errors import DataError
from adv2e.sources.times.instants import Stamp


def parts_of(name: str) -> list[str]:
    """Return the parts of a path as lists have it, from any system; without root and drive."""
    name = re.sub(r"^[A-Za-z]:", "", name.replace("\\", "/"))
    return [part for part in name.split("/") if part not in ("", ".")]


def match(
    stamps: Sequence[Stamp], paths: Sequence[str], label: str, folder: Path
) -> tuple[list[tuple[Stamp, int]], int]:
    """Return which picture each line of a list means, and how many lines mean none of these.

    Where some lines name this folder (``left/0000.png`` for a picture in ``left``), those that name
    another one (``right/0000.png``) mean none.

    Parameters
    ----------
    stamps : sequence of Stamp
        Lines with names.
    paths : sequence of str
        Where the pictures are.
    label : str
        Name of the list, for messages.
    folder : Path
        What the pictures are from, for messages.

    Raises
    ------
    DataError
        A line whose picture is missing, or that means the picture of another line.
    """
    by_name: dict[str, list[int]] = {}
    places = [parts_of(path) for path in paths]
    for number, place in enumerate(places):
        by_name.setdefault(place[-1], []).append(number)
    found = []
    for stamp in stamps:
        parts = [part for part in parts_of(stamp.name or "") if part != ".."]
        alike = [(_common(parts, places[at]), at) for at in by_name.get((parts or [""])[-1], [])]
        most = max((depth for depth, _ in alike), default=0)
        found.append((stamp, parts, most, [at for depth, at in alike if depth == most]))
    here = any(depth > 1 for _, _, depth, _ in found)
    pairs: list[tuple[Stamp, int]] = []
    takers: dict[int, Stamp] = {}
    for stamp, parts, depth, pictures in found:
        if here and len(parts) > 1 and depth < 2 and not _is_in(folder, parts):
            continue
        if len(pictures) != 1:
            what = f"no image {stamp.name}" if not pictures else f"more than one {stamp.name}"
            raise DataError(f"{label} line {stamp.line}: {what} in {folder}")
        other = takers.setdefault(pictures[0], stamp)
        if other is not stamp:
            first, second = sorted((other, stamp), key=lambda one: one.line)
            raise DataError(
                f"{label} line {second.line}: {second.name} is the same picture as {first.name} on"
                f" line {first.line}: there is one {parts[-1]} in {folder}"
            )
        pairs.append((stamp, pictures[0]))
    return pairs, len(stamps) - len(pairs)


def _common(parts: Sequence[str], place: Sequence[str]) -> int:
    """Return how many parts two paths share at their ends."""
    shared = 0
    for mine, theirs in zip(reversed(parts), reversed(place), strict=False):
        if mine != theirs:
            break
        shared += 1
    return shared


def _is_in(folder: Path, parts: Sequence[str]) -> bool:
    return parts[-2] == folder.absolute().name


def member_of(name: str, has: Callable[[str], bool]) -> str | None:
    """Return the file of a folder or zip that a name means, whole or by its end; None: none.

    Parameters
    ----------
    name : str
        Path as a list has it.
    has : callable
        Tells whether there is such a file, from its path below the folder.
    """
    parts: list[str] = []
    for part in parts_of(name):
        if part != "..":
            parts.append(part)
        elif parts:
            parts.pop()
        else:
            return None  # it leads out of the folder
    ends = ("/".join(parts[begin:]) for begin in range(len(parts)))
    return next(filter(has, ends), None)


def nowhere(_: str) -> None:
    """Find no image outside of the folder."""


def members_of(
    stamps: Sequence[Stamp],
    label: str,
    has: Callable[[str], bool],
    *,
    where: str = "",
    outside: Callable[[str], str | None] = nowhere,
) -> list[str]:
    """Return the file that each line of a recording's list means.

    Parameters
    ----------
    stamps : sequence of Stamp
        All of them must have names.
    label : str
        Name of the list, for messages.
    has : callable
        See :func:`member_of`.
    where : str
        What follows "no image NAME" in messages.
    outside : callable
        Returns the file outside that a name means, where these are allowed and there is one.

    Raises
    ------
    DataError
        A line without a name, whose image is missing or outside, or is that of another line.
    """
    members: list[str] = []
    takers: dict[str, Stamp] = {}
    for stamp in stamps:
        if stamp.name is None:
            raise DataError(f"{label} line {stamp.line}: expected 'time name' of an image")
        member = outside(stamp.name) or member_of(stamp.name, has)
        if member is None:
            raise _missing(stamp, label, where)
        other = takers.setdefault(member, stamp)
        if other is not stamp:
            first, second = sorted((other, stamp), key=lambda one: one.line)
            raise DataError(
                f"{label} line {second.line}: {second.name} is the same picture as {first.name} on"
                f" line {first.line}"
            )
        members.append(member)
    return members


def _missing(stamp: Stamp, label: str, where: str) -> DataError:
    name = stamp.name or ""
    if leads_out(name):
        return DataError(
            f"{label} line {stamp.line}: {name} is not in the folder of the list;"
            " --images-anywhere allows that"
        )
    return DataError(f"{label} line {stamp.line}: no image {name}{where}")


def leads_out(name: str) -> bool:
    """Tell whether a name is absolute or climbs out of its folder."""
    if re.match(r"[A-Za-z]:|/|\\", name):
        return True
    depth = 0
    for part in parts_of(name):
        depth += -1 if part == ".." else 1
        if depth < 0:
            return True
    return False


def found_outside(folder: Path) -> Callable[[str], str | None]:
    """Return what finds images that names which lead out of `folder` mean, as a path from it."""

    def outside(name: str) -> str | None:
        return name if leads_out(name) and (folder / name).is_file() else None

    return outside
