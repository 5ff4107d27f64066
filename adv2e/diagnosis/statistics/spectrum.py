"""Lines in the rate of events, as lamps on the mains make."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.diagnosis.data.scene import Placed, Scene
from adv2e.diagnosis.statistics.base import Entry, Raw, counts


def keeps_time(hz: NDArray[Any], scene: Scene) -> NDArray[np.bool_]:
    """Tell which frequencies [Hz] are near whole multiples of the frame rate."""
    rate = 1e6 * scene.intervals / (scene.times_us[-1] - scene.times_us[0])
    near = np.abs(hz / rate - np.round(hz / rate)) * rate <= 1.5
    return np.asarray(near & (hz >= rate - 2.0))


def prominence(rate: NDArray[Any], reach: int, padding: int = 1) -> NDArray[np.float64]:
    """Return by how much lines of a rate stand out, as logarithms.

    Parameters
    ----------
    rate : (bins,)
    reach : int
        So many frequencies to each side are beside one.
    padding : int
        Factor on the number of frequencies.

    Returns
    -------
    (padding x bins // 2 + 1,)
        Power less the median of that beside it.
    """
    window = np.hanning(len(rate))
    power = np.abs(np.fft.rfft((rate - rate.mean()) * window, padding * len(rate))) ** 2 + 1.0
    log = np.log(power)
    padded = np.pad(log, reach, mode="reflect")
    around = np.lib.stride_tricks.sliding_window_view(padded, 2 * reach + 1)
    return np.asarray(log - np.median(around, axis=1))


class Spectrum:
    """Lines in the rate of the whole sensor, as lamps on the mains make."""

    title = "lines in the rate"
    least = 0.2

    BIN_US = 1000
    _BANDS_HZ = ((30, 90), (90, 99), (99, 101), (101, 119), (119, 121), (121, 240), (240, 490))

    def __init__(self, scene: Scene) -> None:
        self._start = scene.times_us[0]
        self._bins = max(64, int((scene.times_us[-1] - self._start) // self.BIN_US))
        self.hz = np.fft.rfftfreq(self._bins, self.BIN_US * 1e-6)
        # what keeps time with the frames has statistics of its own
        self.free = ~keeps_time(self.hz, scene)

    @cached_property
    def entries(self) -> Sequence[Entry]:
        """The statistics, in order."""
        return [
            Entry(
                f"line in the {kind} rate, {low}-{high} Hz",
                f"strongest line of the {kind} rate between {low} and {high} Hz over what is"
                " beside it, as a logarithm",
            )
            for kind in ("total", "signed")
            for low, high in self._BANDS_HZ
        ]

    def count(self, placed: Placed) -> Raw:
        """Return the sums of a stream, (parts, numbers)."""
        stream = placed.stream
        step = ((stream.t - self._start) // self.BIN_US).astype(np.int64)
        step = np.clip(step, 0, self._bins - 1)
        total = counts(placed.part, step, self._bins)
        signed = counts(placed.part, step, self._bins, 2.0 * stream.on - 1.0)
        return np.concatenate([total, signed], axis=1)

    def values(self, raw: Raw) -> NDArray[np.float64]:
        """Return the statistics."""
        reach = max(3, int(np.searchsorted(self.hz, 12.0)))
        result = []
        for rate in raw.reshape(2, -1):
            line = prominence(rate, reach)
            for low, high in self._BANDS_HZ:
                band = line[(self.hz >= low) & (self.hz <= high) & self.free]
                result.append(float(band.max()) if band.size else 0.0)
        return np.array(result)
