"""What networks are to find: boxes and optical flow beside the events, with their times.

=================================== ===============================================================
file                                content
=================================== ===============================================================
``EVENTS.side/boxes_bbox.npy``,     boxes, :data:`BOX_DTYPE`; ``ts`` and ``confidence``, names of
or ``NAME_bbox.npy`` beside         older files, are read, too
``NAME.h5``, ``NAME_td.dat``
``EVENTS.side/flow.txt``            a line for each map of flow: from, to [s], and its name below
                                    ``EVENTS.side``, a ``.npy`` of (rows, columns, 2)
=================================== ===============================================================

References
----------
.. [1] E. Perot et al., "Learning to Detect Objects with a 1 Megapixel Event Camera", NeurIPS 2020
   (the fields of ``_bbox.npy``).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from decimal import Decimal, InvalidOperation
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.errors import DataError
from adv2e.motion.estimate import estimate_motion, is_unchanged

BOX_DTYPE = np.dtype(
    [
        *(("t", "<i8"), ("x", "<f4"), ("y", "<f4"), ("w", "<f4"), ("h", "<f4")),
        *(("class_id", "<u4"), ("track_id", "<u4"), ("class_confidence", "<f4")),
    ]
)
"""A box: time on the clock of the events [us], left, top, width, height [px], class and track."""

_OLDER = {"t": "ts", "class_confidence": "confidence"}
_WITHOUT = {"track_id": 0, "class_confidence": 1}
"""Fields that a file may lack, and what they are then."""

Flow = NDArray[np.float32]
"""(2, rows, columns): columns and rows moved in an interval [px]; NaN: not known."""


@dataclass(frozen=True)
class Targets:
    """Boxes and flow of a recording.

    Attributes
    ----------
    boxes : array of BOX_DTYPE, (boxes,), or None
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
            With the fields of :data:`BOX_DTYPE`; confidence and track may be missing.
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
        held = None if boxes is None else _boxes(np.asarray(boxes), label)
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


def targets_beside(events: Path) -> Targets:
    """Return the boxes and the flow that lie beside a file of events.

    Raises
    ------
    DataError
        A file is not what its name says; the text names it.
    """
    side = events.with_name(f"{events.name}.side")
    stem = events.stem.removesuffix("_td")
    named = side / "boxes_bbox.npy", events.with_name(f"{stem}_bbox.npy")
    file = next((one for one in named if one.is_file()), None)
    boxes = None
    if file is not None:
        try:
            boxes = _boxes(np.load(file, allow_pickle=False), str(file))
        except (OSError, ValueError, EOFError) as error:
            raise DataError(f"{file}: is no array of NumPy: {error}") from None
    return Targets(boxes, *_listed_flow(side))


def _listed_flow(side: Path) -> tuple[NDArray[np.int64] | None, list[Callable[[], Flow]]]:
    listing = side / "flow.txt"
    if not listing.is_file():
        return None, []
    times: list[list[int]] = []
    flow: list[Callable[[], Flow]] = []
    for number, line in enumerate(listing.read_text("utf-8").splitlines(), start=1):
        if not line.strip() or line.startswith("#"):
            continue
        try:
            first, last, name = line.split(maxsplit=2)
            times.append([round(Decimal(one) * 1_000_000) for one in (first, last)])
        except (ValueError, InvalidOperation):
            raise DataError(f"{listing}:{number}: must be two times [s] and a name") from None
        flow.append(partial(_map_of, side / name))
    return np.array(times, np.int64).reshape(-1, 2), flow


def _map_of(file: Path) -> Flow:
    try:
        found = np.load(file, allow_pickle=False)
    except (OSError, ValueError, EOFError) as error:
        raise DataError(f"{file}: cannot be read: {error}") from None
    if found.ndim != 3 or found.shape[2] != 2:
        raise DataError(f"{file}: must be of shape (rows, columns, 2), got {found.shape}")
    flow: Flow = np.moveaxis(found, 2, 0).astype(np.float32)
    return flow


def _boxes(found: NDArray[Any], label: str) -> NDArray[Any]:
    names = found.dtype.names or ()
    boxes = np.zeros(found.shape, BOX_DTYPE)
    for name in BOX_DTYPE.names or ():
        own = name if name in names else _OLDER.get(name, name)
        if (own not in names and name not in _WITHOUT) or found.ndim != 1:
            raise DataError(f"{label}: boxes need the fields t, x, y, w, h and class_id")
        boxes[name] = found[own] if own in names else _WITHOUT[name]
    return boxes[np.argsort(boxes["t"], kind="stable")]


def estimated_flow(first: NDArray[Any], second: NDArray[Any]) -> Flow:
    """Return the flow that is found from one grey image to the next; NaN where there is none."""
    images = [image.astype(np.float32) for image in (first, second)]
    motion = estimate_motion(*images)
    if motion is not None:
        return np.stack([motion[0].u, motion[0].v]).astype(np.float32)
    nothing = 0.0 if is_unchanged(*images) else np.nan
    return np.full((2, *first.shape), nothing, np.float32)
