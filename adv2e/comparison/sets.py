"""Sets of recordings: which ones a folder or a pattern holds, their pairs, and their comparison."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from adv2e.comparison.features import described, features
from adv2e.comparison.two_samples import (
    HALVES,
    PARTS,
    RECORDINGS,
    Floor,
    Samples,
    between_halves,
    report,
)
from adv2e.errors import DataError
from adv2e.events import Window
from adv2e.formats.recording import Recording
from adv2e.formats.registry import may_hold_events

LEAST = 10
"""Recordings that a set needs."""

Stream = str | Path | Recording
Read = Callable[[Stream], Recording]
"""Returns a recording, from a file if it is not there yet."""


def members(given: Stream | Sequence[Stream]) -> list[Stream] | None:
    """Return the recordings of a set, None if it is a single one.

    A set is a sequence of recordings, a folder that is no recording itself, or a pattern such as
    ``made/*.h5``.

    Raises
    ------
    DataError
        It has too few.
    """
    if isinstance(given, Recording):
        return None
    if not isinstance(given, (str, Path)):
        found, name = list(given), "the sequence"
    else:
        path, name = Path(given), str(given)
        if path.is_dir() and not may_hold_events(path):
            shown = (one for one in sorted(path.iterdir()) if not one.name.startswith("."))
            found = [one for one in shown if may_hold_events(one)]
        elif {*name} & {*"*?["} and not path.exists():
            top = Path(path.anchor)
            found = [*sorted(top.glob(str(path.relative_to(top))))]
        else:
            return None
    if len(found) < LEAST:
        raise DataError(
            f"{name}: {len(found)} recordings; a set that is compared with another needs {LEAST}"
        )
    return found


def compare_sets(
    sets: tuple[list[Stream], list[Stream]],
    read: tuple[Read, Read],
    doubt: Callable[[str], None],
) -> dict[str, Any]:
    """Return how far a classifier tells two sets of recordings apart, ready for JSON.

    Two recordings of one name are a pair: they are in the same part of the cross-validation, and
    on one clock if they have any time in common.  `doubt` takes what is doubtful in files.

    Raises
    ------
    DataError
        The recordings are not all of one size, or one cannot be read.
    """
    by_name = [dict(zip(*one, strict=True)) for one in zip(_names(*sets), sets, strict=True)]
    groups = sorted({*by_name[0], *by_name[1]})
    rows, is_simulated, group = [], [], []
    counts, problems = [0, 0], Counter[str]()
    first: dict[str, str] = {}
    size: tuple[int, int] | None = None
    for number, name in enumerate(groups):
        held = [which for which in (0, 1) if name in by_name[which]]
        pair = [_opened(by_name[which][name], read[which]) for which in held]
        for which, recording in zip(held, pair, strict=True):
            size = size or (recording.width, recording.height)
            if size != (recording.width, recording.height):
                raise DataError(
                    f"{recording.path}: {recording.width}x{recording.height} pixels, but others"
                    f" have {size[0]}x{size[1]}: sets are compared on one size; --size states it"
                )
            counts[which] += len(recording.events)
            if isinstance(by_name[which][name], (str, Path)):
                for problem in recording.problems:
                    alike = re.sub(r"\d[\d.,e+-]*", "", problem)
                    problems[alike] += 1
                    first.setdefault(alike, f"{recording.path}: {problem}")
        for which, recording, span in zip(held, pair, _spans(pair), strict=True):
            rows.append(features(recording.events, size or (0, 0), span, PARTS))
            is_simulated.append(which == 1)
            group.append(number)
    for alike, times in problems.items():
        doubt(first[alike] + (f" (and {times - 1} more are like it)" if times > 1 else ""))
    values, is_second = np.array(rows), np.array(is_simulated)
    samples = Samples(values, is_second, np.array(group))
    floor: Floor = {"half_split": between_halves(values[~is_second])}
    assert size is not None  # as no set is empty
    return {
        **{
            which: {"recordings": len(one), "events": count, "width": size[0], "height": size[1]}
            for which, one, count in zip(("measured", "simulated"), sets, counts, strict=True)
        },
        "pairs": len(samples.group) - len(groups),
        "told_apart": report(samples, described(size, PARTS), RECORDINGS, floor),
        "floors": {"half_split": HALVES},
    }


def _opened(given: Stream, read: Read) -> Recording:
    try:
        return read(given)
    except DataError as error:
        raise DataError(
            f"{error} (if it is none of the set, name the others with a pattern: 'FOLDER/*.h5')"
        ) from None


def _spans(pair: list[Recording]) -> list[Window]:
    """Return the time of each recording; that of both if they have any in common."""
    spans = [recording.span_us for recording in pair]
    starts, stops = zip(*spans, strict=True)
    if max(starts) <= min(stops):
        spans = [(min(starts), max(stops))] * len(pair)
    return [(start, stop + 1) for start, stop in spans]


def _names(*sets: list[Stream]) -> list[list[str]]:
    """Return names of the recordings of both sets, by which they are paired.

    A name goes up to the first dot if that tells those of a set apart, else up to the last one.
    Recordings that have no names of their own have no pairs.
    """
    paths = [[Path(one.path if isinstance(one, Recording) else one) for one in a] for a in sets]
    for whole in (False, True):
        names = [[path.stem if whole else path.name.split(".")[0] for path in a] for a in paths]
        if all(len({*some}) == len(some) for some in names):
            return names
    width = len(str(max(map(len, sets))))
    return [[f"{k:0{width}d} {which}" for k in range(len(one))] for which, one in enumerate(sets)]
