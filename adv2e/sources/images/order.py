"""Order of pictures by their names: that in which they were most likely taken.

Numbers count as numbers, and a name comes before those that continue it: ``IMG.jpg`` before
``IMG (1).jpg``.  Upper and lower case are the same, and so are composed and decomposed letters.
All names together tell what can be read in two ways, and the way that is taken is told:

- ``3081.8`` is a decimal number, or 3081 and a whole number of smaller units without the zeros in
  front.  Where the order depends on it, that way is taken in which steps are more even.
- ``-3`` is negative where other names have a number without the minus; else it has a dash.
- ``0a`` is hexadecimal where all names are, and are evenly spaced so.
"""

from __future__ import annotations

import re
import unicodedata
from collections import defaultdict
from collections.abc import Callable, Sequence
from decimal import Decimal
from functools import cache, partial
from itertools import groupby, pairwise
from os.path import commonprefix
from pathlib import PurePosixPath
from statistics import mean, median
from typing import Any

_WHOLE = re.compile(r"(\d+)")
_DECIMAL = re.compile(r"((?<![\d.,])\d+[.,]\d+(?:e[+-]\d{1,2})?(?![.,]?\d)|\d+(?:e[+-]\d{1,2})?)")
_HEXADECIMAL = re.compile(r"(?:0x)?[0-9a-f]{1,16}")
_HASH = re.compile(r"(?=.*[a-f])(?=.*\d)[0-9a-f-]{16,}")
_SIGN = re.compile(r"[-+−]$")
_EVEN = 0.1
"""Steps that differ by less than this share from the usual one, on average, are even."""

Key = Callable[[str], Any]


def natural_key(name: str) -> Any:
    """Return a key that sorts names with their numbers as numbers, each by itself."""
    return _key(name), name


def in_order(names: Sequence[str]) -> tuple[list[str], list[str]]:
    """Return the names of files of one folder in order, and what is to be told of it, in lines."""
    stems = {name: _stem(name) for name in names}
    signs = _signs(stems.values())
    whole: Key = cache(partial(_key, signs=signs))
    decimal: Key = cache(partial(_key, signs=signs, form=_DECIMAL))
    key, told = _settled(sorted(stems.values()), whole, decimal, signed=bool(signs))
    ordered = sorted(names, key=lambda name: (key(stems[name]), stems[name], name))
    if any(text.endswith(("-", "−")) for _, text in signs):
        told.append(f"numbers with a minus are negative, and come first: {_last(ordered[0])}")
    elif names and all(stem[:1] in ("-", "−") and stem[1:2].isdecimal() for stem in stems.values()):
        told.append(f"the - before the numbers is taken as a dash: {_last(ordered[0])} comes first")
    for before, after in pairwise(ordered):
        if key(stems[before]) == key(stems[after]):
            both = f"{_last(before)} and {_last(after)}"
            told.append(f"{both} are of one name or number, and are two frames")
            break
    kinds = [list(kind) for _, kind in groupby(ordered, lambda name: whole(stems[name])[0])]
    if len(kinds) > 1 and all(len(kind) > 1 for kind in kinds):
        both = " and ".join(_last(kind[0]) for kind in kinds[:2])
        told.append(f"names of {len(kinds)} kinds, such as {both}, are taken one after the other")
    if len(names) > 1 and all(map(_HASH.fullmatch, _rests(list(stems.values())))):
        told.append(f"names such as {_last(ordered[0])} hardly tell an order: give a list of times")
    return ordered, told


def _last(name: str) -> str:
    return PurePosixPath(name).name


def _stem(name: str) -> str:
    return unicodedata.normalize("NFC", PurePosixPath(name).stem).casefold()


def _key(stem: str, signs: Sequence[Any] = (), form: re.Pattern[str] = _WHOLE) -> list[Any]:
    """Return texts and numbers in turn; `signs` are places and texts that end in a sign."""
    parts: list[Any] = form.split(stem)
    for at in range(1, len(parts), 2):
        number, before = Decimal(parts[at].replace(",", ".")), parts[at - 1]
        parts[at] = number
        if (at, before) in signs:
            parts[at - 1 : at + 1] = before[:-1], number if before.endswith("+") else -number
    return parts


def _signs(stems: Any) -> list[tuple[int, str]]:
    """Return the places and texts of which the last letter is a sign: others differ in it alone."""
    found = defaultdict(set)
    for stem in stems:
        parts = _WHOLE.split(stem)
        for at in range(1, len(parts), 2):
            found[at, _SIGN.sub("", parts[at - 1])].add(parts[at - 1])
    return [
        (at, text)
        for (at, bare), texts in found.items()
        if len(texts) > 1 and any(one.endswith(("-", "−")) for one in texts)
        for text in texts - {bare}
    ]


def _settled(stems: list[str], whole: Key, decimal: Key, *, signed: bool) -> tuple[Key, list[str]]:
    """Return the key that sorts stems, and what is to be told where another would sort otherwise.

    `whole` takes the numbers in them for whole numbers, `decimal` for such; `signed` are those of
    which some are negative.
    """
    rests = dict(zip(stems, _rests(stems), strict=True))
    if all(map(_HEXADECIMAL.fullmatch, rests.values())):
        numbers = {stem: int(rest, 16) for stem, rest in rests.items()}
        pair = _other_way(stems, numbers.__getitem__, whole)
        if pair and _unevenness([list(numbers.values())]) < _EVEN:
            told = "names are taken for hexadecimal numbers, which are evenly spaced"
            return numbers.__getitem__, [f"{told}: {pair[0]} before {pair[1]}"]
    pair = _other_way(stems, decimal, whole)
    if pair is None:
        return whole, []
    told = "digits after the point in the names are taken as"
    if signed or _steps_are_decimal(stems, decimal, whole):
        return decimal, [f"{told} decimals, not as whole numbers: {pair[0]} before {pair[1]}"]
    told += " whole numbers, not as decimals"
    return whole, [f"{told}: {pair[1]} before {pair[0]}"]


def _rests(stems: Sequence[str]) -> list[str]:
    """Return the rest of each stem after the words with which all begin."""
    same = commonprefix(list(stems))  # noqa: RUF071 - of letters is meant
    begin = len(re.sub(r"[^\W_]*$", "", same))
    return [stem[begin:] for stem in stems]


def _other_way(stems: Sequence[str], key: Key, other: Key) -> tuple[str, str] | None:
    """Return two neighbours of an order that another order has the other way round, if any."""
    pairs = pairwise(sorted(stems, key=key))
    return next((pair for pair in pairs if other(pair[0]) > other(pair[1])), None)


def _steps_are_decimal(stems: Sequence[str], decimal: Key, whole: Key) -> bool:
    """Tell whether numbers with points are more even as decimals, none of them being twice there.

    As whole numbers, the digits after the point are of a unit that the longest of them fits.
    """
    if len({*map(tuple, map(decimal, stems))}) < len({*map(tuple, map(whole, stems))}):
        return False
    split = [_DECIMAL.split(stem) for stem in stems]
    odd = (at for parts in split for at in range(1, len(parts), 2) if not parts[at].isdecimal())
    place, series = min(odd), defaultdict(list)
    for parts in split:
        if len(parts) > place:
            series[tuple(parts[:place])].append(parts[place].replace(",", "."))
    most = max(len(number.partition(".")[2]) for one in series.values() for number in one)
    wholes = [[_of_units(number, most) for number in one] for one in series.values()]
    decimals = [[Decimal(number) for number in one] for one in series.values()]
    return _unevenness(decimals) < _unevenness(wholes)


def _of_units(number: str, digits: int) -> Decimal:
    """Return a number whose digits after the point count units of so many digits."""
    before, _, after = number.partition("e")[0].partition(".")
    return Decimal(f"{before}.{after:>0{digits}}")


def _unevenness(series: Sequence[Sequence[Any]]) -> float:
    """Return the mean deviation of steps from the median, as a share of it, each at most 1."""
    steps = [after - before for one in series for before, after in pairwise(sorted(one))]
    usual = median(steps) if steps else 0
    return mean(min(1.0, float(abs(step - usual) / usual)) for step in steps) if usual else 1.0
