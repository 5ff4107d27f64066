"""Boxes around objects: read of COCO, MOT, YOLO and Prophesee, written as Prophesee and COCO.

================= ================================================ =============================
read              what a box is [px]                               when
================= ================================================ =============================
COCO ``.json``    ``bbox: [left, top, width, height]``             of the image ``file_name``
MOT ``gt.txt``    ``frame,id,left,top,width,height,conf,class``    frame counts from 1, as pixels
YOLO ``NAME.txt`` ``class x y width height``, of its middle, as    of the image of that name
                  shares of the frame
``_bbox.npy``     fields ``t`` or ``ts`` [us], ``x``, ``y``,       at that time
                  ``w``, ``h``, ``class_id``, ``track_id``
================= ================================================ =============================

A box is cut where the sensor ends; nothing is left of one beside it.  Boxes of COCO without
``track_id`` have the id of the annotation.

References
----------
.. [1] T.-Y. Lin et al., "Microsoft COCO: Common Objects in Context", ECCV 2014.
.. [2] A. Milan et al., "MOT16: A Benchmark for Multi-Object Tracking", arXiv:1603.00831.
.. [3] E. Perot et al., "Learning to Detect Objects with a 1 Megapixel Event Camera", NeurIPS 2020
   (the fields of ``_bbox.npy``).
"""

from __future__ import annotations

import io
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.errors import DataError
from adv2e.files.zips import read_array
from adv2e.geometry import Size
from adv2e.side.placement import Clock, Placement
from adv2e.sources.times.rates import NUMBER

PROPHESEE = np.dtype(
    [
        *(("t", "<i8"), ("x", "<f4"), ("y", "<f4"), ("w", "<f4"), ("h", "<f4")),
        *(("class_id", "<u4"), ("track_id", "<u4"), ("class_confidence", "<f4")),
    ]
)
"""Fields of a box, its time in us on the clock of the events."""

_NAMES = {"ts": "t", "confidence": "class_confidence"}
"""Names of fields in older files."""


@dataclass(frozen=True)
class Boxes:
    """Boxes as they were read.

    Attributes
    ----------
    rows : (boxes, 8) float64
        Frame or time, left, top, width, height [px, or shares], class, track, confidence.
    files : sequence of str
        What the numbers of frames name; empty: frames as such, from 0.
    timed : bool
        The first column is a time of the source [us].
    shares : bool
        Sizes are shares of the frame.
    sizes : set of Size
        Of the pictures that they were made of, where they are stated.
    """

    label: str
    rows: NDArray[np.float64]
    files: Sequence[str] = ()
    timed: bool = False
    shares: bool = False
    classes: Mapping[int, str] = field(default_factory=dict)
    sizes: frozenset[Size] = frozenset()

    def placed(self, place: Placement, clock: Clock) -> tuple[NDArray[Any], NDArray[np.int64]]:
        """Return the boxes on the sensor, (boxes,) PROPHESEE, and their times [ns], in order."""
        for size in self.sizes:
            place.check(size, self.label)
        rows = self.rows
        corner, extent = rows[:, 1:3], rows[:, 3:5]
        if self.shares:
            corner, extent = corner * place.whole, extent * place.whole
        ends = np.stack([place.points(corner), place.points(corner + extent)])
        low, high = (np.clip(end, 0, place.size) for end in (ends.min(0), ends.max(0)))
        times, wanted = self._times(clock)
        wanted &= np.all(high > low, axis=1)
        made = np.zeros(len(rows), PROPHESEE)
        made["t"] = (times + 500) // 1000
        made["x"], made["y"] = low.T
        made["w"], made["h"] = (high - low).T
        for name, at in (("class_id", 5), ("track_id", 6), ("class_confidence", 7)):
            made[name] = rows[:, at]
        chosen = np.flatnonzero(wanted)
        chosen = chosen[np.argsort(times[chosen], kind="stable")]
        return made[chosen], times[chosen]

    def _times(self, clock: Clock) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
        if self.timed:
            whole = np.floor(self.rows[:, 0])  # in ns, floats are too coarse
            rest = np.rint((self.rows[:, 0] - whole) * 1000)
            return clock.of(whole.astype(np.int64) * 1000 + rest.astype(np.int64))
        numbers = self.rows[:, 0].astype(np.int64)
        if self.files:
            numbers = np.array(clock.numbers(self.files, self.label), np.int64)[numbers]
        inside = (numbers >= 0) & (numbers < len(clock.frames))
        if not inside.all() and clock.end == np.inf:  # else not all frames were read
            raise DataError(
                f"{self.label}: a box of frame {numbers[~inside][0] + 1} of {len(clock.frames)}"
            )
        times, wanted = clock.of_frames(np.where(inside, numbers, 0))
        return times, wanted & inside

    def written(self, place: Placement, clock: Clock) -> Iterator[tuple[str, bytes]]:
        """Yield names and bytes of ``boxes_bbox.npy`` and ``boxes.json``."""
        made, times = self.placed(place, clock)
        data = io.BytesIO()
        np.save(data, made)
        yield "boxes_bbox.npy", data.getvalue()
        instants = np.unique(times)
        size = dict(zip(("width", "height"), place.size, strict=True))
        images = [
            {"id": n, "file_name": f"{t_ns}.png", "t_ns": t_ns, **size}
            for n, t_ns in enumerate(instants.tolist(), 1)
        ]
        numbers = (np.searchsorted(instants, times) + 1).tolist()
        boxes = [
            {
                **{"id": n, "image_id": image, "category_id": kind, "track_id": track},
                **{"bbox": box, "area": box[2] * box[3], "score": score, "iscrowd": 0},
            }
            for n, (image, (_, *box, kind, track, score)) in enumerate(
                zip(numbers, made.tolist(), strict=True), 1
            )
        ]
        names = {n: str(n) for n in np.unique(made["class_id"]).tolist()} | dict(self.classes)
        categories = [{"id": number, "name": names[number]} for number in sorted(names)]
        text = {"images": images, "annotations": boxes, "categories": categories}
        yield "boxes.json", (json.dumps(text, indent=1) + "\n").encode()


def of_coco(data: bytes, label: str) -> Boxes:
    """Read an object of COCO; DataError if it is none."""
    try:
        file = json.loads(data)
        images = {one["id"]: n for n, one in enumerate(file["images"])}
        rows = [
            [
                *(images[one["image_id"]], *one["bbox"], one["category_id"]),
                *(one.get("track_id", one["id"]), one.get("score", 1.0)),
            ]
            for one in file["annotations"]
        ]
        names = [str(one["file_name"]) for one in file["images"]]
        times = [one.get("t_ns") for one in file["images"]]
        classes = {int(one["id"]): str(one["name"]) for one in file.get("categories", ())}
        stated = [one for one in file["images"] if "width" in one]
        sizes = frozenset(Size(int(one["width"]), int(one["height"])) for one in stated)
        found = np.array(rows, np.float64).reshape(-1, 8)
        if times and None not in times:  # of ours
            found[:, 0] = [times[int(at)] / 1000 for at in found[:, 0]]
            return Boxes(label, found, timed=True, classes=classes, sizes=sizes)
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        told = f"{type(error).__name__}: {error}"[:80]
        raise DataError(
            f"{label}: not boxes of COCO, with images, annotations, categories ({told})"
        ) from None
    return Boxes(label, found, names, classes=classes, sizes=sizes)


def of_mot(data: bytes, label: str) -> Boxes:
    """Read the lines of MOT; DataError if they are none."""
    rows = _numbers(data, label, ",", 6)
    more = np.ones((len(rows), 2))  # confidence and class, where they are left out
    given = rows[:, 6:8]
    more[:, : given.shape[1]] = given
    # pixels and frames count from 1
    found = [rows[:, :1] - 1, rows[:, 2:4] - 1, rows[:, 4:6], more[:, 1:], rows[:, 1:2]]
    return Boxes(label, np.hstack([*found, more[:, :1]]))


def of_yolo(files: Mapping[str, bytes], label: str) -> Boxes:
    """Read the files of YOLO, one for each frame; DataError if they are none."""
    found = [np.zeros((0, 8))]
    for number, (name, data) in enumerate(files.items()):
        rows = _numbers(data, name, None, 5)
        if np.any((rows[:, 1:5] < 0) | (rows[:, 1:5] > 1)):
            raise DataError(f"{name}: not boxes of YOLO: shares of the frame are from 0 to 1")
        made = np.full((len(rows), 8), (number, *(0,) * 6, 1), np.float64)
        made[:, 1:3] = rows[:, 1:3] - rows[:, 3:5] / 2
        made[:, 3:6] = rows[:, [3, 4, 0]]
        found.append(made)
    return Boxes(label, np.vstack(found), list(files), shares=True)


def of_prophesee(data: bytes, label: str) -> Boxes:
    """Read a ``_bbox.npy``; DataError if it is none."""
    array = with_fields(read_array(io.BytesIO(data), len(data), label), label)
    rows = np.array([array[name] for name in PROPHESEE.names or ()], np.float64).T
    return Boxes(label, rows, timed=True)


def with_fields(array: NDArray[Any], label: str) -> NDArray[Any]:
    """Return boxes as PROPHESEE, by time; DataError unless they have its fields, or older ones."""
    names = {_NAMES.get(name, name): name for name in array.dtype.names or ()}
    needed = ("t", "x", "y", "w", "h", "class_id")
    if array.ndim != 1 or not {*needed} <= {*names}:
        raise DataError(f"{label}: not boxes of Prophesee, with fields {', '.join(needed)}")
    boxes = np.zeros(len(array), PROPHESEE)
    boxes["class_confidence"] = 1
    for name, own in names.items():
        if name in (PROPHESEE.names or ()):
            boxes[name] = array[own]
    return boxes[np.argsort(boxes["t"], kind="stable")]


def _numbers(data: bytes, label: str, mark: str | None, least: int) -> NDArray[np.float64]:
    """Return the numbers of a text; DataError names the line that has too few."""
    rows: list[list[str]] = []
    for number, line in enumerate(data.decode("utf-8", "replace").splitlines(), 1):
        words = line.strip().rstrip(",").split(mark)
        if any(words):
            rows.append(words)
            is_right = all(NUMBER.fullmatch(word.strip()) for word in words)
            if not is_right or len(words) < least or len(words) != len(rows[0]):
                raise DataError(f"{label} line {number}: must be {least} numbers, or more")
    return np.array(rows, np.float64).reshape(len(rows), -1 if rows else least)
