"""Distributions in the place of numbers: what is drawn, within the range of the key, and how.

====================================== =======================================================
``{uniform: [a, b]}``                  from a to b; of whole numbers: each of a, a + 1, ..., b
``{log_uniform: [a, b]}``              its logarithm is uniform
``{normal: [mean, deviation]}``        what is outside of the key's range is drawn anew
``{choice: [a, b, ...]}``              each is as likely
``{same_as: other.key}``               the number of another key, which may be drawn itself;
                                       with ``times`` and ``plus``, numbers or distributions
====================================== =======================================================

A number comes from the seed, the path of its key and nothing else: it is the quantile of its law at
a share that is read off their SHA-256.  So the order of keys changes nothing, nor does a
distribution more change what another key gets; and it is the same with every version of NumPy.
"""

from __future__ import annotations

import dataclasses
import hashlib
import math
import sys
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import MISSING, dataclass
from itertools import accumulate
from typing import Any, TypeAlias

from adv2e.config.build import Key, all_keys, parts_of
from adv2e.config.tree import LAWS, TIE, form_text
from adv2e.config.yaml12 import Value
from adv2e.errors import Adv2eError, did_you_mean
from adv2e.parameters import Section

Number: TypeAlias = "int | float"

_OF_TIE = {TIE, "times", "plus"}
_TRIES = 1000
_FORMS = (
    "{uniform: [a, b]}, {log_uniform: [a, b]}, {normal: [mean, deviation]}, {choice: [a, b, ...]}"
    " or {same_as: other.key, times: number}"
)


def replaced(tree: Value, by: Mapping[str, Value], path: str = "") -> Value:
    if path in by:
        return by[path]
    content = tree.content
    if isinstance(content, dict):
        content = {
            key: replaced(item, by, f"{path}.{key}" if path else key)
            for key, item in content.items()
        }
    elif isinstance(content, list):
        content = [replaced(item, by, f"{path}[{n}]") for n, item in enumerate(content)]
    return dataclasses.replace(tree, content=content)


@dataclass(frozen=True)
class _Law:
    """One of :data:`LAWS` with its numbers."""

    name: str
    numbers: tuple[Number, ...]
    whole: bool = False

    def at(self, share: float) -> Number:
        """Return the quantile at `share`, between 0 and 1."""
        if self.name == "choice":
            return self.numbers[int(share * len(self.numbers))]
        first, second = self.numbers
        if self.name == "normal":
            from statistics import NormalDist  # noqa: PLC0415 - what few configurations need

            return NormalDist(first, second).inv_cdf(share)
        if self.whole:
            return int(first) + int(share * (int(second) - int(first) + 1))
        if self.name == "log_uniform":
            between = math.exp(math.log(first) * (1 - share) + math.log(second) * share)
        else:
            between = first * (1 - share) + second * share
        return min(max(between, first), second)  # but for rounding, it is between them


@dataclass(frozen=True)
class _Tie:
    """The number of another key, times one, plus one."""

    key: str
    times: _Law | Number
    plus: _Law | Number

    @property
    def is_random(self) -> bool:
        """True if the number may differ while that of the other key is the same."""
        return isinstance(self.times, _Law) or isinstance(self.plus, _Law)


class Distributions:
    """The distributions in a configuration.

    Parameters
    ----------
    section : type of Section
        What the configuration is of.
    tree : Value
        The configuration as it was written.

    Raises
    ------
    ConfigError, UsageError
        A distribution is wrong, or does not fit its key.  The text names file, line, key and what
        would be right.
    """

    def __init__(self, section: type[Section], tree: Value) -> None:
        self._known = {key.path: key for key in all_keys(section)}
        self._numbers = {key.path: key for key in _numbers(self._known.values())}
        self._written = dict(_values(tree))
        self._drawn: dict[str, _Law | _Tie] = {}
        self.forms: dict[str, Value] = {}
        """As they were written, by the path of the key."""
        for path, key in self._numbers.items():
            value = self._written.get(path)
            if value is not None and isinstance(value.content, dict):
                self.forms[path], self._drawn[path] = value, _parsed(key, value)
        for path, one in self._drawn.items():
            if isinstance(one, _Tie) and one.key not in self._drawn:
                self._fixed(one.key, path)
            self._check_circle(path)

    def draw(self, seed: int) -> dict[str, Number]:
        """Return the numbers drawn by `seed`, by the path of the key.

        Raises
        ------
        ConfigError, UsageError
            Too many draws fell outside of the range of a key.
        """
        numbers: dict[str, Number] = {}
        for path in self._drawn:
            self._draw(path, seed, numbers)
        return numbers

    def _draw(self, path: str, seed: int, numbers: dict[str, Number]) -> Number:
        if path in numbers:
            return numbers[path]
        drawn, about = self._drawn[path], self._numbers[path].about
        other: Number = 0
        if isinstance(drawn, _Tie):
            known = drawn.key in self._drawn
            other = self._draw(drawn.key, seed, numbers) if known else self._fixed(drawn.key, path)
        wrong: str | None = None
        for attempt in range(_TRIES):
            if isinstance(drawn, _Law):
                number = drawn.at(_share(seed, path, attempt))
            else:
                times = _value(drawn.times, seed, f"{path}.times", attempt)
                number = other * times + _value(drawn.plus, seed, f"{path}.plus", attempt)
            wrong = about.complaint(number) or self._not_whole(path, number)
            if wrong is None:
                numbers[path] = number
                return number
            if isinstance(drawn, _Tie) and not drawn.is_random:
                raise self._complaint(path, wrong)
        raise self._complaint(path, f"{_TRIES:,} draws were all outside of its range: {wrong}")

    def _not_whole(self, path: str, number: Number) -> str | None:
        if self._numbers[path].kind is int and not isinstance(number, int):
            return f"must be a whole number, got {number:g}"
        return None

    def _complaint(self, path: str, text: str) -> Adv2eError:
        form = self.forms[path]
        return form.origin.complaint(path, f"{form_text(form)}: {text}")

    def _check_circle(self, path: str) -> None:
        seen = [path]
        while isinstance(one := self._drawn.get(seen[-1]), _Tie):
            if one.key in seen:
                raise self._complaint(path, f"goes round in a circle: {' -> '.join(seen)}")
            seen.append(one.key)

    def _fixed(self, wanted: str, path: str) -> Number:
        """Return the number at the key `wanted`, which is not drawn; `path` is tied to it."""
        if wanted not in self._numbers:
            near = did_you_mean(wanted, [*self._numbers])
            hint = filter(None, [f"{wanted} is no key of a number", near])
            raise self._complaint(path, ", ".join(hint))
        names, _, index = wanted.partition("[")
        found: Any = None
        for name in accumulate(names.split("."), "{}.{}".format):
            written, key = self._written.get(name), self._known[name]
            found = key.default if written is None else written.content
            if found is None or found is MISSING:
                raise self._complaint(path, f"{wanted} has no number: it is off or not given")
        if index:
            number = int(index.removesuffix("]"))
            part = found[number] if len(found) > number else None
            found = part.content if isinstance(part, Value) else part
        if isinstance(found, bool) or not isinstance(found, (int, float)):
            raise self._complaint(path, f"{wanted} has no number")
        return found


def _share(seed: int, path: str, attempt: int) -> float:
    digest = hashlib.sha256(f"{seed}\n{path}\n{attempt}".encode()).digest()
    return float(((int.from_bytes(digest[:8], "big") >> 12) + 0.5) / (1 << 52))


def _value(number: _Law | Number, seed: int, path: str, attempt: int) -> Number:
    return number.at(_share(seed, path, attempt)) if isinstance(number, _Law) else number


def _values(tree: Value, path: str = "") -> Iterator[tuple[str, Value]]:
    """Yield all values that were written, sections and parts of lists among them, by their path."""
    if isinstance(tree.content, dict):
        below = {f"{path}.{key}" if path else key: item for key, item in tree.content.items()}
    elif isinstance(tree.content, list):
        below = {f"{path}[{number}]": item for number, item in enumerate(tree.content)}
    else:
        return
    for name, value in below.items():
        yield name, value
        yield from _values(value, name)


def _numbers(keys: Iterable[Key]) -> Iterator[Key]:
    for key in keys:
        if key.parts:
            yield from parts_of(key)
        elif key.kind in (int, float):
            yield key


def _parsed(key: Key, value: Value) -> _Law | _Tie:
    content = value.content
    assert isinstance(content, dict)
    if key.path == "seed":
        raise value.origin.complaint(
            "seed", f"must be a whole number, got {value}: each sequence has a seed of its own"
        )
    if TIE in content and not content.keys() - _OF_TIE:
        source = content[TIE]
        if not isinstance(source.content, str):
            raise source.origin.complaint(
                f"{key.path}.{TIE}", f"must be the path of a key, got {source}"
            )
        times, plus = (
            _factor(f"{key.path}.{name}", content[name]) if name in content else neutral
            for name, neutral in (("times", 1), ("plus", 0))
        )
        return _Tie(source.content, times, plus)
    law = _law(key.path, value, whole=key.kind is int)
    if law.name != "normal":
        for number in law.numbers:
            wrong = key.about.complaint(number)
            if wrong:
                raise value.origin.complaint(key.path, f"{form_text(value)}: {wrong}")
    return law


def _factor(path: str, value: Value) -> _Law | Number:
    return _law(path, value) if isinstance(value.content, dict) else _number(path, value)


def _law(path: str, value: Value, *, whole: bool = False) -> _Law:
    content = value.content
    assert isinstance(content, dict)
    if len(content) != 1 or not content.keys() <= {*LAWS}:
        raise value.origin.complaint(path, f"must be a number, or one of {_FORMS}, got {value}")
    ((name, given),) = content.items()
    path = f"{path}.{name}"
    listed = given.content if isinstance(given.content, list) else []
    numbers = tuple(_number(path, item, whole=whole) for item in listed)
    pair = len(numbers) == 2
    wanted, right = {
        "uniform": ("[a, b] with a below b", pair and numbers[0] < numbers[1]),
        "log_uniform": (
            "[a, b] with a above 0 and below b",
            pair and 0 < numbers[0] < numbers[1],
        ),
        "normal": ("[mean, deviation] with a deviation above 0", pair and numbers[1] > 0),
        "choice": ("a list of numbers, [a, b, ...]", bool(numbers)),
    }[name]
    if not right:
        raise given.origin.complaint(path, f"must be {wanted}, got {given}")
    if whole and name not in ("uniform", "choice"):
        raise given.origin.complaint(
            path, "this key takes whole numbers: draw them by uniform or choice"
        )
    return _Law(name, numbers, whole and name == "uniform")


def _number(path: str, value: Value, *, whole: bool = False) -> Number:
    number = value.content
    fits = isinstance(number, int if whole else (int, float)) and not isinstance(number, bool)
    # no float is as large as some whole numbers
    if not fits or not -sys.float_info.max <= number <= sys.float_info.max:  # type: ignore[operator]
        what = "a whole number" if whole else "a finite number"
        raise value.origin.complaint(path, f"must be {what}, got {value}")
    return number  # type: ignore[return-value]
