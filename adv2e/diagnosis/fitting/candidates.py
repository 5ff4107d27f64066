"""A candidate: an effect that may be missing, as parameters of a configuration that are fitted."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.config import Config, to_dict
from adv2e.config.tree import flat, get_key, set_key
from adv2e.diagnosis.configurations import from_values
from adv2e.diagnosis.hints.readouts import Pulse, Readouts

Point = Sequence[float] | NDArray[np.float64]
"""A number on the scale of each parameter."""


@dataclass(frozen=True)
class FitParameter:
    """One number that is fitted, and the key that it sets.

    Attributes
    ----------
    low, high : float
        Physical range.
    log : bool
        Fitted as its logarithm.
    scale : float
        Change that counts as one, for numbers that are fitted as they are.
    part : (int, int), optional
        Place in a key that is a list, and how many numbers that has.
    text : str
        How a key that is text holds the number, such as ``gamma:{}``.
    neutral : float, optional
        Where the effect does nothing; default: what the configuration holds, or nothing.
    of_pixels : bool
        A share of the pixels, of which a chip has a drawn number.
    """

    key: str
    low: float
    high: float
    log: bool = True
    scale: float = 1.0
    part: tuple[int, int] | None = None
    text: str = ""
    neutral: float | None = None
    of_pixels: bool = False

    def scaled(self, value: float) -> float:
        return math.log(value) if self.log else value / self.scale

    def value_at(self, scaled: float) -> float:
        """Return the value at a number on the fitted scale, kept in the physical range."""
        value = math.exp(min(scaled, 60.0)) if self.log else scaled * self.scale
        return float(min(max(value, self.low), self.high))

    def at_border(self, scaled: float) -> bool:
        value = self.value_at(scaled)
        low, high = 1e-9 * abs(self.low), 1e-9 * abs(self.high)
        return value <= self.low + low or value >= self.high - high

    def set(self, values: dict[str, Any], value: float) -> None:
        held: Any = value
        if self.text:
            held = self.text.format(f"{value:.6g}")
        elif self.part is not None:
            place, count = self.part
            held = get_key(values, self.key)
            held = list(held) if isinstance(held, (list, tuple)) else [0.0] * count
            held[place] = value
        set_key(values, self.key, held)


NOTHING_KNOWN = (0.0, math.inf)
"""Prior of a parameter that is known by the statistics alone: mean and standard deviation."""

FITTED = 0.02
"""Share of the residual that a fit may leave."""


@dataclass(frozen=True)
class Candidate:
    """An effect with the keys that are fitted for it.

    Attributes
    ----------
    starts : tuple of tuple of float
        Values from which the fit may start.
    extra : tuple of (str, value)
        Keys that are set besides, and not fitted.
    defaults : tuple of (str, value)
        Keys that are set where the section that they lie in is off.
    left : float
        Share of the residual that is put down to the fit where the model has this effect: more of
        those that undo what cannot be undone in full.
    known : tuple of (float, float)
        Mean and standard deviation of the prior of each parameter, on its scale; none: no priors.
    readouts : Readouts, optional
        When frames were read out if this effect is there: of exposures that are fitted, only those
        which end then go with it, and no fit finds these from others.
    pulse : Pulse, optional
        That bursts of events tell: where it is in a model stays with them, whatever this effect
        does to the times of the frames.
    read_off : tuple of (str, float)
        Standard deviations of those keys of `extra` that were read off the recording.
    of_chance : bool
        It makes chance larger or smaller more than it moves any mean, which no misfit of a few
        simulations shows: it is always simulated often.
    is_seen : bool
        Bursts of events show when it acts, whatever else is missing.
    """

    name: str
    parameters: tuple[FitParameter, ...]
    starts: tuple[tuple[float, ...], ...]
    extra: tuple[tuple[str, Any], ...] = ()
    defaults: tuple[tuple[str, Any], ...] = ()
    left: float = FITTED
    known: tuple[tuple[float, float], ...] = ()
    readouts: Readouts | None = None
    pulse: Pulse | None = None
    read_off: tuple[tuple[str, float], ...] = ()
    of_chance: bool = False
    is_seen: bool = False

    @classmethod
    def joined(cls, each: Sequence[Candidate]) -> Candidate:
        """Return one candidate of all parameters; its k-th start joins the k-th start of each."""
        count = max((len(one.starts) for one in each), default=0)
        starts = [
            [value for one in each for value in one.starts[min(k, len(one.starts) - 1)]]
            for k in range(count)
        ]
        return cls(
            " and ".join(one.name for one in each if one.name),
            tuple(parameter for one in each for parameter in one.parameters),
            tuple(map(tuple, starts)),
            tuple(pair for one in each for pair in one.extra),
            tuple(pair for one in each for pair in one.defaults),
            known=tuple(pair for one in each for pair in one.known_or_not),
            pulse=next((one.pulse for one in each), None),
        )

    @property
    def keys(self) -> set[str]:
        """Keys that are fitted."""
        return {one.key for one in self.parameters}

    @property
    def known_or_not(self) -> tuple[tuple[float, float], ...]:
        """Prior of every parameter: `known`, or :data:`NOTHING_KNOWN` for each."""
        return self.known or (NOTHING_KNOWN,) * len(self.parameters)

    def scaled(self, values: Sequence[float]) -> list[float]:
        return [one.scaled(value) for one, value in zip(self.parameters, values, strict=True)]

    def inside(self, point: Point) -> NDArray[np.float64]:
        """Return the physical point that is nearest."""
        pairs = zip(self.parameters, point, strict=True)
        return np.array([one.scaled(one.value_at(at)) for one, at in pairs])

    def applied(self, config: Config, point: Point) -> Config:
        values = to_dict(config)
        for key, value in self.defaults:
            if get_key(values, key.rpartition(".")[0]) is None:
                set_key(values, key, value)
        applied = from_values(self._set(values, point), self.name, config)
        return applied if self.pulse is None else self.pulse.placed(applied)

    def settings(self, point: Point) -> dict[str, Any]:
        return dict(flat(self._set({}, point)))

    def settings_in(self, config: Config, point: Point) -> dict[str, Any]:
        """Return the keys of this effect in a model with it; those not fitted, as they are there.

        Where a pulse is, others' keys tell, too.
        """
        besides, values = {key for key, _ in self.extra}, to_dict(config)
        return {
            key: get_key(values, key) if key in besides else value
            for key, value in self.settings(point).items()
        }

    def _set(self, values: dict[str, Any], point: Point) -> dict[str, Any]:
        """Set this effect's keys in nested mappings, and return them."""
        for key, value in self.extra:
            set_key(values, key, value)
        for one, scaled in zip(self.parameters, point, strict=True):
            one.set(values, one.value_at(scaled))
        return values


NOTHING = Candidate("", (), ((),))
"""No effect, or no nuisance."""

_OFF_AT_INFINITY = (
    "pixel.low_pass.cutoff_hz",
    "pixel.low_pass.dark_cutoff_hz",
    "pixel.source_follower.cutoff_hz",
    "pixel.slew_limit.per_s",
)


def neutral_value(config: Config, parameter: FitParameter) -> float:
    """Return the value of a parameter at which `config` is as it was: what it holds, or nothing."""
    if parameter.neutral is not None:
        return parameter.neutral
    held = get_key(to_dict(config), parameter.key)
    if parameter.part is not None and isinstance(held, (list, tuple)):
        held = held[parameter.part[0]]
    if isinstance(held, (int, float)):
        return float(held)
    return math.inf if parameter.key in _OFF_AT_INFINITY else 0.0
