"""Sequences below a folder, each of which is one conversion.

==============  =================================================================================
layout          what counts
==============  =================================================================================
``videos``      files that are opened as video
``gopro``       folders of GOPRO_Large and GOPRO_Large_all; of one with several kinds, ``sharp``
``ddd17``       HDF5 of DDD17 and DDD20
``davis240c``   recordings of DAVIS240C: folders and zips with ``images.txt``
``images``      folders of two pictures or more with a list of their times, or any with ``fps``
``auto``        all of these, and what else holds frames and their times: AEDAT4, bags of ROS,
                AEDAT-2, stacks in ``.npy``, TIFFs of several pages
==============  =================================================================================

Pictures that lie beside other sequences are no frames.  What looks like frames or events and is no
sequence is passed over, and told with the reason.

The name of a sequence is its path below the folder, without its suffix, unless two would be called
the same.  Hidden files and folders do not count, and links to folders are not followed, so that
nothing is found twice or for ever.
"""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from adv2e.errors import DataError
from adv2e.files.zips import Members
from adv2e.formats.registry import format_of, may_hold_events
from adv2e.formats.writing import SIDE
from adv2e.sources import VIDEO_SUFFIXES, open_source
from adv2e.sources.davis240c import is_recording
from adv2e.sources.gopro import find_sequence
from adv2e.sources.images.opencv import IMAGE_SUFFIXES
from adv2e.sources.images.source import LISTS, UNREAD, found_list, natural_key
from adv2e.sources.images.stack import Pages
from adv2e.sources.times.rates import Rate

_DDD = ("ddd", "ddd20")
_PAGES = (".tif", ".tiff")
_TEXTS = (".txt", ".csv")
"""Of events, perhaps, and of much else."""


@dataclass(frozen=True)
class Sequence:
    """Source of one conversion: a file or folder below the folder that was searched.

    Attributes
    ----------
    name : str
        Path below the folder that was searched, with ``/``.
    source : Path
        File or folder.
    layout : str
        Which of :data:`adv2e.options.LAYOUTS` it was found as; ``auto`` for others.
    """

    name: str
    source: Path
    layout: str


@dataclass(frozen=True)
class Found:
    """Sequences in natural order of their names; what was passed over, by the reason."""

    sequences: list[Sequence]
    passed: dict[str, list[Path]]

    def told(self) -> list[str]:
        """Return lines on skipped files and folders, one for each reason."""
        lines = []
        for why, paths in self.passed.items():
            more = f" and {len(paths) - 1:,} more" if len(paths) > 1 else ""
            lines.append(f"passed over: {paths[0]}{more}: {why}")
        return lines


def find_sequences(
    root: Path,
    layout: str = "auto",
    *,
    leave_out: Path | None = None,
    fps: Rate | None = None,
    stills: bool = False,
) -> Found:
    """Return the sequences below a folder; or that of a file.

    Parameters
    ----------
    root : Path
        Folder, or a single file.
    layout : str
        One of :data:`adv2e.options.LAYOUTS`.
    leave_out : Path, optional
        Folder in which nothing is looked for: that of the results.
    fps : float, Fraction or str, optional
        All frames are at this rate: sequences need no times of their own.
    stills : bool
        Each picture is a sequence, and nothing else is.

    Raises
    ------
    DataError
        There is no such file or folder, it cannot be read, or nothing in it counts.
    """
    if not root.exists():
        raise DataError(f"{root}: no such file or folder")
    avoided = None if leave_out is None else leave_out.resolve()
    walk = _Walk(avoided, fps, stills)
    seen = list(walk.below(root))
    if (root, "images") in seen and len(seen) > 1:
        seen.remove((root, "images"))
        walk.passed.setdefault("pictures beside sequences", []).append(root)
    found = [(path, kind) for path, kind in seen if layout in ("auto", kind)]
    passed = walk.passed if layout in ("auto", "images") else {}
    for path, kind in seen:
        if layout not in ("auto", kind):
            passed.setdefault(f"--layout {kind} takes that", []).append(path)
    names = _names(root, [path for path, _ in found])
    sequences = [
        Sequence(name, path, kind) for name, (path, kind) in zip(names, found, strict=True)
    ]
    result = Found(sorted(sequences, key=lambda one: natural_key(one.name)), passed)
    if not sequences:
        nothing = f"holds no sequence of the layout {layout}"
        if stills:
            nothing = "holds no picture, before which --motion moves"
        elif layout == "auto":
            nothing = "holds no video, and no recording or folder with frames and their times"
        raise DataError("; ".join([f"{root}: {nothing}", *result.told()]))
    return result


class _Walk:
    """A walk through folders, which finds sequences and notes what it passes over."""

    def __init__(self, avoided: Path | None, fps: Rate | None, stills: bool) -> None:
        self._avoided, self._fps, self._stills = avoided, fps, stills
        self.passed: dict[str, list[Path]] = {}

    def below(self, root: Path) -> Iterator[tuple[Path, str]]:
        """Yield each sequence with its layout; in recordings, nothing is looked for."""

        def fail(error: OSError) -> None:
            raise DataError(f"{error.filename}: {error.strerror}") from error

        if root.is_file():
            yield from self._in_files([root])
            return
        for place, folders, names in os.walk(root, onerror=fail):
            here = Path(place)
            if not self._stills and (kind := _kind_of_folder(here)):
                folders.clear()
                yield here, kind
                continue
            folders[:] = sorted(
                one
                for one in folders
                if not (one.startswith(".") or one.endswith(SIDE))
                and (self._avoided is None or (here / one).resolve() != self._avoided)
            )
            shown = sorted(name for name in names if not name.startswith("."))
            if self._stills:
                yield from self._in_files([here / name for name in shown])
                continue
            images = [name for name in shown if _suffix(name) in IMAGE_SUFFIXES]
            pages = [name for name in images if _suffix(name) in _PAGES]
            if pages and _is_stack(here / pages[0]):
                images = [name for name in images if name not in pages]
            rest = (here / name for name in sorted(set(shown) - set(images)))
            beside = list(self._in_files([file for file in rest if file.is_file()]))
            yield from beside
            if not beside and not images and any(_suffix(name) in UNREAD for name in shown):
                self.passed.setdefault("pictures of a kind that is not read", []).append(here)
            if why := self._against(here, len(images), is_beside=bool(beside)):
                self.passed.setdefault(why, []).append(here)
            elif images:
                if found_list(here):  # would be that of folders in it, too
                    folders.clear()
                yield here, "images"

    def _against(self, folder: Path, images: int, *, is_beside: bool) -> str:
        if images == 0:
            return ""
        if is_beside:
            return "pictures beside sequences"
        if images == 1:
            return "a single picture"
        if self._fps is None and not found_list(folder):
            return f"pictures without times: give --fps F, or put one of {', '.join(LISTS)} there"
        return ""

    def _in_files(self, files: list[Path]) -> Iterator[tuple[Path, str]]:
        for file in files:
            kind, why = self._kind_of_file(file)
            if kind:
                yield file, kind
            elif why:
                self.passed.setdefault(why.removeprefix(f"{file}: "), []).append(file)

    def _kind_of_file(self, path: Path) -> tuple[str, str]:
        """Return the layout of a file, or why it has none: "" of one that nobody would take."""
        suffix = path.suffix.lower()
        if self._stills:
            return ("auto", "") if suffix in IMAGE_SUFFIXES else ("", "no picture to move before")
        if suffix in VIDEO_SUFFIXES:
            return "videos", ""
        if suffix in (".npy", *_PAGES):
            if path.stem.endswith("_ts"):  # times of a stack
                return "", ""
            try:
                open_source(path, fps=self._fps)
            except DataError as error:
                return "", str(error)
            return "auto", ""
        if not may_hold_events(path):
            return "", ""
        try:
            found = format_of(path)
        except DataError as error:
            return "", str(error)
        if found.name in _DDD:
            return "ddd17", ""
        if found.is_davis240c:
            return "davis240c", ""
        if found.is_camera and "r" in found.frames:
            return "auto", ""
        return "", "" if suffix in _TEXTS else "events, which are not simulated"


def _is_stack(path: Path) -> bool:
    try:
        return len(Pages(path)) > 1
    except DataError:
        return False


def _suffix(name: str) -> str:
    return Path(name).suffix.lower()


def _kind_of_folder(path: Path) -> str:
    if _is_recording(path):
        return "davis240c"
    if find_sequence(path):
        return "gopro"
    is_bag = may_hold_events(path) and "r" in format_of(path).frames
    return "auto" if is_bag else ""


def _is_recording(path: Path) -> bool:
    try:
        return is_recording(Members(path))
    except DataError:  # what is wrong with its list is told when it is converted
        return True


def _names(root: Path, paths: list[Path]) -> list[str]:
    """Return a name for each, none of them twice, whatever the system holds for the same."""
    named = root if root.name.strip(".") else root.resolve()  # "." has no name
    alone = [PurePosixPath(named.name)] if paths == [root] else []
    whole = alone or [PurePosixPath(path.relative_to(root).as_posix()) for path in paths]
    short = [
        name if path.is_dir() else name.with_suffix("")
        for name, path in zip(whole, paths, strict=True)
    ]
    count = Counter(str(name).casefold() for name in short)
    return [
        str(full if count[str(name).casefold()] > 1 else name)
        for full, name in zip(whole, short, strict=True)
    ]
