"""Outputs and inputs are to be different files, by whatever names they go."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path

from adv2e.errors import OutputError

_LISTS = (
    *("images.txt", "timestamps.txt", "info.txt", "rgb.txt", "depth.txt", "left_images.txt"),
    *("right_images.txt", "data.csv", "cam0/data.csv", "mav0/cam0/data.csv"),
)
_OF_RECORDINGS = ("events.txt", "adv2e.json")
_PICTURES = (
    *(".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".webp", ".hdr", ".exr"),
    *(".pbm", ".pgm", ".ppm", ".pnm", ".pam", ".pfm", ".jp2", ".avif", ".heic", ".heif"),
)


def check_distinct(output: str | Path, inputs: Iterable[str | Path]) -> None:
    """Refuse to write where something is read from, whether it may be replaced or not.

    Parameters
    ----------
    output : str or Path
    inputs : iterable of str or Path
        Files, and folders of images or recordings: what is read from beside or within them, too.

    Raises
    ------
    OutputError
        `output` is one of them, or a folder that holds one.
    """
    final = Path(output).resolve()
    for one in inputs:
        there = Path(one).resolve()
        if are_one(final, there):
            raise OutputError(f"{output}: is the input, which would be lost; choose another name")
        if final in there.parents and final.is_dir():
            raise OutputError(f"{output}: holds the input {one}; choose another name")
        if os.path.lexists(final) and _is_read_with(Path(one), final):
            raise OutputError(
                f"{output}: is read with the input {one} and would be lost; choose another name"
            )


def _is_read_with(path: Path, final: Path) -> bool:
    """Tell whether the file `final` may be read where `path` is given."""
    above = path.absolute().parent
    if not path.is_dir():
        beside = [f"{path.name}.json", f"{path.stem}_ts.npy", f"{path.stem}.timestamps.txt"]
        if path.suffix == ".txt":
            beside += [*_LISTS, *_OF_RECORDINGS]
        return any(are_one(final, path.with_name(name)) for name in beside)
    lists = [*(path / name for name in (*_LISTS, *_OF_RECORDINGS)), *(above / n for n in _LISTS)]
    if any(are_one(final, file) for file in lists):
        return True
    pictures = (file for file in path.rglob("*") if file.suffix.lower() in _PICTURES)
    found = next((file for file in pictures if are_one(final, file)), None)
    if found is None or found.parent != path or not (path / _LISTS[0]).is_file():
        return found is not None
    # beside those of a recording may be one that was made of it
    return os.fsencode(found.name) in (path / _LISTS[0]).read_bytes()


def are_one(one: Path, other: Path) -> bool:
    """Tell whether two names lead to one file, also where upper and lower case are the same."""
    if os.path.normcase(one) == os.path.normcase(other):
        return True
    try:
        return one.samefile(other)
    except OSError:
        return False
