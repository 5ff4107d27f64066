"""Light of the photodiodes, as it differs from the light of the scene.

Each stage takes times [s] (times,) and light [DN] (times, pixels) and returns the light that goes
on to the next one.  The first call is a single instant at which everything is at rest.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from camera.settings import Settings, find, section

Array = NDArray[np.float64]
Stage = Callable[[Array, Array], Array]


def flicker(frequency_hz: float, depth: float, phase: float) -> Callable[[Array], Array]:
    r"""Return the factor that a lamp on the mains puts on the light at times [s].

    .. math:: 1 + m \sin(2\pi f t + \varphi)

    f is that of the light, twice that of the mains for a lamp without rectifier.

    Source: Wang et al., "Comb filter for flicker", 2022 (100 or 120 Hz; 1 to 40 per cent).
    """
    return lambda t: 1.0 + depth * np.sin(2 * np.pi * frequency_hz * t + phase)


def dark_current(dn: float) -> Stage:
    """Return the stage that adds a constant `dn` [DN], of which the frames know nothing.

    Source: Graca, McReynolds, Delbruck, "Shining light on the DVS pixel", 2023 (dark current is
    indistinguishable from light).
    """
    return lambda times, light: light + dn


def image_lag(share: float, tau_s: float, step_s: float) -> Stage:
    r"""Return the stage by which a `share` of the light arrives late, through a slow first order.

    .. math:: I' = (1 - q) I + q\,m, \qquad \tau \dot m = I - m

    Source: Theuwissen, "Solid-State Imaging with Charge-Coupled Devices", 1995 (image lag).
    """
    gain = -np.expm1(-step_s / tau_s)
    late = first_order(gain)

    def stage(times: Array, light: Array) -> Array:
        return (1.0 - share) * light + share * late(light)

    return stage


def first_order(gain: float) -> Callable[[Array], Array]:
    """Return a filter m += gain (x - m) along the first axis, at rest on the first row it meets."""
    rest: list[Array] = []

    def run(x: Array) -> Array:
        if not rest:
            rest.append((1.0 - gain) * x[:1])
        y, rest[0] = lfilter([gain], [1.0, gain - 1.0], x, axis=0, zi=rest[0])
        return np.asarray(y)

    return run


def light_stages(settings: Settings, step_s: float, lamp: Callable[[Array], Array]) -> list[Stage]:
    """Return the stages that `settings` ask for, in the order in which light meets them."""
    stages: list[Stage] = []
    if section(settings, "frames.flicker") is not None:
        stages.append(lambda times, light: light * lamp(times)[:, None])
    lag = section(settings, "outside.image_lag")
    if lag is not None:
        stages.append(image_lag(lag["share"], lag["tau_us"] * 1e-6, step_s))
    dark = find(settings, "pixel.dark_current.dn", 0.0)
    if dark:
        stages.append(dark_current(dark))
    return stages
