"""Which picture a name in a list means.

Lists are written elsewhere, on another system even, and folders are moved.  A name is therefore
matched whole, and where that fails by its end: ``C:/clip/left/0001.png`` is ``left/0001.png`` or
``0001.png`` of this folder.  Never do two lines take one picture.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from pathlib import Path

from adv2e.errors import DataError
from adv2e.sources.times.instants import Stamp


def member_of(name: str, has: Callable[[str], bool]) -> str | None:
    """Return the file of a folder or zip that a name means, whole or by its end; None: none.

    `name` is a path as a list has it, from any system; `has` tells whether there is such a file,
    from its path below the folder.
    """
    parts: list[str] = []
    for part in _parts(name):
        if part != "..":
            parts.append(part)
        elif parts:
            parts.pop()
    ends = ("/".join(parts[begin:]) for begin in range(len(parts)))
    return next(filter(has, ends), None)


def _parts(name: str) -> list[str]:
    """Return the parts of a path, without root and drive."""
    name = re.sub(r"^[A-Za-z]:", "", name.replace("\\", "/"))
    return [part for part in name.split("/") if part not in ("", ".")]


def members_of(
    stamps: Sequence[Stamp],
    label: str,
    has: Callable[[str], bool],
    *,
    where: str = "",
    folder: Path | None = None,
    anywhere: bool = False,
) -> list[str]:
    """Return the file that each line of the list `label` means.

    Parameters
    ----------
    stamps, label, has
        Lines that must have names, the list, and what :func:`member_of` asks.
    where : str
        What follows "no image NAME" in messages.
    folder : Path, optional
        That of the list, which names may lead out of; `anywhere`: those that do are taken.

    Raises
    ------
    DataError
        A line without a name, whose image is missing or outside, or is that of another line.
    """
    takers: dict[str, Stamp] = {}
    for stamp in stamps:
        name = stamp.name
        if name is None:
            raise DataError(f"{label} line {stamp.line}: expected 'time name' of an image")
        out = folder is not None and leads_out(name)
        member = member_of(name, has)
        if out and anywhere and folder is not None and (folder / name).is_file():
            member = name
        if member is None:
            hint = " is not in the folder of the list; --images-anywhere allows that"
            missing = f"{name}{hint}" if out else f"no image {name}{where}"
            raise DataError(f"{label} line {stamp.line}: {missing}")
        other = takers.setdefault(member, stamp)
        if other is not stamp:
            first, second = sorted((other, stamp), key=lambda one: one.line)
            raise DataError(
                f"{label} line {second.line}: {second.name} is the same picture as {first.name} on"
                f" line {first.line}"
            )
    return list(takers)


def match(stamps: Sequence[Stamp], paths: Sequence[str], label: str, where: str) -> list[int]:
    """Return the number of the picture that each line means, of pictures at the paths given.

    The last parts of the paths are enough where no two are the same.  See :func:`members_of`.
    """
    lasts = [path.rpartition("/")[2] for path in paths]
    unlike = len(set(lasts)) == len(lasts)
    numbers = {path: n for n, path in enumerate(lasts if unlike else paths)}
    members = members_of(stamps, label, numbers.__contains__, where=where)
    return [numbers[member] for member in members]


def leads_out(name: str) -> bool:
    """Tell whether a name is absolute or climbs out of its folder."""
    if re.match(r"[A-Za-z]:|/|\\", name):
        return True
    depth = 0
    for part in _parts(name):
        depth += -1 if part == ".." else 1
        if depth < 0:
            return True
    return False
