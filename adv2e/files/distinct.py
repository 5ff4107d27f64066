"""Outputs and inputs are to be different files, by whatever names they go."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path

from adv2e.errors import OutputError


def check_distinct(output: str | Path, inputs: Iterable[str | Path]) -> None:
    """Refuse to write where something is read from, whether it may be replaced or not.

    Parameters
    ----------
    output : str or Path
    inputs : iterable of str or Path
        All files that are read, and folders; names of nothing do not matter.

    Raises
    ------
    OutputError
        `output` is one of them, or a folder that holds one.
    """
    final = Path(output)
    if not os.path.lexists(final):
        return
    within = final.resolve() if final.is_dir() else None
    for one in map(Path, inputs):
        if are_one(final, one):
            raise OutputError(f"{output}: is read and would be lost; choose another name")
        if within is not None and within in one.resolve().parents and one.exists():
            raise OutputError(f"{output}: holds the input {one}; choose another name")


def are_one(one: Path, other: Path) -> bool:
    """Tell whether two names lead to one file, also where upper and lower case are the same."""
    if os.path.normcase(one) == os.path.normcase(other):
        return True
    try:
        return one.samefile(other)
    except OSError:
        return False
