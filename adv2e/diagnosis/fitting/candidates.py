"""A candidate: an effect that may be missing, as knobs on a configuration."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.config import Config, to_dict
from adv2e.config.paths import flat, get_key, set_key
from adv2e.diagnosis.fitting.keys import from_values
from adv2e.diagnosis.hints.pulses import Pulse
from adv2e.diagnosis.hints.readouts import Readouts

Places = Sequence[float] | NDArray[np.float64]
"""A place on each knob's scale."""


@dataclass(frozen=True)
class Knob:
    """One number that is fitted, and the key that it sets.

    Attributes
    ----------
    key : str
    low, high : float
        Physical range.
    log : bool
        Fitted as its logarithm.
    scale : float
        Change that counts as one, for knobs that are fitted as they are.
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

    def inner(self, value: float) -> float:
        """Return where on the fitted scale `value` is."""
        return math.log(value) if self.log else value / self.scale

    def outer(self, inner: float) -> float:
        """Return the value at a place on the fitted scale, kept in the physical range."""
        value = math.exp(min(inner, 60.0)) if self.log else inner * self.scale
        return float(min(max(value, self.low), self.high))

    def at_border(self, inner: float) -> bool:
        """Tell whether the fit has run to the end of the physical range."""
        value = self.outer(inner)
        low, high = 1e-9 * abs(self.low), 1e-9 * abs(self.high)
        return value <= self.low + low or value >= self.high - high


NOTHING_KNOWN = (0.0, math.inf)
"""Of a knob, besides what statistics tell: place and deviation."""

FITTED = 0.02
"""Share of the residual that a fit may leave."""


@dataclass(frozen=True)
class Candidate:
    """An effect with the keys that are fitted for it.

    Attributes
    ----------
    name : str
    knobs : tuple of Knob
    probes : tuple of tuple of float
        Values from which the fit may start.
    extra : tuple of (str, value)
        Keys that are set besides, and not fitted.
    defaults : tuple of (str, value)
        Keys that are set where the section that they lie in is off.
    left : float
        Share of the residual that is put down to the fit where the model has this effect: more of
        those that undo what cannot be undone in full.
    known : tuple of (float, float)
        Of each knob, where on its scale something else than the statistics says that it is, and its
        standard deviation; none: nothing else tells.
    readouts : Readouts, optional
        When frames were read out if this effect is there: of exposures that are fitted, only those
        which end then go with it, and no fit finds these from others.
    pulse : Pulse, optional
        That bursts of events tell: where it is in a model stays with them, whatever this effect
        does to the times of the frames.
    of_chance : bool
        It makes chance larger or smaller more than it moves any mean, which no misfit of a few
        simulations shows: it is always simulated often.
    """

    name: str
    knobs: tuple[Knob, ...]
    probes: tuple[tuple[float, ...], ...]
    extra: tuple[tuple[str, Any], ...] = ()
    defaults: tuple[tuple[str, Any], ...] = ()
    left: float = FITTED
    known: tuple[tuple[float, float], ...] = ()
    readouts: Readouts | None = None
    pulse: Pulse | None = None
    of_chance: bool = False

    @property
    def known_or_not(self) -> tuple[tuple[float, float], ...]:
        """What is known of every knob besides, if only nothing."""
        return self.known or (NOTHING_KNOWN,) * len(self.knobs)

    def inner(self, values: Sequence[float]) -> list[float]:
        """Return where on the fitted scales values of the knobs are."""
        return [knob.inner(value) for knob, value in zip(self.knobs, values, strict=True)]

    def applied(self, config: Config, inner: Places) -> Config:
        """Return `config` with this effect."""
        values = to_dict(config)
        for key, value in self.defaults:
            if get_key(values, key.rpartition(".")[0]) is None:
                set_key(values, key, value)
        applied = from_values(self._set(values, inner), self.name, config)
        return applied if self.pulse is None else self.pulse.placed(applied)

    def parameters(self, inner: Places) -> dict[str, Any]:
        """Return the keys that this effect sets, and their values."""
        return dict(flat(self._set({}, inner)))

    def told(self, config: Config, inner: Places) -> dict[str, Any]:
        """Return the same of a model that has it: what was set besides, as it is there.

        Where a pulse is, others' keys tell, too.
        """
        besides, values = {key for key, _ in self.extra}, to_dict(config)
        return {
            key: get_key(values, key) if key in besides else value
            for key, value in self.parameters(inner).items()
        }

    def _set(self, values: dict[str, Any], inner: Places) -> dict[str, Any]:
        """Set this effect's keys in nested mappings, and return them."""
        for key, value in self.extra:
            set_key(values, key, value)
        for knob, place in zip(self.knobs, inner, strict=True):
            _turn(values, knob, knob.outer(place))
        return values


def _turn(values: dict[str, Any], knob: Knob, value: float) -> None:
    if knob.text:
        set_key(values, knob.key, knob.text.format(f"{value:.6g}"))
    elif knob.part is not None:
        place, count = knob.part
        held = get_key(values, knob.key)
        items = list(held) if isinstance(held, (list, tuple)) else [0.0] * count
        items[place] = value
        set_key(values, knob.key, items)
    else:
        set_key(values, knob.key, value)


_OFF_AT_INFINITY = (
    "pixel.low_pass.cutoff_hz",
    "pixel.low_pass.dark_cutoff_hz",
    "pixel.source_follower.cutoff_hz",
    "pixel.slew_limit.per_s",
)


def neutral_value(config: Config, knob: Knob) -> float:
    """Return the value of a knob at which `config` is as it was: what it holds, or nothing."""
    if knob.neutral is not None:
        return knob.neutral
    held = get_key(to_dict(config), knob.key)
    if knob.part is not None and isinstance(held, (list, tuple)):
        held = held[knob.part[0]]
    if isinstance(held, (int, float)):
        return float(held)
    return math.inf if knob.key in _OFF_AT_INFINITY else 0.0
