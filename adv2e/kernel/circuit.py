"""The record of the circuit.

A named tuple of plain numbers, of the same types whatever is switched on, so that switching an
effect compiles nothing.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]

# codes of the update forms
EXACT, FIRST_ORDER_HOLD, ZERO_ORDER_HOLD, EULER, PAPER = range(5)


class Circuit(NamedTuple):
    """Parameters that all pixels and intervals share.  Times in us, rates in 1/us, light in DN."""

    update: int  # EXACT ... PAPER
    steps: int  # K
    printed: bool  # whether the last interval is sampled as the paper prints it
    filtered: bool  # whether there is a low-pass
    dark: float  # 2 pi dark_cutoff
    per_dn: float  # 2 pi (cutoff - dark_cutoff) / 255
    slew: float  # fastest change of the first pole a us; 0: no limit
    follower: float  # 2 pi cutoff of the second pole; 0: none
    knee: float  # log intensity at the knee; below it, light = slope x
    slope: float  # d light / d x below the knee; 0: no knee
    floor: float  # least light where there is no knee
    dead_time: float  # 0: none
    overshoot: float  # share of the threshold by which the reference goes on at an event
    leak: float  # leak events a us from junction leakage
    photo_leak: float  # the same a us and DN
    leak_jitter: float
    shot_rate: float  # candidates a us
    shot_fall: float  # share of them that is lost, a DN
    hot_rate: float  # events of the median hot pixel a us
    hot_spread: float  # standard deviation of the logarithm of that over the hot pixels
    noise_rms: float  # photoreceptor noise
    noise_step: float
    causes: bool  # whether events know their causes
    added: int  # cause of events by what is added to the signal
    seed: np.uint64


def fastest_corner(circuit: Circuit, brightest: float = 255.0) -> float:
    """Return the fastest corner of the low-pass, `brightest` [DN] being the most light [rad/us]."""
    return max(circuit.dark + brightest * circuit.per_dn, circuit.dark)
