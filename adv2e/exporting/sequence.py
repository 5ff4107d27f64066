"""One recording on its way into an export: opened, named, and read as often as needed."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence as Many
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from adv2e.errors import DataError, UsageError
from adv2e.formats.event_file import EventFile
from adv2e.formats.reading import open_events, shots_of


@dataclass(frozen=True)
class Sequence:
    """A recording, and what it is called in the export."""

    name: str
    file: EventFile

    @cached_property
    def image_times_us(self) -> list[int]:
        """Times of its images [us]; DataError if it has none."""
        if self.file.shots is None:
            path = self.file.facts.path
            raise DataError(f"{path}: holds no images; 'adv2e convert --with-frames' stores them")
        return [(shot.t_ns + 500) // 1000 for shot in shots_of(self.file)]


def open_sequences(paths: Many[str | Path], **reading: Any) -> list[Sequence]:
    """Open recordings; each is called as its file, or as its folder and its file.

    `reading` as :func:`adv2e.formats.reading.open_events` takes it.
    """
    return [
        Sequence(name, open_events(path, **reading))
        for name, path in zip(_names([Path(path) for path in paths]), paths, strict=True)
    ]


def _names(paths: list[Path]) -> list[str]:
    names = [_stem(path) for path in paths]
    often = Counter(names)
    names = [
        f"{path.resolve().parent.name}_{name}" if often[name] > 1 else name
        for path, name in zip(paths, names, strict=True)
    ]
    twice = [name for name, number in Counter(names).items() if number > 1]
    if twice:
        raise UsageError(f"two inputs are called {twice[0]}: rename one, or export them one by one")
    return names


def _stem(path: Path) -> str:
    name = path.resolve().name
    return name.removesuffix(path.suffix).removesuffix(".events") or name
