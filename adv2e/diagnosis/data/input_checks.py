"""Checks of a recording for mistakes: dark frames, gaps, missing pixels, mirrored frames."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from adv2e.diagnosis.data.scene import Placed, Scene

_WHITE_DN = 255.0
_DIM = 0.01
"""Share of white that the brightest light of frames has at least."""
_GAP = 5.0
"""Factor on the usual interval between frames from which on some are missing."""
_EMPTY = 0.2
"""Share of the columns, or rows, without any event."""
_LEAST_EVENTS = 200
"""In motion, to tell what they go with."""
_BACKWARD = -0.2
"""Correlation of events with changes of light from which on polarities count as swapped."""
_MIRRORED = 0.25
"""Gain in that correlation from which on frames count as mirrored."""


def check_inputs(measured: Placed, scene: Scene, light: NDArray[np.float32]) -> list[str]:
    """Return warnings about a recording, a line each.

    From its events, and the light of its frames [DN], (frames, rows, columns).
    """
    dark = _brightness(
        light,
        "the frames are all the same: nothing that moves can be simulated from them, so only noise"
        " can be judged",
        "the brightest light of the frames is {:.2g} of white: is frames.full_scale right?",
    )
    found = [*dark[:1], *_gaps(scene.times_us), *_unseen(measured, scene)]
    direction = _direction(measured, scene)
    return [*found, direction] if direction else found


def check_known_light(measured: Placed, scene: Scene, light: NDArray[np.float32]) -> list[str]:
    """Return warnings about a recording of known light, as :func:`check_inputs` does."""
    found = _brightness(
        light,
        "the light never changes: it tells of noise, and of nothing else",
        "the brightest light is {:.2g} of white: is its unit right? light_dn has 255 for white,"
        " light has 1",
    )
    if _direction(measured, scene).startswith("ON"):
        found.append(
            "ON events come where the light falls: are polarities, or the light, inverted?"
        )
    return found


def _brightness(light: NDArray[np.float32], is_still: str, is_dim: str) -> list[str]:
    """Return what to say of light that never changes, and of light that is dim."""
    brightest = float(light.max()) / _WHITE_DN
    found = [is_still] if np.all(light == light[0]) else []
    return [*found, is_dim.format(brightest)] if brightest < _DIM else found


def _gaps(times_us: NDArray[np.float64]) -> list[str]:
    intervals = np.diff(times_us)
    return [
        f"no frames from {times_us[k] / 1e6:.3f} to {times_us[k + 1] / 1e6:.3f} s: what moves there"
        " is made up, so look at the time before or after it (--start, --stop)"
        for k in np.flatnonzero(intervals > _GAP * np.median(intervals))[:3]
    ]


def _unseen(measured: Placed, scene: Scene) -> list[str]:
    """Return the sides of the sensor from which no event came."""
    rows, columns = np.divmod(measured.stream.pixel, scene.width)
    lines = []
    for name, places, size in (("x", columns, scene.width), ("y", rows, scene.height)):
        last = int(places.max())
        if size - 1 - last >= max(2.0, _EMPTY * size):
            lines.append(
                f"no event has {name} above {last}, but the frames have {size} pixels there: do"
                " they show the same?"
            )
    return lines


def _direction(measured: Placed, scene: Scene) -> str:
    """Check for mirrored frames or swapped polarity by correlating events with changes of light.

    The correlation is the sum of the changes of log light at the events, with the sign of their
    polarity, over the sum of their sizes.
    """
    stream = measured.stream
    shape = scene.intervals, scene.height, scene.width
    slope = scene.slope.reshape(shape)
    row, column = np.divmod(stream.pixel, scene.width)
    sign = 2.0 * stream.on - 1.0

    def agreement(change: NDArray[np.float32]) -> float:
        at = change[measured.interval, row, column]
        size = float(np.abs(at).sum())
        moving = int(np.count_nonzero(at))
        return float((sign * at).sum()) / size if moving >= _LEAST_EVENTS else 0.0

    as_is = agreement(slope)
    if as_is <= _BACKWARD:
        return "ON events come where the light falls: are polarities, or the frames, inverted?"
    ways = {
        "left to right": slope[:, :, ::-1],
        "upside down": slope[:, ::-1],
        "by half a turn": slope[:, ::-1, ::-1],
    }
    best = max(ways, key=lambda name: agreement(ways[name]))
    if agreement(ways[best]) > as_is + _MIRRORED:
        return f"the events go better with the frames turned {best}: is one of them mirrored?"
    return ""
