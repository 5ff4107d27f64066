"""What networks are to find: boxes and optical flow of a recording, with their times.

They are those of its side data (``adv2e.side``), placed as its events are, or arrays in memory.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.errors import DataError
from adv2e.motion.estimate import estimate_motion, is_unchanged
from adv2e.side.boxes import Boxes, with_fields
from adv2e.side.carrying import SideData
from adv2e.side.maps import Maps
from adv2e.side.placement import Clock, Placement

Flow = NDArray[np.float32]
"""(2, rows, columns): columns and rows moved in an interval [px]; NaN: not known."""


@dataclass(frozen=True)
class Targets:
    """Boxes and flow of a recording.

    Attributes
    ----------
    boxes : array of :data:`adv2e.side.boxes.PROPHESEE`, (boxes,), or None
        Sorted by time.
    flow_us : (intervals, 2) int64
        First and last time of each map of flow [us].
    flow : sequence of callable
        Each returns one: (2, rows, columns) float32.
    """

    boxes: NDArray[Any] | None = None
    flow_us: NDArray[np.int64] | None = None
    flow: Sequence[Callable[[], Flow]] = ()

    @classmethod
    def of(
        cls, boxes: Any = None, flow: Any = None, flow_us: Any = None, label: str = "targets"
    ) -> Targets:
        """Return the targets of arrays.

        Parameters
        ----------
        boxes : structured array, optional
            With the fields of :data:`adv2e.side.boxes.PROPHESEE`, but for confidence and track.
        flow : (intervals, 2, rows, columns) array, optional
            Columns and rows moved in each interval [px].
        flow_us : (intervals, 2) array, optional
            First and last time of each [us].

        Raises
        ------
        DataError
            They have another form.
        """
        maps = [] if flow is None else list(flow)
        times = np.empty((0, 2), np.int64) if flow_us is None else np.asarray(flow_us, np.int64)
        if times.shape != (len(maps), 2):
            raise DataError(f"{label}: {len(maps)} maps of flow need ({len(maps)}, 2) times [us]")
        made = [partial(np.asarray, one, np.float32) for one in maps]
        held = None if boxes is None else with_fields(np.asarray(boxes), label)
        return cls(held, times, made)

    def flow_between(self, start_us: int, stop_us: int, label: str) -> Flow:
        """Return the flow from one time to another [us]; DataError if there is none."""
        times = np.empty((0, 2), np.int64) if self.flow_us is None else self.flow_us
        (found,) = np.nonzero(np.all(np.abs(times - (start_us, stop_us)) <= 1, axis=1))
        if not found.size:
            raise DataError(
                f"{label}: no flow from {start_us / 1e6:.6f} to {stop_us / 1e6:.6f} s, where its"
                " images are"
            )
        return self.flow[int(found[0])]()


def targets_of(side: SideData | None, clock: Callable[[], Clock]) -> Targets:
    """Return the boxes and the flow among side data, on the sensor and the clock of the events.

    Raises
    ------
    DataError
        They are not of the recording.
    """
    boxes, flow = (None if side is None else side.kinds.get(kind) for kind in ("boxes", "flow"))
    if side is None or (boxes is None and flow is None):
        return Targets()
    place, known = side.place, clock()
    found = boxes.placed(place, known)[0] if isinstance(boxes, Boxes) else None
    if not isinstance(flow, Maps):
        return Targets(found)
    times, wanted = flow.when(known)
    names = [name for name, is_wanted in zip(flow.names, wanted, strict=True) if is_wanted]
    made = [partial(_map_of, flow, name, place) for name in names]
    return Targets(found, (times[wanted] + 500) // 1000, made)


def _map_of(flow: Maps, name: str, place: Placement) -> Flow:
    return np.moveaxis(flow.placed(name, place), 2, 0)


def estimated_flow(first: NDArray[Any], second: NDArray[Any]) -> Flow:
    """Return the flow that is found from one grey image to the next; NaN where there is none."""
    images = [image.astype(np.float32) for image in (first, second)]
    motion = estimate_motion(*images)
    if motion is not None:
        return np.stack([motion[0].u, motion[0].v]).astype(np.float32)
    nothing = 0.0 if is_unchanged(*images) else np.nan
    return np.full((2, *first.shape), nothing, np.float32)
