"""Lines in the rate of events that a lamp may have made."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.diagnosis.data.scene import Scene
from adv2e.diagnosis.data.stream import Stream
from adv2e.diagnosis.statistics.spectrum import Spectrum, keeps_time, prominence

_LOWEST_HZ = 30.0
_LEAST_BINS = 16
_PADDING = 8
_BESIDE = 16 * _PADDING
_MOST = 2
_APART_HZ = 5.0
_SAME_HZ = 2.0


def strongest_lines(stream: Stream, pilot: Sequence[Stream], scene: Scene) -> tuple[float, ...]:
    """Return the frequencies [Hz] of the lines of a stream that stand out of simulations' lines.

    At least the strongest one is returned, whatever it is worth; none if the recording is too short
    to have any.  What keeps time with the frames is a line in simulations, too, for what happens
    between frames is made up: there a line must stand out of theirs at the same frequency.

    Parameters
    ----------
    stream : Stream
    pilot : sequence of Stream
        Simulations of the declared model.
    scene : Scene
    """
    spectra = [_Heights.of(one, scene) for one in pilot]
    if not spectra or not spectra[0].hz.size:
        return ()
    usual = max((height for one in spectra for _, height in one.peaks(~one.locked)), default=0.0)
    measured = _Heights.of(stream, scene)
    free = measured.peaks(~measured.locked)
    there = np.max([one.height for one in spectra], axis=0)
    stands_out = measured.locked & (measured.height > np.maximum(there, usual))
    locked = measured.peaks(stands_out)
    found = sorted([*free, *locked], key=lambda line: -line[1])
    return tuple(hz for k, (hz, height) in enumerate(found) if k == 0 or height > usual)


class _Heights:
    """How far the power of a rate is above that of the frequencies beside, as a logarithm.

    Attributes
    ----------
    hz : (n,)
    height : (2, n)
        Of all events, and of ON less OFF.
    locked : (2, n) bool
        What keeps time with the frames.
    """

    def __init__(self, hz: NDArray[Any], height: NDArray[np.float64], scene: Scene) -> None:
        self.hz, self.height = hz, height
        self.locked = np.broadcast_to(keeps_time(hz, scene), height.shape)

    @classmethod
    def of(cls, stream: Stream, scene: Scene) -> _Heights:
        start, bin_us = scene.times_us[0], Spectrum.BIN_US
        bins = int((scene.times_us[-1] - start) // bin_us)
        if bins < _LEAST_BINS:
            return cls(np.empty(0), np.empty((2, 0)), scene)
        hz = np.fft.rfftfreq(_PADDING * bins, bin_us * 1e-6)
        step = np.minimum((stream.t - start) // bin_us, bins - 1).astype(np.int64)
        heights = [
            prominence(np.bincount(step, sign, minlength=bins), _BESIDE, _PADDING)
            for sign in (np.ones(len(stream)), 2.0 * stream.on - 1.0)
        ]
        above = hz > _LOWEST_HZ
        return cls(hz[above], np.array(heights)[:, above], scene)

    def peaks(self, where: NDArray[np.bool_]) -> list[tuple[float, float]]:
        """Return frequency and height of the strongest lines there, the strongest first."""
        found: list[tuple[float, float]] = []
        for height in np.where(where, self.height, -np.inf):
            for _ in range(_MOST):
                best = int(np.argmax(height))
                if np.isneginf(height[best]):
                    break
                line = float(self.hz[best]), float(height[best])
                same = [k for k, (hz, _) in enumerate(found) if abs(hz - line[0]) <= _SAME_HZ]
                if not same:
                    found.append(line)
                elif line[1] > found[same[0]][1]:  # it stands out more of ON less OFF
                    found[same[0]] = line
                height[np.abs(self.hz - self.hz[best]) < _APART_HZ] = -np.inf
        return sorted(found, key=lambda line: -line[1])
