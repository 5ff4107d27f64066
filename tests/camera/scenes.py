"""Ready-made scenes: of random shapes, each with dark and bright, fast, slow and still parts."""

from __future__ import annotations

import numpy as np

from camera.scene import Array, Bar, Disk, Motion, Region, Scene, steady, stop_and_go


def waves(
    rng: np.random.Generator, count: int, shortest: float, longest: float, rms: float
) -> Array:
    """Return a texture of `count` waves in all directions, `shortest` to `longest` px long.

    Amplitudes grow with length (1/f); together they deviate by `rms` [ln] from their mean.
    """
    length = shortest * (longest / shortest) ** ((np.arange(count) + rng.random(count)) / count)
    direction = rng.uniform(0, 2 * np.pi, count)
    amplitude = np.sqrt(length)
    amplitude *= rms * np.sqrt(2.0) / np.linalg.norm(amplitude)
    k = 2 * np.pi / length
    phase = rng.uniform(0, 2 * np.pi, count)
    return np.stack([k * np.cos(direction), k * np.sin(direction), amplitude, phase], axis=1)


def _moved(by: float, path: Motion) -> Motion:
    return lambda t: by + path(t)


def _swinging(centre: float, swing: float, turns: float) -> Motion:
    return lambda t: centre + swing * np.sin(turns * t)


def _soft(depth: Array) -> Array:
    """Return the weight of a region at `depth` [px] inside it."""
    return 0.5 + 0.5 * np.tanh(depth)


def patchwork(size: tuple[int, int], seed: int = 0, *, speed: float = 1.0) -> Scene:
    """Return a scene for a picture of `size` (width, height) that holds all that effects differ by.

    From left to right it rises from dark to bright.  Its upper third moves fast, stops and comes
    back; its middle third moves slowly all the time; of the lower third the left half moves and
    rests long, the right half is still.  A bright and a dark disk and a dark bar pass over it.

    Parameters
    ----------
    size : (width, height)
    seed : int
        Textures and paths.
    speed : float
        Factor on all speeds.
    """
    width, height = size
    rng = np.random.default_rng([seed, 20])
    low, high = np.log(7.0), np.log(120.0)

    def background(x: Array, y: Array) -> Array:
        return low + (high - low) * (x + 0.5) / width + 0.0 * y

    upper, lower = height / 3 - 0.5, 2 * height / 3 - 0.5
    fast = Region(
        mask=lambda x, y: _soft(upper - y) + 0.0 * x,
        motion=(stop_and_go(80.0 * speed, 0.34, 0.14), stop_and_go(18.0 * speed, 0.29, 0.19)),
        waves=waves(rng, 8, 7.0, 30.0, 0.75),
    )
    slow = Region(
        mask=lambda x, y: _soft(y - upper) * _soft(lower - y) + 0.0 * x,
        motion=(steady(-20.0 * speed), steady(5.0 * speed)),
        waves=waves(rng, 6, 8.0, 24.0, 0.7),
    )
    resting = Region(
        mask=lambda x, y: _soft(y - lower) * _soft(width / 2 - x),
        motion=(
            stop_and_go(-50.0 * speed, 0.2, 0.45, first_s=0.1),
            stop_and_go(25.0 * speed, 0.2, 0.45, first_s=0.1),
        ),
        waves=waves(rng, 6, 6.0, 20.0, 0.7),
    )
    still = Region(
        mask=lambda x, y: _soft(y - lower) * _soft(x - width / 2),
        motion=(steady(0.0), steady(0.0)),
        waves=waves(rng, 4, 6.0, 20.0, 0.5),
    )
    start = rng.uniform(0.0, 0.3, 2) * width
    middle = height * rng.uniform(0.25, 0.55, 2)

    things = (
        Disk(
            path=(_moved(start[0], steady(32.0 * speed)), _swinging(middle[0], height / 5, 3.0)),
            radius=height / 11,
            light=210.0,
        ),
        Disk(
            path=(
                _moved(width - start[1], stop_and_go(-60.0 * speed, 0.5, 0.1)),
                _swinging(middle[1], height / 4, 2.0 * speed),
            ),
            radius=height / 13,
            light=5.0,
        ),
        Bar(path=_moved(-3.0, stop_and_go(70.0 * speed, 0.6, 0.2)), half=1.6, light=8.0),
    )
    regions = (fast, slow, resting, still)
    return Scene(background=background, regions=regions, things=things, between=(3.0, 235.0))


def gratings(size: tuple[int, int], seed: int = 0, *, speed: float = 1.0) -> Scene:
    """Return four quarters with a grating each: of other length, direction, contrast and speed.

    Two go steadily, one stops and goes, one is still; light falls from top to bottom.

    Parameters
    ----------
    size : (width, height)
    seed : int
        Lengths, directions and phases.
    speed : float
        Factor on all speeds.
    """
    width, height = size
    rng = np.random.default_rng([seed, 21])
    high, low = np.log(110.0), np.log(9.0)
    motions = (steady(45.0 * speed), steady(-12.0 * speed), None, steady(0.0))
    regions = []
    for number, motion in enumerate(motions):
        right, lower = number % 2, number // 2
        path = motion or stop_and_go(70.0 * speed, 0.3, 0.2)
        single = waves(rng, 1, rng.uniform(7.0, 14.0), 16.0, rng.uniform(0.4, 0.9))

        def mask(x: Array, y: Array, right: int = right, lower: int = lower) -> Array:
            along = (x - width / 2 + 0.5) * (1 if right else -1)
            down = (y - height / 2 + 0.5) * (1 if lower else -1)
            return _soft(along) * _soft(down)

        regions.append(Region(mask=mask, motion=(path, path), waves=single))
    return Scene(
        background=lambda x, y: high + (low - high) * (y + 0.5) / height + 0.0 * x,
        regions=regions,
        between=(3.0, 235.0),
    )


def edges(size: tuple[int, int], seed: int = 0, *, speed: float = 1.0) -> Scene:
    """Return a still, faint texture that wide bars and disks pass at different speeds.

    Parameters
    ----------
    size : (width, height)
    seed : int
        Texture, places and speeds.
    speed : float
        Factor on all speeds.
    """
    width, height = size
    rng = np.random.default_rng([seed, 22])
    texture = Region(
        mask=lambda x, y: np.ones_like(x * y),
        motion=(steady(0.0), steady(0.0)),
        waves=waves(rng, 8, 6.0, 40.0, 0.5),
    )
    things: list[Bar | Disk] = []
    for pace, light in ((90.0, 160.0), (-35.0, 12.0), (14.0, 70.0)):
        begin = rng.uniform(0.1, 0.4) * width if pace > 0 else rng.uniform(0.6, 0.9) * width
        path = _moved(begin, stop_and_go(pace * speed * rng.uniform(0.8, 1.2), 0.4, 0.15))
        things.append(Bar(path=path, half=width / 12, light=light))
    for radius, light in ((height / 8, 220.0), (height / 9, 5.0)):
        across = _swinging(width / 2, width / 3, rng.uniform(3.0, 6.0) * speed)
        along = _swinging(height / 2, height / 3, rng.uniform(2.0, 5.0) * speed)
        things.append(Disk(path=(across, along), radius=radius, light=light))
    return Scene(
        background=lambda x, y: np.log(30.0) + 0.0 * (x + y),
        regions=(texture,),
        things=things,
        between=(3.0, 235.0),
    )


SCENES = {"patchwork": patchwork, "gratings": gratings, "edges": edges}
"""Scenes by name; each takes (size, seed, speed=)."""
