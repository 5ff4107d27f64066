"""Levels of the comparators: of each pixel, and in time."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from camera.settings import Settings, find, section

Array = NDArray[np.float64]

LEAST = 0.01
"""Least threshold of a pixel [ln]."""


def levels(
    settings: Settings, size: tuple[int, int], rng: np.random.Generator
) -> tuple[Array, Array]:
    r"""Return ON and OFF thresholds of the pixels [ln], both (pixels,) and positive.

    .. math:: C_{px} = \max(0.01,\; C + \sigma z_{px})

    with z normal, ON and OFF independent (mismatch).  With ``outside.threshold_vignette`` both rise
    towards the corners, by ``rise`` (r/r_max)^2.

    Sources: Lichtsteiner, Posch, Delbruck 2008 (mismatch); lens shading for the shape of the rise.
    """
    width, height = size
    given = settings["pixel"]["thresholds"]
    spread = given.get("mismatch", 0.0)
    on = np.maximum(LEAST, given["on"] + spread * rng.standard_normal(width * height))
    off = np.maximum(LEAST, given["off"] + spread * rng.standard_normal(width * height))
    vignette = section(settings, "outside.threshold_vignette")
    if vignette is not None:
        x = np.linspace(-1.0, 1.0, width)[None, :]
        y = np.linspace(-1.0, 1.0, height)[:, None]
        rise = 1.0 + vignette["rise"] * ((x * x + y * y) / 2.0).ravel()
        on, off = on * rise, off * rise
    return on, off


def factor_in_time(settings: Settings, times: Array) -> Array | None:
    r"""Return what all thresholds are multiplied with at `times` [s]; None: nothing changes.

    .. math:: (1 + d\,t)\,(1 + m \sin 2\pi f t)

    d = ``pixel.thresholds.drift_per_s`` is a share of the thresholds a second; the second factor is
    a wobbling bias, ``outside.threshold_wobble``.

    Sources: Nozaki, Delbruck, "Temperature and parasitic photocurrent effects in dynamic vision
    sensors", 2017 (drift); Graca, McReynolds, Delbruck 2023 (thresholds are ratios of biases).
    """
    drift = find(settings, "pixel.thresholds.drift_per_s", 0.0)
    wobble = section(settings, "outside.threshold_wobble")
    if not drift and wobble is None:
        return None
    factor = 1.0 + drift * times
    if wobble is not None:
        angle = 2 * np.pi * wobble["frequency_hz"] * times
        factor *= 1.0 + wobble["depth"] * np.sin(angle)
    return factor
