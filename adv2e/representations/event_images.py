r"""The six channels of Ev-SegNet: counts, mean and deviation of times, of each polarity.

========= ================================= ============ =====
channel   what                              range        empty
========= ================================= ============ =====
0, 1      events, ON and OFF                -1 ... 1     -1
2, 3      mean and deviation of times, ON   -1...1, 0..1 0
4, 5      mean and deviation of times, OFF  -1...1, 0..1 0
========= ================================= ============ =====

This is the order of the data that was released, which the article prints in another one.  Times run
from -1 at the start of the window to 1 at its end.  Counts are divided by the largest of both
polarities, so that it becomes 1: how the released ones were scaled was not published.  The
deviation is that of all events (divided by their number), which lies within 0 to 1.

References
----------
.. [1] I. Alonso, A. C. Murillo, "EV-SegNet: Semantic Segmentation for Event-based Cameras", CVPRW
   2019, arXiv:1811.12039; github.com/Shathe/Ev-SegNet.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from adv2e.events import Events, Window, pixels_of


def event_image(
    events: Events, size: tuple[int, int], window: Window, *, scale_counts: bool = True
) -> NDArray[np.float32]:
    """Return the six channels of the events of a window.

    Parameters
    ----------
    events : array of EVENT_DTYPE
        Inside the window and the sensor.
    size : (int, int)
        Width and height of the sensor [pixels].
    window : (int, int)
        Its start and stop [us].
    scale_counts : bool
        Counts are scaled to -1 ... 1; else they are what was counted.

    Returns
    -------
    (rows, columns, 6) array of float32
    """
    (width, height), (start, stop) = size, window
    image = np.zeros((height, width, 6))
    place = 2.0 * (events["t"] - start) / max(stop - start, 1) - 1.0
    pixels = pixels_of(events, width)
    for half, channels in ((1, (0, 2, 3)), (0, (1, 4, 5))):
        chosen = events["p"] == half
        where, when = pixels[chosen], place[chosen]
        number = np.bincount(where, minlength=width * height)
        most = np.maximum(number, 1)
        mean = np.bincount(where, when, width * height) / most
        # about the mean, as the difference of two squares would lose digits
        spread = np.bincount(where, (when - mean[where]) ** 2, width * height) / most
        for channel, values in zip(channels, (number, mean, np.sqrt(spread)), strict=True):
            image[..., channel] = values.reshape(height, width)
    if scale_counts:
        image[..., :2] = 2 * image[..., :2] / max(image[..., :2].max(), 1) - 1
    return image.astype(np.float32)
