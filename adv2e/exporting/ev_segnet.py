"""Pictures of events for Ev-SegNet, in the folders that its loader reads.

====================================== ========================================================
events/SPLIT/NAME_export_%d.npy        float32, (rows, columns, 6): see
                                       :mod:`adv2e.representations.voxel_grid`
images/SPLIT/NAME_export_%d.png        the image at the end of the window, grey, 8 bits
====================================== ========================================================

SPLIT is train, test or other.  Labels are those of the data set: they belong into ``labels/SPLIT``
under the same names.  Of DDD17's 260 rows the lower 60, the car itself, were cut off.

References
----------
.. [1] I. Alonso, A. C. Murillo, "EV-SegNet: Semantic Segmentation for Event-based Cameras", CVPRW
   2019, arXiv:1811.12039; github.com/Shathe/Ev-SegNet.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.exporting.voxels import Slice
from adv2e.light.pictures import png_of
from adv2e.representations.voxel_grid import event_image

DDD17 = (346, 260)
"""Columns and rows of the camera of DDD17."""
DDD17_ROWS = 200
"""Rows of its pictures that are kept."""


def write_event_images(
    name: str,
    slices: Iterator[Slice],
    images: Iterator[NDArray[Any]],
    size: tuple[int, int],
    folder: Path,
    how: Mapping[str, Any],
) -> int:
    """Write a picture of events for each image, and the image; return how many.

    `how` are :class:`adv2e.options.SegmentationOptions`.
    """
    events_in, images_in = (folder / kind / how["split"] for kind in ("events", "images"))
    for place in (events_in, images_in):
        place.mkdir(parents=True, exist_ok=True)
    rows = how["rows"] or (DDD17_ROWS if size == DDD17 else size[1])
    is_scaled = how["counts"] == "scaled"
    number = 0
    for part, image in zip(slices, images, strict=True):
        kept = part.events[part.events["y"] < rows]
        window = part.start_us, part.stop_us
        picture = event_image(kept, (size[0], rows), window, scale_counts=is_scaled)
        stem = f"{name}_export_{number}"
        np.save(events_in / f"{stem}.npy", picture, allow_pickle=False)
        (images_in / f"{stem}.png").write_bytes(png_of(image[:rows]))
        number += 1
    return number
