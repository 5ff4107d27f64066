"""Files that are a stream of words: read in blocks, and times of few bits counted on."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.formats.event_file import Facts

Numbers = NDArray[np.int64]


def blocks(
    path: Path, begin: int, dtype: str, count: int, facts: Facts | None = None
) -> Iterator[NDArray[Any]]:
    """Yield the words of a file as arrays of at most `count` of them.

    What is left at the end and is no whole word, as where a recording was broken off, is told.

    Parameters
    ----------
    path : Path
    begin : int
        Where the first word begins [bytes].
    dtype : str
        Of a word.
    count : int
    facts : Facts, optional
        Is told the progress, and what is left.
    """
    word = np.dtype(dtype)
    total = path.stat().st_size
    with path.open("rb") as file:
        file.seek(begin)
        while data := file.read(count * word.itemsize):
            whole, left = divmod(len(data), word.itemsize)
            if whole:
                yield np.frombuffer(data, word, whole)
            if facts is None:
                continue
            if left:
                facts.problems.append(
                    f"{left} bytes at the end, at byte {file.tell() - left}, are no whole word of"
                    f" {word.itemsize}: left out"
                )
            facts.progress(file.tell(), total)


class Counter:
    """Counts on where numbers of few bits begin again: where one is less by half the range.

    Parameters
    ----------
    bits : int
        Of a number.
    """

    def __init__(self, bits: int) -> None:
        self._bits = bits
        self._last = self._turns = 0

    def __call__(self, numbers: NDArray[Any]) -> Numbers:
        """Return the numbers that follow on those of the last call, counted on."""
        counted = numbers.astype(np.int64)
        if not counted.size:
            return counted
        again = np.empty(counted.size, np.bool_)
        half = 1 << (self._bits - 1)
        again[0] = self._last - counted[0] >= half
        np.greater_equal(counted[:-1] - counted[1:], half, out=again[1:])
        self._last = int(counted[-1])
        if self._turns or again.any():
            turns = self._turns + np.cumsum(again)
            self._turns = int(turns[-1])
            counted += turns << self._bits
        return counted


def last_before(values: NDArray[Any], which: NDArray[np.bool_], carry: int, at: Numbers) -> Numbers:
    """Return the state at the words `at`: the last of `values` before each.

    Parameters
    ----------
    values : array, (words set in `which`,)
        Values that these words set.
    which : array of bool, (words,)
    carry : int
        State before the first of them.
    at : array of int, (n,)
        None of those set in `which`.
    """
    table = np.empty(values.size + 1, np.int64)
    table[0], table[1:] = carry, values
    if values.size < at.size >> 4:  # few, so each holds for many
        ends = np.searchsorted(at, np.flatnonzero(which))
        return np.repeat(table, np.diff(ends, prepend=0, append=at.size))
    held: Numbers = table[np.cumsum(which, dtype=np.int32)[at]]
    return held


class Kinds:
    """Counts the words of each kind, to tell of those that nobody knows.

    Parameters
    ----------
    known : tuple of int
        Kinds that the format has, whether they are events or not.
    """

    def __init__(self, *known: int) -> None:
        self._known = known
        self._counts = np.zeros(16, np.int64)
        self._total = 0
        self.early = 0

    def note(self, kinds: NDArray[Any], usual: NDArray[np.bool_]) -> None:
        """Count some words, of which those that are `usual` are known."""
        self._total += kinds.size
        if not usual.all():
            self._counts += np.bincount(kinds[~usual], minlength=16)

    def problems(self) -> list[str]:
        """Return the problems of all words until now."""
        told = []
        if self.early:
            told.append(f"{self.early} events without a time, row or column before them: left out")
        odd = [kind for kind in np.flatnonzero(self._counts) if kind not in self._known]
        if odd:
            names = ", ".join(f"{kind:#x}" for kind in odd)
            told.append(
                f"{self._counts[odd].sum()} of {self._total} words of a kind that the format"
                f" does not have ({names}): left out"
            )
        return told
