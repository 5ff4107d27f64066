"""Lines in the rate of the whole sensor, as lamps on the mains make."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.diagnosis.data.scene import Placed, Scene
from adv2e.diagnosis.statistics.groups import Array, Entry, Group, counts, exponential

BIN_US = 1000
_BANDS_HZ = ((30, 90), (90, 99), (99, 101), (101, 119), (119, 121), (121, 240), (240, 490))


def keeps_time(hz: NDArray[Any], scene: Scene) -> NDArray[np.bool_]:
    """Return a mask of the frequencies [Hz] near whole multiples of the frame rate."""
    rate = 1e6 * scene.intervals / (scene.times_us[-1] - scene.times_us[0])
    near = np.abs(hz / rate - np.round(hz / rate)) * rate <= 1.5
    return np.asarray(near & (hz >= rate - 2.0))


def prominence(rate: NDArray[Any], reach: int, padding: int = 1) -> Array:
    """Return the prominence of spectral lines of rates, (..., bins), as logarithms.

    Power less the median of that of `reach` frequencies to each side, of which there are `padding`
    times as many as without zeros behind the rate, (..., padding x bins // 2 + 1).
    """
    bins = rate.shape[-1]
    centred = (rate - rate.mean(axis=-1, keepdims=True)) * np.hanning(bins)
    log = np.log(np.abs(np.fft.rfft(centred, padding * bins)) ** 2 + 1.0)
    number = np.arange(log.shape[-1])
    around = np.pad(number, reach, mode="reflect")[number[:, None] + np.arange(2 * reach + 1)]
    # of an odd number of finite values: faster than NumPy's median, which asks for more
    return np.asarray(log - np.partition(log[..., around], reach, axis=-1)[..., reach])


def spectrum(scene: Scene) -> Group:
    """Return the strongest lines of all events, and of ON less OFF, in bands of frequency."""
    start = scene.times_us[0]
    bins = max(64, int((scene.times_us[-1] - start) // BIN_US))
    hz = np.fft.rfftfreq(bins, BIN_US * 1e-6)
    reach = max(3, int(np.searchsorted(hz, 12.0)))
    # what keeps time with the frames has statistics of its own
    free = ~keeps_time(hz, scene)
    bands = [np.flatnonzero((hz >= low) & (hz <= high) & free) for low, high in _BANDS_HZ]
    entries = [
        Entry(
            f"line in the {kind} rate, {low}-{high} Hz",
            f"power of the strongest frequency from {low} to {high} Hz in the rate of {of} events,"
            " over the median power of its neighbours",
            "times that power",
            exponential,
        )
        for kind, of in (("total", "all"), ("signed", "ON less OFF"))
        for low, high in _BANDS_HZ
    ]

    def count(placed: Placed) -> Array:
        stream = placed.stream
        step = np.clip(((stream.t - start) / BIN_US).astype(np.int64), 0, bins - 1)
        signed = counts(placed.part, step, bins, 2.0 * stream.on - 1.0)
        return np.concatenate([counts(placed.part, step, bins), signed], axis=1)

    def values(raw: Array) -> Array:
        lines = prominence(raw.reshape(2, -1), reach)
        return np.array(
            [line[band].max() if band.size else 0.0 for line in lines for band in bands]
        )

    return Group("frequencies in the rate", 0.2, entries, count, values)
