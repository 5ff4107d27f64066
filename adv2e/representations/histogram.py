r"""The stacked histogram of the events of a window: counts of each polarity in bins of time.

.. math::
    H(pB + b, y, x) = \min(c, \#\{i : p_i = p, b_i = b\}), \qquad
    b_i = \min(B - 1, \lfloor B\,(t_i - t_{first})/(t_{last} - t_{first})\rfloor)

OFF comes first, p = 0.  A window without extent is divided by 1.  The share of time is a number of
32 bits, as in the code of the source, so that an event at the edge of a bin falls into the same.
There, counts above 255 begin at 0 again before they are cut off; here they do not.

References
----------
.. [1] M. Gehrig, D. Scaramuzza, "Recurrent Vision Transformers for Object Detection with Event
   Cameras", CVPR 2023, arXiv:2212.05598; github.com/uzh-rpg/RVT.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from adv2e.events import Events, Window, pixels_of
from adv2e.representations.voxel_grid import own_window


def stacked_histogram(
    events: Events,
    bins: int,
    size: tuple[int, int],
    most: int | None = 10,
    window: Window | None = None,
) -> NDArray[np.integer]:
    """Return the counts of events, cut off at `most`.

    Parameters
    ----------
    events : array of EVENT_DTYPE
        On the sensor and inside the window, sorted by time.
    bins : int
        Bins of time.
    size : (int, int)
        Width and height of the sensor [pixels].
    most : int, optional
        Largest count, at most 255; None: all are counted.
    window : (int, int), optional
        Start and end of the bins [us]; default: times of the first and the last event.

    Returns
    -------
    (2 bins, rows, columns) array of uint8; of int64 where all are counted
    """
    first, last = own_window(events) if window is None else window
    share = (events["t"] - first).astype(np.float32) / np.float32(max(last - first, 1))
    number = np.minimum((share * np.float32(bins)).astype(np.int64), bins - 1)
    pixels = size[0] * size[1]
    cell = (events["p"] * np.int64(bins) + number) * pixels + pixels_of(events, size[0])
    counts = np.bincount(cell, minlength=2 * bins * pixels)
    if most is not None:
        counts = np.minimum(counts, most).astype(np.uint8)
    return counts.reshape(2 * bins, size[1], size[0])
