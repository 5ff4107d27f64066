"""What of a long recording is diagnosed: as much as can be simulated often enough."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.config import Config
from adv2e.diagnosis.data.costs import Costs
from adv2e.diagnosis.data.evidence import Evidence, check_events
from adv2e.diagnosis.data.stream import Stream
from adv2e.reports.result import Masked

AFFORDABLE_S = 0.2
"""What a simulation may take in the mean, in one thread; a diagnosis takes some thousands [s]."""

_BLOCK = 8
_SMALLEST = 48
_FEWEST = 12  # frame intervals


def affordable(evidence: Evidence, declared: Config) -> Evidence:
    """Return the recording, cropped where simulating all of it many times would take too long.

    A rectangle of the sensor's proportions is kept that holds as many events as any.  A pixel does
    not depend on its neighbours, so that the crop sees what it saw in the whole, but for load of
    the readout and for interpolation along motion at its border.  Where the smallest rectangle is
    too much, the stretch of time that holds the most events is kept of it.

    Parameters
    ----------
    evidence : Evidence
    declared : Config
        Decides what a simulation costs.

    Raises
    ------
    DataError
        Too few events are left.
    """
    cost_s = Costs(evidence, declared).of
    kept, share = evidence, 1.0
    while cost_s(kept) > AFFORDABLE_S:
        # where events crowd, a part of the pixels costs more than its share
        share *= 0.98 * AFFORDABLE_S / cost_s(kept)
        width, height = (
            min(length, max(_SMALLEST, round(length * share**0.5 / _BLOCK) * _BLOCK))
            for length in (evidence.width, evidence.height)
        )
        if (width, height) == (kept.width, kept.height):
            break
        kept = _cropped(evidence, *_busiest(evidence, width, height), width, height)
    whole = kept
    while cost_s(kept) > AFFORDABLE_S:
        intervals = int((len(kept.frames) - 1) * 0.98 * AFFORDABLE_S / cost_s(kept))
        if intervals < _FEWEST:
            break
        kept = _shortened(whole, intervals)
    if kept is not evidence:
        size, length = f"{kept.width}x{kept.height} pixels", f"{kept.seconds:.3g} s"
        where = f"in the {size} and {length} that can be simulated often enough"
        check_events(len(kept.stream), evidence.name, where)
    return kept


def _busiest(evidence: Evidence, width: int, height: int) -> tuple[int, int]:
    """Return column and row, multiples of a block, at which a crop holds the most events."""
    counts = np.bincount(evidence.stream.pixel, minlength=evidence.width * evidence.height)
    sums = np.zeros((evidence.height + 1, evidence.width + 1), np.int64)
    sums[1:, 1:] = counts.reshape(evidence.height, -1).cumsum(axis=0).cumsum(axis=1)
    rows = np.arange(0, evidence.height - height + 1, _BLOCK)[:, None]
    columns = np.arange(0, evidence.width - width + 1, _BLOCK)[None, :]
    inside = sums[rows + height, columns + width] - sums[rows, columns + width]
    inside += sums[rows, columns] - sums[rows + height, columns]
    row, column = np.unravel_index(int(inside.argmax()), inside.shape)
    return int(columns[0, column]), int(rows[row, 0])


def _cropped(evidence: Evidence, left: int, top: int, width: int, height: int) -> Evidence:
    stream = evidence.stream
    y, x = np.divmod(stream.pixel, evidence.width)
    inside = (x >= left) & (x < left + width) & (y >= top) & (y < top + height)
    pixel = ((y - top) * width + (x - left))[inside].astype(np.int32)
    kept = Stream(stream.t[inside], pixel, stream.on[inside], width, height)

    def cropped(frame: NDArray[Any]) -> NDArray[Any]:
        return frame[top : top + height, left : left + width]

    what = f"pixels outside the {width}x{height} at column {left}, row {top}"
    return replace(
        evidence.with_frames(cropped),
        stream=kept,
        width=width,
        height=height,
        masked=[*evidence.masked, Masked(what, 1.0 - len(kept) / len(stream))],
        notes=[
            *evidence.notes,
            f"cropped from {evidence.width}x{evidence.height} pixels, as all of them would take too"
            " long to simulate often enough",
        ],
    )


def _shortened(evidence: Evidence, intervals: int) -> Evidence:
    """Return the stretch of so many frame intervals that holds the most events."""
    stream, times_s = evidence.stream, evidence.times_s
    before = np.searchsorted(stream.t, times_s * 1e6)
    first = int(np.argmax(before[intervals:] - before[:-intervals]))
    last = first + intervals
    part = evidence.during(first, last)
    what = f"time outside {times_s[first]:.3f} to {times_s[last]:.3f} s"
    return replace(
        part,
        masked=[*evidence.masked, Masked(what, 1.0 - len(part.stream) / len(stream))],
        notes=[
            *evidence.notes,
            f"{times_s[last] - times_s[first]:.3g} of {evidence.seconds:.3g} s were looked at, as"
            " all of them would take too long to simulate often enough",
        ],
    )
