"""Estimate of the events, bytes and time of a conversion, from short parts of its source.

Each part is converted to a file as the whole would be, but its pixels begin anywhere between two
events: from rest, each would first have to change by a contrast threshold, which short parts
hardly reach.
"""

from __future__ import annotations

import math
import tempfile
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from adv2e.config import Written, load_config
from adv2e.effects.pixel.initial_reference import RANDOM
from adv2e.errors import UsageError
from adv2e.files.states import free_bytes, state_of
from adv2e.formats.frames import open_frames
from adv2e.options import ConvertOptions, SourceOptions, chosen, takes
from adv2e.sources.base import Source

if TYPE_CHECKING:
    from typing_extensions import Unpack

MUCH = 10_000_000_000
"""Bytes to be made that are told before the work begins."""

_LARGE = 500_000_000
"""Pixels of all frames together from which on so much may come."""

_PARTS = 3
_PART_PIXELS = 4e6
"""Pixels of all frames of a part together: so many take about 50 ms."""

_FEWEST, _MOST = 4, 128
"""Intervals between frames that a part has."""

_OF_VIDEO = 240
"""Frames of a video are decoded in order: parts lie within so many at its beginning."""


class _Part(NamedTuple):
    intervals: int
    events: int
    bytes: int
    seconds: float


@dataclass(frozen=True)
class Estimate:
    """Estimate of the events, bytes and time of a conversion, or of many.

    Attributes
    ----------
    events, bytes, seconds : float
    basis : str
        How much of the source it is made from.
    spent : float
        Time that the estimate took, without compiling [s].
    """

    events: float
    bytes: float
    seconds: float
    basis: str
    spent: float = 0.0

    def is_much(self, folder: Path) -> bool:
        """Tell whether the bytes are :data:`MUCH`, or more than there is room for in a folder."""
        return self.bytes >= min(MUCH, free_bytes(folder))

    def text(self, folder: Path) -> str:
        """Return the estimate for people, rounded, and the room in a folder if it is too small."""
        from tqdm import tqdm  # noqa: PLC0415 - it takes its time, and most runs need none

        size, room = tqdm.format_sizeof(self.bytes), free_bytes(folder)
        return (
            f"about {float(f'{self.events:.2g}'):,.0f} events, {size}B and"
            f" {tqdm.format_interval(self.seconds)}, by {self.basis}"
            + (f"; there is room for {room / 1e9:.1f} GB" if self.bytes > room else "")
        )


def may_be_much(source: Source) -> bool:
    """Tell whether a source is so large that its output may exceed :data:`MUCH` bytes."""
    frames = source.count or 0
    if source.waits or source.along is not None:
        return False
    return int(frames * source.width * source.height) >= _LARGE


@takes(ConvertOptions)
def estimate(
    source: str | Path,
    output: str | Path,
    config: Written | Sequence[Written] | None = None,
    *,
    share: float = math.inf,
    **options: Unpack[ConvertOptions],
) -> Estimate | None:
    """Return about how much a conversion will make and take; None where nobody can tell.

    That is where frames are not counted, or so small a `share` of them may be looked at that it
    tells nothing.

    Parameters
    ----------
    source : str or Path
    output : str or Path
        What would be written.
    config : Config, or what :func:`adv2e.load_config` takes, optional
    share : float
        Of the frames, that may be converted for it; some are converted several times.
    **options
        See :class:`adv2e.options.ConvertOptions`.

    Raises
    ------
    Adv2eError
        As :func:`adv2e.convert`.
    """
    from adv2e.conversion.convert import convert  # noqa: PLC0415 - most conversions ask nothing

    if options["pixel_format"] is not None or options["motion"] is not None:
        raise UsageError("estimates are of files and folders of frames")
    config = load_config([load_config(config), {"pixel": {"initial_reference": RANDOM}}])
    opened = open_frames(source, **chosen(SourceOptions, options))
    if opened.count is None:
        return None
    intervals = opened.count - 1
    times_s = _times_s(opened)
    half = int(_PART_PIXELS / 2 / (opened.width * opened.height))
    half = max(1, min(max(half, _FEWEST // 2), _MOST // 2, (len(times_s) - 1) // 2))
    count = _PARTS
    if share < (2 + half * (2 * count + 1)) / intervals:
        room = share * intervals - 2
        half = int(room / (2 * count + 1))
        if half < _FEWEST // 2:
            count, half = 1, int(room / 3)
        if half < _FEWEST // 2:
            return None
    last = max(0, len(times_s) - 1 - 2 * half)

    with tempfile.TemporaryDirectory(prefix="adv2e-estimate-") as folder:

        def part(begin: int, count: int) -> _Part:
            end = min(begin + count, len(times_s) - 1)
            margin_s = (times_s[end] - times_s[begin]) / (4 * (end - begin))
            wanted: ConvertOptions = {
                **options,
                "start_s": max(0.0, times_s[begin] - margin_s),
                "stop_s": times_s[end] + margin_s,
                "take": "frames",
                "overwrite": True,
                "preview": None,
                "progress": False,
            }
            target = Path(folder) / Path(output).name
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # the whole conversion tells them
                made = convert(source, target, config, **wanted)
            return _Part(made.frames - 1, made.events, state_of(target).bytes, made.seconds)

        part(0, 2)  # compiles, and reads what is not in memory
        short, whole = part(0, half), part(0, 2 * half)
        others = [part(k * last // (count - 1), 2 * half) for k in range(1, count) if last]
    parts = [whole, *others]
    seen = sum(one.intervals for one in parts)
    fixed_bytes = min(_at_none(short, short.bytes, whole, whole.bytes), float(short.bytes))
    # a machine with other work may take longer for less
    fixed_s = min(_at_none(short, short.seconds, whole, whole.seconds), 0.9 * whole.seconds)
    return Estimate(
        intervals * sum(one.events for one in parts) / seen,
        fixed_bytes + intervals * sum(one.bytes - fixed_bytes for one in parts) / seen,
        fixed_s + intervals * (whole.seconds - fixed_s) / whole.intervals,
        f"{seen + len(parts)} of {opened.count} frames",
        short.seconds + sum(one.seconds for one in parts),
    )


def _times_s(source: Source) -> list[float]:
    """Return the times of the frames among which parts are chosen [s after the first frame]."""
    shots = source.shots()
    if source.kind == "video":
        shots = islice(shots, _OF_VIDEO)
    times_ns = [shot.t_ns for shot in shots]
    since_ns = [t_ns - times_ns[0] for t_ns in times_ns]
    start_ns, stop_ns = source.selection.start_ns, source.selection.stop_ns
    return [t_ns * 1e-9 for t_ns in since_ns if start_ns <= t_ns <= stop_ns]


def _at_none(short: _Part, of_short: float, whole: _Part, of_whole: float) -> float:
    """Return the fixed cost: intercept of a line through two parts of different length."""
    if whole.intervals == short.intervals:
        return 0.0
    slope = (of_whole - of_short) / (whole.intervals - short.intervals)
    return max(0.0, of_short - slope * short.intervals)
