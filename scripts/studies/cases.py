"""Cases of the study, and their order, so that a study cut short has some of everything."""

from __future__ import annotations

import random
import sys
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module
from itertools import chain, zip_longest
from pathlib import Path
from typing import Any

REPOSITORY = Path(__file__).parents[2]

# recordings are by the camera of the tests, which shares no code with adv2e
sys.path.append(str(REPOSITORY / "tests"))
camera: Any = import_module("camera")
catalogue: Any = import_module("camera.catalogue")
settings: Any = import_module("camera.settings")
stimulus: Any = import_module("camera.stimulus")

KINDS = ("nothing", "library", "leave-one-out", "outside", "pairs")
NOTHING, LIBRARY, LEFT_OUT, OUTSIDE, PAIRS = KINDS
OWN_PERIOD = "own-period"
"""A kind that is studied where it is asked for: an effect at frames of another rate."""
SMALL, MIDDLE, LARGE = SIZES = catalogue.SIZES
SCENES: tuple[str, ...] = tuple(camera.SCENES)

SAME = (("dark_current", "black_level"), ("leak", "photo_leak"))
"""Effects that are nearly one thing under two keys."""

NO_SIZE = "none"
"""Of recordings with nothing missing."""


@dataclass(frozen=True)
class Case:
    """One recording and what the diagnosis of it may use.

    Attributes
    ----------
    kind : str
        One of ``KINDS``, or ``OWN_PERIOD``.
    effects : tuple of str
        Effects in the recording that are not declared.
    size : str
        One of ``SIZES``; ``none`` without effects.
    repeat : int
        Tells recordings of the same effects apart.
    """

    kind: str
    effects: tuple[str, ...]
    size: str
    repeat: int

    @property
    def key(self) -> str:
        """All four, in words: ``library/refractory/middle/0``."""
        return f"{self.kind}/{'+'.join(self.effects) or 'nothing'}/{self.size}/{self.repeat}"

    @property
    def without(self) -> tuple[str, ...]:
        """Effects that the library is to do without."""
        return self.effects if self.kind == LEFT_OUT else ()

    @property
    def hidden(self) -> dict[str, Any]:
        """Part of the camera's configuration that is not declared."""
        if self.kind == OWN_PERIOD:
            held = [catalogue.with_own_period(name, self.size).hidden for name in self.effects]
            return dict(settings.merged({}, *held))
        parts = chain.from_iterable(catalogue.cases(name, size=self.size) for name in self.effects)
        return dict(settings.merged({}, *(part.hidden for part in parts)))

    def seed(self, study: int) -> int:
        """Return the seed of scene and camera, in the study with the seed `study`."""
        return zlib.crc32(f"{study}/{self.key}".encode()) % 1_000_000

    def scene(self, study: int) -> str:
        """Return the name of the scene, in the study with the seed `study`."""
        return SCENES[zlib.crc32(f"{study}/{self.key}/scene".encode()) % len(SCENES)]


@dataclass(frozen=True)
class Plan:
    """Which cases a study has.

    Attributes
    ----------
    kinds, sizes : sequence of str
    library : sequence of str
        Effects that both the camera and adv2e have.
    only : sequence of str
        Effects that are wanted; none: all.
    repeats, nothing : int
        Recordings of each set of effects, and of the camera just as declared.
    seed : int
    """

    kinds: Sequence[str]
    sizes: Sequence[str]
    library: Sequence[str]
    only: Sequence[str] = ()
    repeats: int = 1
    nothing: int = 100
    seed: int = 0

    def cases(self) -> list[Case]:
        """Return the cases: kind after kind in turn, all of the middle size before the others."""
        quiet = iter(self._queue(NOTHING, NO_SIZE) if NOTHING in self.kinds else [])
        found: list[Case] = []
        for sizes in ((MIDDLE,), (SMALL, LARGE)):
            queues = [
                self._queue(kind, size)
                for size in sizes
                if size in self.sizes
                for kind in self.kinds
                if kind != NOTHING
            ]
            for row in zip_longest(*queues):
                turn = (next(quiet, None), *row)
                found += [case for case in turn if case is not None]
        return [*found, *quiet]

    def _queue(self, kind: str, size: str) -> list[Case]:
        """Return the cases of one kind and size, effects in random order, again and again."""
        if kind == NOTHING:
            return [Case(kind, (), size, number) for number in range(self.nothing)]
        sets = self._sets(kind)
        return [Case(kind, names, size, k) for k in range(self.repeats) for names in sets]

    def _sets(self, kind: str) -> list[tuple[str, ...]]:
        """Return the effects of each recording of a kind, those that are wanted."""
        table = {OUTSIDE: catalogue.OUTSIDE, OWN_PERIOD: catalogue.OWN_PERIOD}
        names = list(table.get(kind, self.library))
        random.Random(f"{self.seed}/{kind}").shuffle(names)
        sets = pairs(names) if kind == PAIRS else [(name,) for name in names]
        return [one for one in sets if not self.only or set(one) & set(self.only)]


def pairs(names: Sequence[str]) -> list[tuple[str, ...]]:
    """Return pairs of different things, every name in two of them."""
    alike = [set(one) for one in SAME]
    both = zip(names, [*names[1:], *names[:1]], strict=True)
    return [pair for pair in both if set(pair) not in alike and len(set(pair)) == 2]


def shard(cases: Sequence[Case], number: int, count: int) -> list[Case]:
    """Return every `count`-th case from the `number`-th on, counted from 1."""
    return list(cases[number - 1 :: count])
