r"""Analytic scenes: light as a function of time and place.

The logarithm of the light is a sum of waves that move rigidly, region by region,

.. math:: \ln DN(u, t) = b(u) + \sum_r m_r(u) \sum_k a_k \cos(k \cdot (u - p_r(t)) + \varphi_k),

pressed smoothly into a range, with soft-edged bars and disks laid over it.  b is still,
m_r says where region r is, p_r(t) is how far it has moved.  A region whose p_r stands is a still
part.  Everything is smooth in time and place; no table, no resampling.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Motion = Callable[[Array], Array]
"""Displacement [px] at times [s]; same shape."""


def steady(speed: float) -> Motion:
    """Return the motion at constant `speed` [px/s]."""
    return lambda t: speed * t


def stop_and_go(speed: float, go_s: float, rest_s: float, *, first_s: float = 0.0) -> Motion:
    """Return a motion that goes for `go_s`, rests for `rest_s`, comes back, rests, and so on.

    While it goes its mean speed is `speed` [px/s], its greatest one twice that; both ends are
    smooth: p = speed go_s (v - sin(2 pi v)/(2 pi)), v running from 0 to 1.
    """

    def displacement(t: Array) -> Array:
        turn, phase = np.divmod(t - first_s, go_s + rest_s)
        v = np.clip(phase / go_s, 0.0, 1.0)
        done = v - np.sin(2 * np.pi * v) / (2 * np.pi)
        back = np.mod(turn, 2) == 1
        return speed * go_s * np.where(back, 1.0 - done, done)

    return displacement


class View(ABC):
    """A scene as seen by the pixels of one grid."""

    @abstractmethod
    def light(self, times: Array) -> Array:
        """Return the light [DN of 255] at `times` [s]: (times, pixels), row after row."""


class AnyScene(ABC):
    """Something to see."""

    @abstractmethod
    def view(self, columns: Array, rows: Array) -> View:
        """Return the scene at the places of a grid of `columns` and `rows` [px]."""


@dataclass(frozen=True)
class Flat(AnyScene):
    """The same light everywhere: `course` gives it [DN] at times [s]."""

    course: Callable[[Array], Array]

    def view(self, columns: Array, rows: Array) -> View:
        return _FlatView(self.course, len(columns) * len(rows))


@dataclass(frozen=True)
class _FlatView(View):
    course: Callable[[Array], Array]
    pixels: int

    def light(self, times: Array) -> Array:
        course = np.broadcast_to(self.course(times), times.shape)
        return np.repeat(course[:, None], self.pixels, axis=1)


@dataclass(frozen=True)
class Still(AnyScene):
    """Light that depends on the place alone: `course` gives it [DN] at (columns, rows) [px]."""

    course: Callable[[Array, Array], Array]

    def view(self, columns: Array, rows: Array) -> View:
        shape = (len(rows), len(columns))
        picture = np.broadcast_to(self.course(columns[None, :], rows[:, None]), shape)
        return _StillView(picture.ravel())


@dataclass(frozen=True)
class _StillView(View):
    picture: Array

    def light(self, times: Array) -> Array:
        return np.repeat(self.picture[None, :], len(times), axis=0)


@dataclass(frozen=True, kw_only=True)
class Region:
    """A part of the scene with a texture that moves by itself.

    Attributes
    ----------
    mask : callable
        Weight of the region, 0 to 1, at (columns, rows) [px].
    motion : pair of callables
        Displacement in columns and rows.
    waves : (waves, 4) array
        Angular frequency in columns and rows [rad/px], amplitude [ln], phase [rad].
    """

    mask: Callable[[Array, Array], Array]
    motion: tuple[Motion, Motion]
    waves: Array


@dataclass(frozen=True, kw_only=True)
class Disk:
    """A disk: path of its middle and radius [px], light [DN], width of its soft edge [px]."""

    path: tuple[Motion, Motion]
    radius: float
    light: float
    edge: float = 2.0

    def cover(self, logarithm: Array, times: Array, columns: Array, rows: Array) -> None:
        """Lay the disk over `logarithm` (times, rows, columns)."""
        x, y = self.path[0](times), self.path[1](times)
        reach = self.radius + self.edge
        i = _between(columns, x.min() - reach, x.max() + reach)
        j = _between(rows, y.min() - reach, y.max() + reach)
        part = logarithm[:, j, i]
        if part.size:
            away = np.hypot(
                columns[None, None, i] - x[:, None, None], rows[None, j, None] - y[:, None, None]
            )
            part += _inside(self.radius - away, self.edge) * (np.log(self.light) - part)


@dataclass(frozen=True, kw_only=True)
class Bar:
    """An upright bar of any height: path of its middle and half its width [px], light [DN]."""

    path: Motion
    half: float
    light: float
    edge: float = 2.0

    def cover(self, logarithm: Array, times: Array, columns: Array, rows: Array) -> None:
        """Lay the bar over `logarithm` (times, rows, columns)."""
        x = self.path(times)
        reach = self.half + self.edge
        i = _between(columns, x.min() - reach, x.max() + reach)
        part = logarithm[:, :, i]
        if part.size:
            away = np.abs(columns[None, i] - x[:, None])
            inside = _inside(self.half - away, self.edge)[:, None, :]
            part += inside * (np.log(self.light) - part)


def _between(places: Array, low: float, high: float) -> slice:
    """Return where the rising `places` lie between `low` and `high`."""
    return slice(int(np.searchsorted(places, low)), int(np.searchsorted(places, high, "right")))


def _inside(depth: Array, edge: float) -> Array:
    """Return how much of a pixel at `depth` [px] inside is covered: smooth from 0 to 1."""
    v = np.clip(0.5 + depth / edge, 0.0, 1.0)
    return v * v * (3.0 - 2.0 * v)


@dataclass(frozen=True, kw_only=True)
class Scene(AnyScene):
    """Still background, moving regions and things over them.

    Attributes
    ----------
    background : callable
        Logarithm of the light [ln DN] at (columns, rows) [px].
    regions, things : sequences
    between : (float, float) or None
        Darkest and brightest light of background and regions together [DN].
    """

    background: Callable[[Array, Array], Array]
    regions: Sequence[Region] = ()
    things: Sequence[Disk | Bar] = ()
    between: tuple[float, float] | None = None

    def view(self, columns: Array, rows: Array) -> View:
        return _SceneView(self, columns, rows)


class _SceneView(View):
    """Waves as a matrix: cos(k.(u - p) + f) = cos(k.u + f) cos(k.p) + sin(k.u + f) sin(k.p)."""

    def __init__(self, scene: Scene, columns: Array, rows: Array) -> None:
        self._scene, self._columns, self._rows = scene, columns, rows
        x, y = columns[None, :], rows[:, None]
        shape = (len(rows), len(columns))
        self._background = np.broadcast_to(scene.background(x, y), shape).ravel()
        basis = []
        for region in scene.regions:
            mask = np.broadcast_to(region.mask(x, y), shape).ravel()
            for kx, ky, amplitude, phase in region.waves:
                angle = (kx * x + ky * y + phase).ravel()
                basis += [amplitude * mask * np.cos(angle), amplitude * mask * np.sin(angle)]
        self._basis = np.array(basis).reshape(len(basis), -1)

    def light(self, times: Array) -> Array:
        weights = np.empty((len(times), len(self._basis)))
        at = 0
        for region in self._scene.regions:
            px, py = region.motion[0](times), region.motion[1](times)
            for kx, ky, _, _ in region.waves:
                weights[:, at] = np.cos(kx * px + ky * py)
                weights[:, at + 1] = np.sin(kx * px + ky * py)
                at += 2
        logarithm = weights @ self._basis
        logarithm += self._background
        if self._scene.between is not None:
            _press(logarithm, *np.log(self._scene.between).tolist())
        picture = logarithm.reshape(len(times), len(self._rows), len(self._columns))
        for thing in self._scene.things:
            thing.cover(picture, times, self._columns, self._rows)
        return np.exp(logarithm, out=logarithm)


def _press(v: Array, low: float, high: float) -> None:
    """Press `v` smoothly into low..high, in place; its slope is 1 in the middle."""
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    v -= middle
    v /= half
    np.tanh(v, out=v)
    v *= half
    v += middle
