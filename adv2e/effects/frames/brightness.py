"""Limit of the brightness of a frame.

The corner of the low-pass rises with the light, and with it the steps that a pixel takes: 3 ms for
each frame interval of 10 ms at a thousand times white, which a frame in other units or a single
broken number multiplies at will.  Brighter light is refused, whatever its source: the numbers of a
frame, an encoding, an effect, an interpolation.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from adv2e.errors import DataError
from adv2e.ticks import check_time

if TYPE_CHECKING:
    from adv2e.effects.hooks import Frames

UNSTATED = 16.0
"""Floats so many times white are refused where nobody said what white is."""

BRIGHTEST = 1000.0
"""Light so many times white is the most that is simulated."""

_WHITE = 255.0


def check_white(largest: float, label: str, full_scale: float | None) -> None:
    """Refuse floats far above white (DataError), unless a `full_scale` was said to be white."""
    if full_scale is None and largest > UNSTATED:
        raise DataError(
            f"{label}: floats up to {largest:g}, where 1 is white; say what is, with"
            " frames.full_scale=255 or another number (1, if they are right)"
        )


_BITS = {8: (1, 4), 16: (8, 10, 12, 14)}
"""Bit depths of cameras, by the width of the integers in whose lower bits they lie."""

_USUAL = 12


def doubt_of_white(largest: float, dtype: DTypeLike, label: str) -> str:
    """Return a warning if the largest whole number is far below white, else ''."""
    whole = 8 * np.dtype(dtype).itemsize
    fitting = [bits for bits in _BITS.get(whole, ()) if largest < 1 << bits]
    if np.dtype(dtype).kind != "u" or not fitting or largest <= 0:
        return ""
    likely = _USUAL if _USUAL in fitting else fitting[0]
    others = [f"{(1 << bits) - 1} for {bits}" for bits in fitting if bits != likely]
    others.append(f"{(1 << whole) - 1}, if they are right")
    having = f"{likely} bit{'s' if likely > 1 else ''}"
    return (
        f"{label}: whole numbers up to {largest:g}, where {(1 << whole) - 1} is white; if they have"
        f" {having}, say frames.full_scale={(1 << likely) - 1} ({'; '.join(others)})"
    )


def check_floats(image: NDArray[Any], label: str, full_scale: float | None) -> None:
    """Apply :func:`check_white` to a frame as read, if it holds floats."""
    if image.dtype.kind == "f" and image.size:
        check_white(float(image.max()), label, full_scale)


def bounded(frames: Frames, table: NDArray[np.float32] | None, begin: int = 0) -> Frames:
    """Yield (t_ns, light) as they come, light and time of each looked at; names a frame it refuses.

    `table`: light [DN] of the values of frames that are not decoded yet; `begin`: number of the
    first.
    """
    harmless = table is not None and float(table.max()) <= BRIGHTEST * _WHITE
    for number, (t_ns, light) in enumerate(frames, begin):
        check_time(t_ns, f"frame {number}")
        if not harmless:
            check_light(light if table is None else table.take(light), f"frame {number}")
        yield t_ns, light


def check_light(light: NDArray[Any], label: str) -> None:
    """Raise DataError unless all light [DN] is finite and at most `BRIGHTEST` times white."""
    if not light.size:
        return
    low, high = float(light.min()), float(light.max())
    if not (math.isfinite(low) and math.isfinite(high)):
        raise DataError(
            f"{label}: its light is {low if not math.isfinite(low) else high}; it must be a"
            " finite number (see frames.encoding, frames.full_scale and the effects)"
        )
    if low < 0:
        raise DataError(f"{label}: light of {low:g} DN; light cannot be negative")
    if high > BRIGHTEST * _WHITE:
        row, column = np.unravel_index(int(light.argmax()), light.shape)
        raise DataError(
            f"{label}: light {high / _WHITE:.4g} times white at x {column}, y {row};"
            f" {BRIGHTEST:g} is the most that is simulated: say with frames.full_scale which number"
            " is white, or clip the frames"
        )
