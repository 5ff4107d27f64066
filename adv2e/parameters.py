"""Declared parameters: a frozen dataclass per section, each field with unit, meaning and range.

Every section of the configuration, and so every effect, derives from :class:`Section` and declares
its keys with :func:`parameter`.  Checking, ``adv2e config``, ``adv2e effects`` and the YAML reader
all follow from these declarations; there is no schema beside them.
"""

from __future__ import annotations

import dataclasses
import math
import types
import typing
from dataclasses import MISSING, dataclass, field
from functools import cache
from typing import Any

from adv2e.errors import ConfigError

_MANY_BITS = 256
"""Whole numbers of more are not written out in messages."""


@dataclass(frozen=True)
class Fit:
    """Search range of a fit for a parameter, in its unit.

    Attributes
    ----------
    low, high : float
        Least and largest value that is tried; both are values that the parameter may have.
    start : float
        Where the search begins when nothing is known.
    log : bool
        Steps are factors rather than differences; `low` is above zero then.
    starts : tuple of float
        Where fits of the key alone begin.
    factors : tuple of float
        The same, as multiples of the value that is declared.
    """

    low: float
    high: float
    start: float
    log: bool = False
    starts: tuple[float, ...] = ()
    factors: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        if not self.low <= self.start <= self.high or self.low == self.high:
            raise ValueError(f"low {self.low:g} <= start {self.start:g} <= high {self.high:g}")
        if self.log and not self.low > 0:
            raise ValueError(f"on a logarithmic scale, low must be above 0, got {self.low:g}")


@dataclass(frozen=True, kw_only=True)
class Parameter:
    """Unit, meaning, range and source of one key, besides its name, type and default."""

    unit: str
    meaning: str
    above: float | None = None
    at_least: float | None = None
    at_most: float | None = None
    choices: tuple[str, ...] | None = None
    source: str = ""
    label: str = ""
    """Name of the key beside its effect in a sentence; empty: its own, where there are several."""
    fit: Fit | None = None
    """Search range for a diagnosis; None: it does not fit this key."""

    def complaint(self, value: Any) -> str | None:
        """Return the error text for `value`, or None; each part of a tuple is checked."""
        if isinstance(value, tuple):
            return next(filter(None, map(self.complaint, value)), None)
        if self.choices is not None and value not in self.choices:
            return f"must be one of {', '.join(self.choices)}, got {value!r}"
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            return None
        unit = f" {self.unit}" if self.unit not in ("", "-") else ""
        if isinstance(value, float) and not math.isfinite(value):
            return f"must be a finite number, got {value!r}"
        if self.above is not None and not value > self.above:
            return f"must be above {_digits(self.above)}{unit}, got {_digits(value)}"
        if self.at_least is not None and not value >= self.at_least:
            return f"must be at least {_digits(self.at_least)}{unit}, got {_digits(value)}"
        if self.at_most is not None and not value <= self.at_most:
            return f"must be at most {_digits(self.at_most)}{unit}, got {_digits(value)}"
        return None


def _digits(value: int | float) -> str:
    """Return a number for people; whole ones with all their digits, unless these are too many."""
    if not isinstance(value, int):
        return f"{value:g}"
    return str(value) if value.bit_length() < _MANY_BITS else f"one of {value.bit_length()} bits"


def parameter(default: Any = MISSING, **about: Any) -> Any:
    """Declare one key of a section; without `default` the key must be given.

    `about` are the attributes of :class:`Parameter`, of which `unit` and `meaning` must be given.
    """
    return field(default=default, metadata={"parameter": Parameter(**about)})


def subsection(default: Any, *, meaning: str) -> Any:
    """Declare a key that holds a section of its own.

    `default`: the class of the section, None (it is off), or MISSING (it must be given).
    """
    metadata = {"parameter": Parameter(unit="", meaning=meaning)}
    if default is None:
        return field(default=None, metadata=metadata)
    return field(default_factory=default, metadata=metadata)


@dataclass(frozen=True)
class Kind:
    """Type of a key: scalar, tuple or section, and whether None is allowed."""

    kind: type
    """int, float, str, bool, tuple or the class of a section."""
    optional: bool
    """True if the value may be None."""
    parts: tuple[type, ...] = ()
    """Types of the parts of a tuple."""

    def with_floats(self, value: Any) -> Any:
        """Return `value` with floats for whole numbers, by itself or in a tuple, that may be any.

        Raises
        ------
        OverflowError
            No float is so large.
        """
        if self.kind is float and type(value) is int:
            return float(value)
        if isinstance(value, tuple) and len(value) == len(self.parts):
            of_parts = zip(self.parts, value, strict=True)
            return tuple(Kind(kind, False).with_floats(part) for kind, part in of_parts)
        return value


@cache
def kinds_of(section: type[Any]) -> dict[str, Kind]:
    """Return the types of a section's keys, by name.

    Raises
    ------
    NameError, TypeError, ValueError
        A type is not known, or is more than one type or None.
    """
    kinds = {}
    for name, hint in typing.get_type_hints(section).items():
        kind, optional = hint, False
        if isinstance(kind, types.UnionType) or typing.get_origin(kind) is typing.Union:
            (kind,) = (part for part in typing.get_args(kind) if part is not type(None))
            optional = True
        parts = typing.get_args(kind) if typing.get_origin(kind) is tuple else ()
        kinds[name] = Kind(tuple if parts else kind, optional, parts)
    return kinds


@dataclass(frozen=True, kw_only=True)
class Section:
    """A section of the configuration: checks the declared ranges of its keys.

    A whole number where any number may stand becomes a ``float``: compiled code is made anew for
    each type that it meets.

    Raises
    ------
    ConfigError
        With the name of the key, the value and what would be right.  The YAML reader puts the path
        of the section in front.
    """

    def __post_init__(self) -> None:
        kinds = kinds_of(type(self))  # type: ignore[arg-type] # takes it for an object of it
        for item in dataclasses.fields(self):
            given = getattr(self, item.name)
            try:
                value = kinds[item.name].with_floats(given)
            except OverflowError:
                raise ConfigError(f"{item.name}: too large a number: {given}") from None
            object.__setattr__(self, item.name, value)
            declared: Parameter = item.metadata["parameter"]
            wrong = declared.complaint(value)
            if wrong:
                raise ConfigError(f"{item.name}: {wrong}")
