"""View of a film: path, scale, turn, blur and screen through which a camera sees what is known.

A film is a video with times, or one picture before which the camera moves.  Its light on a pixel of
the sensor is

    255 DN (b + (1 - b) v^g),   v: number of the film, 0 ... 1, or 1 - v where it is inverted

blurred by a Gaussian, at the place of the film that the pixel sees.  That is found from the middle
of the sensor: turned, scaled, and moved by the path, a cubic B-spline over time for a picture, one
shift for a video.  The constant b is the light of a black screen and of the room on it, as a share
of white; the exponent g is the grey curve of the screen, relative to the film's numbers.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from adv2e.geometry import Size

Array = NDArray[np.float64]
Picture = NDArray[np.float32]

KNOT_NS = 5_000_000
"""Time between the knots of a path."""
STEP_NS = 2_000_000
"""Time between the instants at which the light of a picture is made; it is a line between them."""

_WHITE_DN = 255.0
_FINE = 4
"""Samples of the film to a pixel of the sensor, at least: between them the light is a line."""
_FARTHEST = 0.5
"""Share of the sensor's shorter side by which a path may leave the middle of the film."""


@dataclass(frozen=True)
class Unknown:
    """A number of a view: its range, and the change by which its derivative is taken.

    `log`: it is fitted as its logarithm, and `step` is one of that.
    """

    name: str
    unit: str
    meaning: str
    low: float
    high: float
    log: bool
    step: float

    def moved(self, value: float, by: float) -> float:
        """Return a value moved on the scale of the fit, and kept in its range."""
        value = value * math.exp(by) if self.log else value + by
        return float(min(max(value, self.low), self.high))


UNKNOWNS = (
    Unknown("scale", "", "pixels of the film to one of the sensor, relative", 0.5, 2.0, True, 0.02),
    Unknown("turn_rad", "rad", "turn of the film, clockwise", -0.5, 0.5, False, 0.03),
    Unknown(
        "blur_px",
        "px",
        "standard deviation of the blur, pixel's area included",
        0.2,
        8.0,
        True,
        0.25,
    ),
    Unknown("black", "", "light of black, as a share of white", 1e-3, 0.9, True, 0.25),
    Unknown("gamma", "", "exponent of the screen's grey curve", 0.4, 3.0, True, 0.15),
)
"""Numbers of a :class:`View` that are fitted besides its path."""


@dataclass(frozen=True)
class View:
    """How a camera sees a film; all of it is fitted.

    Attributes
    ----------
    path : (knots, 2)
        Control points of a spline: columns and rows from the middle of the film to what the middle
        of the sensor sees [px of the sensor].  One: it does not move.
    inverted : bool
        What is bright in the film was dark on the screen.
    """

    path: Array
    inverted: bool = False
    scale: float = 1.0
    turn_rad: float = 0.0
    blur_px: float = 0.5
    black: float = 0.1
    gamma: float = 1.0

    def moved(self, unknown: Unknown, by: float) -> View:
        value = unknown.moved(getattr(self, unknown.name), by)
        named: dict[str, Any] = {unknown.name: value}
        return replace(self, **named)


@dataclass(frozen=True)
class Films:
    """Films of several recordings of one camera, which lie side by side on one wide sensor.

    Attributes
    ----------
    pictures : sequence of (frames, rows, columns) float32
        Numbers of each film, 0 ... 1; one frame: a picture before which the camera moves.
    times_ns : (instants,) int64
        On the clock of the events.  Of a video, those of its frames.
    size : Size
        Of the sensor of one recording.
    """

    pictures: Sequence[NDArray[np.float32]]
    times_ns: NDArray[np.int64]
    size: Size

    @property
    def moves(self) -> bool:
        """Tell whether the camera moves before pictures."""
        return len(self.pictures[0]) == 1

    @property
    def span_us(self) -> tuple[int, int]:
        first, last = (self.times_ns[[0, -1]] // 1000).tolist()
        return int(first), int(last)

    @property
    def reach_px(self) -> float:
        """Farthest that a path may leave the middle [px of the sensor]."""
        return _FARTHEST * min(self.size)

    def of(self, chosen: slice) -> Films:
        return replace(self, pictures=self.pictures[chosen])

    @cached_property
    def knots_ns(self) -> Array:
        """Times of the knots of a path, (knots,)."""
        if not self.moves:
            return np.zeros(1)
        first, last = self.times_ns[[0, -1]].tolist()
        count = math.ceil((last - first) / KNOT_NS) + 3
        return np.asarray(first + (np.arange(count) - 1.0) * KNOT_NS)

    @cached_property
    def _basis(self) -> Array:
        """Share of each control point in the position at each instant, (instants, knots)."""
        if not self.moves:
            return np.ones((len(self.times_ns), 1))
        away = np.abs(self.times_ns[:, None] - self.knots_ns) / KNOT_NS
        near, far = (4 - 6 * away**2 + 3 * away**3) / 6, np.maximum(2 - away, 0) ** 3 / 6
        return np.asarray(np.where(away < 1, near, far))

    @cached_property
    def film_px(self) -> float:
        """Pixels of the film to one of the sensor, where the view's scale is one.

        A picture is smaller than the sensor if its border is to be seen; a video covers it.
        """
        if self.moves:
            return 1.0
        rows, columns = self.pictures[0].shape[1:]
        return float(min(columns / self.size.width, rows / self.size.height))

    def positions(self, view: View) -> Array:
        """Return where the middle of the sensor looks at each instant, (instants, 2) [px]."""
        return self._basis @ view.path

    def screen(self, view: View, picture: Picture) -> Picture:
        """Return the blurred light of a frame [share of white], finely sampled, with a border."""
        shown = 1.0 - picture if view.inverted else picture
        fine = self.fine
        border = math.ceil(self.reach_px * self.film_px + 4 * view.blur_px * self.film_px)
        padded = cv2.copyMakeBorder(shown, *(border,) * 4, cv2.BORDER_REPLICATE)
        rows, columns = padded.shape
        # a screen puts a line between the numbers of a picture; a video's are samples of a scene
        between = cv2.INTER_LINEAR if self.moves else cv2.INTER_CUBIC
        large = cv2.resize(padded, (columns * fine, rows * fine), interpolation=between)
        large = np.clip(large, 0.0, 1.0) ** view.gamma
        sd = view.blur_px * self.film_px * fine
        soft = cv2.GaussianBlur(large, (0, 0), sd, borderType=cv2.BORDER_REPLICATE)
        return np.asarray(view.black + (1.0 - view.black) * soft, np.float32)

    @property
    def fine(self) -> int:
        return max(1, round(_FINE / self.film_px))

    def seen(self, view: View, screen: Picture, position: Array) -> Picture:
        """Return what the sensor sees of a screen from one position, (rows, columns)."""
        size, fine = self.size, self.fine
        turn = self.film_px * view.scale * np.exp(1j * view.turn_rad)
        turned = np.array([[turn.real, -turn.imag], [turn.imag, turn.real]])
        middle = np.array([size.width - 1, size.height - 1]) / 2
        there = (np.array(screen.shape[::-1]) / fine - 1) / 2 + position * self.film_px
        matrix = np.column_stack([turned, there - turned @ middle]) * fine
        matrix[:, 2] += (fine - 1) / 2
        flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        return np.asarray(
            cv2.warpAffine(screen, matrix, size, flags=flags, borderMode=cv2.BORDER_REPLICATE)
        )

    def light(self, view: View) -> NDArray[np.float32]:
        """Return the light of all recordings side by side [DN], (instants, rows, columns)."""
        width, height = self.size
        light = np.empty((len(self.times_ns), height, width * len(self.pictures)), np.float32)
        positions = self.positions(view)
        for number, frames in enumerate(self.pictures):
            place = slice(number * width, (number + 1) * width)
            screen = self.screen(view, frames[0])
            for k, position in enumerate(positions):
                if k and not self.moves:
                    screen = self.screen(view, frames[k])
                light[k, :, place] = self.seen(view, screen, position)
        light *= _WHITE_DN
        return light
