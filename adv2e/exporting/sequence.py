"""One recording on its way into an export: opened, named, and read as often as needed."""

from __future__ import annotations

import hashlib
import os
from collections import Counter
from collections.abc import Iterator
from collections.abc import Sequence as Many
from dataclasses import dataclass, field
from functools import cached_property, partial
from pathlib import Path
from typing import Any

from adv2e.conversion.transfer import clock_of, side_of
from adv2e.errors import DataError, UsageError
from adv2e.exporting.targets import Targets, targets_of
from adv2e.files.regular import beside
from adv2e.formats.event_file import EventFile
from adv2e.formats.reading import open_events, shots_of
from adv2e.formats.registry import may_hold_events
from adv2e.side.carrying import SideData

TRAIN, VALID, TEST = "train", "valid", "test"
_SPLITS = {
    **dict.fromkeys(("train", "training"), TRAIN),
    **dict.fromkeys(("val", "valid", "validation"), VALID),
    **dict.fromkeys(("test", "testing"), TEST),
}
"""Names of folders that divide a set."""

MADE_BY_US = ("export.json", "files.csv")
"""Files of folders that are exports, in which no recordings are looked for."""

_TEXTS = (".txt", ".csv")


@dataclass(frozen=True)
class Sequence:
    """A recording, and what it is called in the export.

    Attributes
    ----------
    name : str
        Of a tree, its path below the folder without suffix, with ``/``.
    given : Targets, optional
        Boxes and flow in place of those of its side data.
    side_given : str or Path, optional
        Where its side data are.
    told : list of str
        Lines for people on its side data.
    """

    name: str
    file: EventFile
    given: Targets | None = field(default=None, compare=False)
    side_given: str | Path | None = None
    told: list[str] = field(default_factory=list, compare=False)

    @cached_property
    def image_times_us(self) -> list[int]:
        """Times of its images [us]; DataError if it has none."""
        if self.file.shots is None:
            path = self.file.facts.path
            raise DataError(f"{path}: holds no images; 'adv2e convert --with-frames' stores them")
        return [(shot.t_ns + 500) // 1000 for shot in shots_of(self.file)]

    @cached_property
    def targets(self) -> Targets:
        """Boxes and flow: those that were given, as they are, or of its side data.

        Raises
        ------
        DataError
            They are not of the recording; or they were given, and its events are cut or turned.
        """
        facts = self.file.facts
        asked = {"--crop": facts.selection.crop, "--rotate180": facts.selection.rotate180}
        for option in (name for name, value in asked.items() if value and self.given):
            raise DataError(f"{facts.path}: {option} does not change targets that are given")
        return self.given or targets_of(self.side, partial(clock_of, self.file))

    @cached_property
    def side(self) -> SideData | None:
        """Its side data, once its events were asked for in order; what is not carried is told."""
        return side_of(self.file, self.side_given, self.told.append)

    @property
    def flat(self) -> str:
        """Its name without folders."""
        return self.name.replace("/", "_")

    @property
    def split(self) -> str | None:
        """Part of the set that the first folder of its name says, if it does."""
        return split_of(self.name)


def split_of(name: str) -> str | None:
    """Return the part of a set that the first folder of a name says; None: none does."""
    first, slash, _ = name.partition("/")
    return _SPLITS.get(first.casefold()) if slash else None


def is_held_out(name: str, share: float) -> bool:
    """Tell whether a recording is held out: by its name alone, so that others change nothing."""
    digest = hashlib.sha256(name.encode("utf-8", "surrogateescape")).digest()
    return int.from_bytes(digest[:6], "big") < share * 2**48


def in_class(name: str) -> tuple[str, str]:
    """Return the class of a recording, the folder that it is in, and its own name in that.

    Raises
    ------
    DataError
        It is in no folder.
    """
    _, _, rest = name.partition("/") if split_of(name) else ("", "", name)
    label, slash, own = rest.partition("/")
    if not slash:
        raise DataError(
            f"{name}: is in no folder named after its class: export the folder that holds those of"
            " all classes"
        )
    return label, own.replace("/", "_")


def open_sequences(
    paths: Many[str | Path],
    targets: Many[Targets] | None = None,
    side: str | Path | None = None,
    **reading: Any,
) -> list[Sequence]:
    """Open recordings; each is called as its file, or as its folder and its file.

    One folder that is no recording is a tree: all recordings below it, called by their paths.

    `reading` as :func:`adv2e.formats.reading.open_events` takes it; `targets` are those of each,
    in the place of what lies beside them, which `side` tells.

    Raises
    ------
    UsageError, DataError
        Two have one name, there is no recording in a tree, or one cannot be read.
    """
    found = named_paths(paths)
    if targets is not None and len(targets) != len(found):
        raise UsageError(f"targets: {len(targets)} for {len(found)} recordings")
    each: Many[Targets | None] = targets or [None] * len(found)
    return [
        Sequence(name, open_events(path, **reading), given, side)
        for (name, path), given in zip(found, each, strict=True)
    ]


def named_paths(paths: Many[str | Path]) -> list[tuple[str, Path]]:
    """Return names and paths of recordings; parameters and errors as :func:`open_sequences`."""
    found = [Path(path) for path in paths]
    if is_tree(found):
        (root,) = found
        found = list(_below(root))
        if not found:
            raise DataError(f"{root}: holds no recordings or files of events")
        names = [_stem(path, path.relative_to(root).as_posix()) for path in found]
    else:
        names = _names(found)
    check_once(names)
    return list(zip(names, found, strict=True))


def is_tree(paths: Many[Path]) -> bool:
    """Tell whether inputs are a tree of recordings: one folder, which is none itself."""
    return len(paths) == 1 and paths[0].is_dir() and not may_hold_events(paths[0])


def _below(root: Path) -> Iterator[Path]:
    """Yield the recordings below a folder; exports, hidden files and side data do not count."""
    for place, folders, names in os.walk(root):
        here = Path(place)
        folders.sort()
        if any(name in names for name in MADE_BY_US):
            folders.clear()
            continue
        recordings = [name for name in folders if may_hold_events(here / name)]
        folders[:] = [
            name
            for name in folders
            if name not in recordings and not name.startswith(".") and not name.endswith(".side")
        ]
        for name in sorted([*recordings, *names]):
            path = here / name
            # a text may be anything, but one with its description is ours
            is_text = path.suffix.lower() in _TEXTS and not beside(path, ".json").is_file()
            is_other = name.startswith(".") or name.endswith(("_bbox.npy", ".causes.txt"))
            if not is_text and not is_other and may_hold_events(path):
                yield path


def _names(paths: list[Path]) -> list[str]:
    names = [_stem(path, path.resolve().name) for path in paths]
    often = Counter(names)
    return [
        f"{path.resolve().parent.name}_{name}" if often[name] > 1 else name
        for path, name in zip(paths, names, strict=True)
    ]


def check_once(names: list[str]) -> None:
    """Raise UsageError if two recordings would lie in one place."""
    twice = [name for name, number in Counter(names).items() if number > 1]
    if twice:
        raise UsageError(f"two inputs are called {twice[0]}: rename one, or export them one by one")


def _stem(path: Path, name: str) -> str:
    return name.removesuffix(path.suffix).removesuffix(".events") or name
