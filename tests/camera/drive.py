"""Log intensity that drives the photoreceptor, and what acts on it before the poles.

Stages are as those of :mod:`camera.light`, on log intensity.
"""

from __future__ import annotations

import numpy as np
from scipy.ndimage import gaussian_filter1d

from camera.light import Array, Stage, first_order
from camera.settings import Settings, find, section


def log_response(light: Array, linear_below: float, floor: float) -> Array:
    r"""Return x = ln DN, below the knee k = `linear_below` the line DN ln(k)/k.

    Without a knee (0) the logarithm of max(DN, floor).

    Source: Hu, Liu, Delbruck, "v2e: From Video Frames to Realistic DVS Events", 2021.
    """
    if linear_below == 0:
        return np.log(np.maximum(light, floor))
    line = light * (np.log(linear_below) / linear_below)
    return np.where(light < linear_below, line, np.log(np.maximum(light, linear_below)))


def column_gain(gains: Array) -> Stage:
    """Return the stage that scales the log intensity of each pixel, about the level of 30 DN.

    Source: column-wise fixed-pattern noise of image sensors; El Gamal et al., "Modeling and
    estimation of FPN components in CMOS image sensors", 1998.
    """
    middle = np.log(30.0)
    return lambda times, x: middle + gains * (x - middle)


def surround(share: float, sigma_px: float, size: tuple[int, int]) -> Stage:
    r"""Return the stage that takes a `share` of the neighbourhood's mean away (diffuser network).

    .. math:: x' = x - s\,(G_\sigma * x)

    Source: Delbruck, Li, Graca, McReynolds, "Utility and feasibility of a center surround event
    camera", 2022.
    """
    width, height = size

    def stage(times: Array, x: Array) -> Array:
        picture = x.reshape(len(x), height, width)
        mean = gaussian_filter1d(picture, sigma_px, axis=1, mode="nearest", truncate=3.0)
        mean = gaussian_filter1d(mean, sigma_px, axis=2, mode="nearest", truncate=3.0)
        return x - share * mean.reshape(x.shape)

    return stage


def adaptation(share: float, corner_hz: float, step_s: float) -> Stage:
    r"""Return the stage that takes the slow part of the log intensity away (band-pass).

    .. math:: x' = x - s\,m, \qquad \dot m = 2\pi f\,(x - m)

    Source: Delbruck, Mead, "Adaptive photoreceptor with wide dynamic range", 1994.
    """
    slow = first_order(-np.expm1(-2 * np.pi * corner_hz * step_s))
    return lambda times, x: x - share * slow(x)


def drive_stages(
    settings: Settings, step_s: float, size: tuple[int, int], rng: np.random.Generator
) -> list[Stage]:
    """Return the stages from light to the drive of the low-pass, in their order."""
    knee = find(settings, "pixel.log_response.linear_below", 0.0)
    floor = find(settings, "pixel.log_response.floor", 0.1)
    stages: list[Stage] = [lambda times, light: log_response(light, knee, floor)]
    stripes = section(settings, "outside.column_gain")
    if stripes is not None:
        gains = 1.0 + stripes["rms"] * rng.standard_normal(size[0])
        stages.append(column_gain(np.tile(gains, size[1])))
    around = section(settings, "outside.surround")
    if around is not None:
        stages.append(surround(around["share"], around["sigma_px"], size))
    slow = section(settings, "outside.adaptation")
    if slow is not None:
        stages.append(adaptation(slow["share"], slow["corner_hz"], step_s))
    return stages
