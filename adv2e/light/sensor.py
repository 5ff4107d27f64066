"""Frames brought to the size of the sensor, in linear light, before anything else sees them.

A pixel of the sensor sees the mean of the light on its area.  A pixel of the frame is taken for a
square of constant light, whether the sensor's pixels are larger than those squares or smaller, so
that one rule holds at every size: no light is made up, none is lost, and what is constant stays as
it is to the last bit.  Enlarged frames show their squares; no detail is invented.

Frames come first to the sensor, then to the effects on their light: shifts are counted in pixels of
the sensor, blur and lamps are those of its pixels, and frames that were stored beside events, which
have the sensor's size, go the same way.

The share that each square has in each pixel is a whole number of a common unit.  Products with
light of 24 bits and their sums over one axis are so exact in float64 for any constant, and all else
is rounded the same way everywhere: NumPy adds in the order written here, with one thread.
"""

from __future__ import annotations

from copy import copy
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.config.model import Sensor
from adv2e.effects.frames.brightness import check_light
from adv2e.errors import DataError
from adv2e.geometry import Size
from adv2e.sources.paths import SensorPath

_BLOCK = 1 << 16
"""Numbers worked on at a time; they stay in the cache, and in memory that is used again."""


class _Axis:
    """Means over the pixels of one axis of the sensor.

    Parameters
    ----------
    count : int
        Pixels of the frame.
    size : int
        Pixels of the sensor.
    scale : Fraction
        Pixels of the sensor that a pixel of the frame spans.
    offset : Fraction
        From the middle of the frame to that of the sensor [pixels of the sensor].
    """

    def __init__(self, count: int, size: int, scale: Fraction, offset: Fraction) -> None:
        begin = (count - size / scale) / 2 + offset / scale
        step = 1 / scale
        unit = np.lcm(begin.denominator, step.denominator)
        # of the sensor's pixels, in that share of a pixel of the frame
        edges = int(begin * int(unit)) + int(step * int(unit)) * np.arange(size + 1, dtype=np.int64)
        first, behind = edges[:-1] // unit, -(-edges[1:] // unit)
        taps = np.arange(int((behind - first).max()))[:, np.newaxis]
        number = first + taps
        shares = np.minimum((number + 1) * unit, edges[1:]) - np.maximum(number * unit, edges[:-1])
        shares[(number < 0) | (number >= count)] = 0  # black
        numbers = np.clip(number, 0, count - 1)
        self.used = slice(int(numbers.min()), int(numbers.max()) + 1)
        self._numbers = numbers - self.used.start
        self._shares = np.maximum(shares, 0).astype(np.float64)
        self._whole = float(step * int(unit))

    def means(
        self, light: NDArray[Any], axis: int, part: slice = slice(None)
    ) -> NDArray[np.float64]:
        """Return the means of `light` along an axis, of which it is what is `used`.

        One for each pixel of the sensor, or for a `part` of them.
        """
        across = (slice(None), np.newaxis) if axis == 0 else (np.newaxis, slice(None))
        found: NDArray[np.float64] | None = None
        for numbers, shares in zip(self._numbers[:, part], self._shares[:, part], strict=True):
            seen = np.multiply(light.take(numbers, axis=axis), shares[across])
            found = seen if found is None else np.add(found, seen, out=found)
        assert found is not None
        found /= self._whole
        return found


class Fitting:
    """Mapping of frames of one size to a sensor of another: crop, pad or stretch.

    Parameters
    ----------
    sensor : Sensor
        The section of the configuration.
    label : str
        Name of the source of the frames, for messages.
    margin : int
        Pixels that a sensor that moves needs on each side.

    Raises
    ------
    DataError
        They do not have its size and `sensor.fit` is none, or next to nothing of them would be
        left.
    """

    def __init__(self, frames: Size, sensor: Sensor, label: str, margin: int = 0) -> None:
        self.frames, self.size = frames, Size(sensor.width, sensor.height)
        self._fit = sensor.fit
        needed = Size(sensor.width + 2 * margin, sensor.height + 2 * margin)
        if sensor.fit == "none" and frames != needed:
            way = " with its way" if margin else ""
            raise DataError(
                f"{label}: frames are {frames}, but the sensor is {needed}{way} and sensor.fit is"
                " none; say crop, pad or stretch, or give it their size"
            )
        across = Fraction(needed.width, frames.width)
        down = Fraction(needed.height, frames.height)
        if sensor.fit == "crop":
            across = down = max(across, down)
        elif sensor.fit == "pad":
            across = down = min(across, down)
        self._scaled = Size(
            max(1, round(frames.width * across)), max(1, round(frames.height * down))
        )
        axes = zip(frames, self.size, (across, down), strict=True)
        for count, size, scale in axes:
            seen, filled = size / scale, count * scale
            if sensor.fit == "crop" and seen < 1 < count:
                raise DataError(
                    f"{label}: sensor.fit crop: of frames of {frames}, a sensor of {self.size}"
                    f" would see {float(seen):.2g} of a pixel; say pad or stretch"
                )
            if sensor.fit == "pad" and filled < 1 < size:
                raise DataError(
                    f"{label}: sensor.fit pad: frames of {frames} would fill {float(filled):.2g} of"
                    f" a pixel of a sensor of {self.size}; say crop or stretch"
                )
        self._scales = across, down
        self._look(0.0, 0.0)

    def _look(self, right: float, down: float) -> None:
        pairs = zip(self.frames, self.size, self._scales, (right, down), strict=True)
        self._columns, self._rows = (
            _Axis(count, size, scale, Fraction(offset)) for count, size, scale, offset in pairs
        )

    def moved(self, offset: tuple[float, float]) -> Fitting:
        """Return the mapping for a sensor that is moved to the right and down [its pixels]."""
        moved = copy(self)
        moved._look(*offset)
        return moved

    def light(self, light: NDArray[Any], label: str) -> NDArray[np.float32]:
        """Return the light [DN] on the sensor for a frame, (rows, columns).

        Raises
        ------
        DataError
            The light is too bright or not finite; the text begins with `label`.
        """
        check_light(light, label)
        return self.plane(light)

    def plane(self, light: NDArray[Any]) -> NDArray[np.float32]:
        """Return the light on the sensor without a check of its range; also for shares of light."""
        # `take` would copy all of a part again and again
        single = np.ascontiguousarray(light[self._rows.used, self._columns.used], np.float32)
        seen = np.empty((self.size.height, self.size.width), np.float32)
        step = max(1, _BLOCK // single.shape[1])
        for first in range(0, self.size.height, step):
            part = slice(first, first + step)
            seen[part] = self._columns.means(self._rows.means(single, 0, part), 1)
        return seen

    def placement(self) -> dict[str, Any]:
        """Return the mapping from frame to sensor, the sensor being in the middle of its path.

        A point at (column, row) of the frame, from its upper left corner, lies at
        ``scale * (column, row) - scale * origin`` on the sensor.
        """
        pairs = zip(self.frames, self.size, self._scales, strict=True)
        origin = [float((count - size / scale) / 2) for count, size, scale in pairs]
        scale = [float(one) for one in self._scales]
        return {"fit": self._fit, "scale": scale, "origin": origin, "text": self.text()}

    def text(self) -> str:
        """Return the mapping in words, to follow the size of the frames and a comma."""
        if self._fit == "stretch":
            return f"stretched to {self.size}"
        scaled = "" if self._scaled == self.frames else f"scaled to {self._scaled}"
        if self._scaled == self.size:
            return scaled
        if self._fit == "pad":
            return f"{scaled}{', ' if scaled else ''}the rest of {self.size} is black"
        return f"{scaled}{' and ' if scaled else ''}cut to {self.size}"


def fitting_of(
    width: int, height: int, sensor: Sensor | None, label: str, along: SensorPath | None = None
) -> Fitting | None:
    """Return the mapping of frames to the sensor; None if frames have the size of the sensor.

    A sensor that moves `along` a path sees all of the frames on its way; without a size of its own
    it has one that just fits.

    Raises
    ------
    DataError
        See :class:`Fitting`; or frames without pixels, or too few for the path.
    """
    if along is not None:
        margin = along.margin
        left = Size(width - 2 * margin, height - 2 * margin)
        if sensor is None and min(left) < 1:
            raise DataError(
                f"{label}: {width}x{height} pixels are too few for a path of {along.extent:g}"
                " pixels; give a smaller --extent, or a larger picture"
            )
        sensor = sensor or Sensor(width=left.width, height=left.height)
        return Fitting(Size(width, height), sensor, label, margin)
    if sensor is None or (width, height) == (sensor.width, sensor.height):
        return None
    if min(width, height) < 1:
        raise DataError(f"{label}: frames of {width}x{height} pixels")
    return Fitting(Size(width, height), sensor, label)


def check_beside(width: int, height: int, sensor: Sensor | None, label: str) -> None:
    """Refuse a recording whose events are not of the sensor that is declared (DataError).

    Frames beside measured events are on the sensor already: scaled, they would lie elsewhere than
    the events.
    """
    if sensor is not None and (width, height) != (sensor.width, sensor.height):
        raise DataError(
            f"{label}: events of {width}x{height} pixels, but the configuration says a sensor of"
            f" {sensor.width}x{sensor.height}; frames beside measured events are never scaled: give"
            " the configuration of this camera, or --set sensor=null if this is a part of it"
        )
