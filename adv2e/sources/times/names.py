"""Pictures by the names in a list.

Lists are written elsewhere, on another system even, and folders are moved.  A name is therefore
matched whole, and where that fails by its end: ``C:/clip/left/0001.png`` is ``left/0001.png`` or
``0001.png`` of this folder.  Never do two lines take one picture.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from unicodedata import normalize

from adv2e.errors import DataError
from adv2e.sources.times.instants import Stamp


def member_of(name: str, has: Callable[[str], bool]) -> str | None:
    """Return the file of a folder or zip that a name means, whole or by its end; None: none.

    `name` is a path as a list has it, from any system; `has` tells whether there is such a file,
    from its path below the folder.
    """
    parts: list[str] = []
    for part in re.sub(r"^[A-Za-z]:", "", name.replace("\\", "/")).split("/"):
        if part == "..":
            del parts[-1:]
        elif part not in ("", "."):
            parts.append(part)
    ends = ["/".join(parts[begin:]) for begin in range(len(parts))]
    # systems differ in how they store letters with accents
    forms = (normalize(form, end) for form in ("NFC", "NFD") for end in ends)
    return next(filter(has, (*ends, *forms)), None)


def members_of(
    stamps: Sequence[Stamp], label: str, has: Callable[[str], bool], *, where: str = ""
) -> list[str]:
    """Return the file that each line of the list `label` means; never one outside its folder.

    `has` is as in :func:`member_of`; `where` follows "no image NAME" in messages.

    Raises
    ------
    DataError
        A line without a name, or whose image is missing, or is that of another line.
    """
    takers: dict[str, Stamp] = {}
    for stamp in stamps:
        if stamp.name is None:
            raise DataError(f"{label} line {stamp.line}: expected 'time name' of an image")
        member = member_of(stamp.name, has)
        if member is None:
            raise DataError(f"{label} line {stamp.line}: no image {stamp.name}{where}")
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
