r"""The time surface: how long ago each pixel sent its last event, of each polarity.

.. math::
    S(p, y, x) = \exp(-(t - t_{last}(p, y, x))/\tau)

Pixels that sent none are 0.  Events of earlier windows count, too.

References
----------
.. [1] X. Lagorce et al., "HOTS: A hierarchy of event-based time-surfaces for pattern recognition",
   IEEE TPAMI 39(7), 2017, doi:10.1109/TPAMI.2016.2574707.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from adv2e.events import Events, pixels_of


class TimeSurface:
    """The last events of all pixels, to which later ones are added.

    Parameters
    ----------
    size : (int, int)
        Width and height of the sensor [pixels].
    tau_us : float
        Time in which it falls to 1/e [us].
    """

    def __init__(self, size: tuple[int, int], tau_us: float) -> None:
        self._size, self._tau_us = size, tau_us
        self._last = np.full(2 * size[0] * size[1], -np.inf)

    def at(self, events: Events, t_us: int) -> NDArray[np.float32]:
        """Add events, sorted by time and none after `t_us`; return the surface at that time [us].

        Returns
        -------
        (2, rows, columns) array of float32
            OFF and ON.
        """
        width, height = self._size
        # of several events of a pixel, the last one stays
        self._last[events["p"] * np.int64(width * height) + pixels_of(events, width)] = events["t"]
        surface = np.exp((self._last - t_us) / self._tau_us)
        return surface.astype(np.float32).reshape(2, height, width)
