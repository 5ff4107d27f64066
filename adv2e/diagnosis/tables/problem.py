"""A table, the model of it, and what the model may lack: what selection works on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Free:
    """A positive number that may be fitted.

    Attributes
    ----------
    key : str
        Its path in the configuration; or, with a bracket, what else it is.
    starts : tuple of float
        Where fits begin.
    lower, upper : float
        Borders.
    """

    key: str
    starts: tuple[float, ...]
    lower: float
    upper: float


@dataclass(frozen=True)
class Candidate:
    """An effect that the declared model may lack, or have in the wrong size."""

    name: str
    free: tuple[Free, ...]


@dataclass(frozen=True)
class Group:
    """Rows that make one curve over the light."""

    title: str
    rows: NDArray[np.int64]


class Problem(Protocol):
    """Measured values and a model of them.

    Attributes
    ----------
    measured : (n,)
        Natural logarithms.
    error : (n,)
        Their standard errors.
    error_source : str
        Where those come from.
    level : (n,) of int
        Number of the light level.
    light : (n,)
    judged : (n,) of bool
        Kept for judging, never fitted.
    nuisances : tuple of Free
        Always fitted.
    candidates : tuple of Candidate
    out_of_reach : mapping of str to str
        Effects that cannot act on such a table, and why.
    what, unit, light_unit : str
        What is measured.
    groups : tuple of Group
    notes : tuple of str
    """

    measured: Array
    error: Array
    error_source: str
    level: NDArray[np.int64]
    light: Array
    judged: NDArray[np.bool_]
    nuisances: tuple[Free, ...]
    candidates: tuple[Candidate, ...]
    out_of_reach: Mapping[str, str]
    what: str
    unit: str
    light_unit: str
    groups: tuple[Group, ...]
    notes: tuple[str, ...]

    def predict(self, values: Mapping[str, float]) -> Array:
        """Return the logarithms that the model predicts, (n,), finite."""

    @property
    def neutral(self) -> Mapping[str, float]:
        """Keys that this model has at a value other than the default, where not written."""

    def completed(self, values: Mapping[str, float]) -> dict[str, float]:
        """Return keys that were fitted with those which go with them and cannot be told."""


def is_key(name: str) -> bool:
    """Tell whether what is fitted is a key of the configuration, not something else of the table.

    `name`: as :attr:`Free.key` has it.
    """
    return "[" not in name


def held_rows(problem: Problem) -> NDArray[np.bool_]:
    """Return which rows errors are told of: those kept for judging, or else all, (n,)."""
    return problem.judged if problem.judged.any() else ~problem.judged


def row_errors(
    given: Array,
    measured: Array,
    cells: Sequence[tuple[object, ...]],
    assumed: float,
    least: float,
    stated: float | None = None,
) -> tuple[Array, str]:
    """Return the standard error of each row's logarithm, and where it comes from.

    Parameters
    ----------
    given : (n,)
        Relative standard errors of the table; NaN: none.
    measured : (n,)
        Logarithms.
    cells : sequence of tuples
        Rows with equal ones are repeats of one measurement.
    assumed : float
        For rows that have neither an error nor a repeat anywhere.
    least : float
        Added in quadrature to those given: a table is not better than the light it states.
    stated : float, optional
        Of every row, whatever the table says.
    """
    if stated is not None:
        return np.full(measured.shape, stated), f"as stated: {100 * stated:g} %"
    repeats: dict[tuple[object, ...], list[int]] = {}
    for k, cell in enumerate(cells):
        repeats.setdefault(cell, []).append(k)
    squares, freedom = 0.0, 0
    for rows in repeats.values():
        values = measured[rows]
        squares += float(((values - values.mean()) ** 2).sum())
        freedom += len(rows) - 1
    known = ~np.isnan(given)
    errors = np.hypot(np.where(known, given, 0.0), least)
    sources = [f"the table, and {100 * least:g} % of the light"] if known.any() else []
    if not known.all():
        other, source = assumed, f"assumed: {100 * assumed:g} %"
        if freedom >= 2:
            other = max((squares / freedom) ** 0.5, least)
            source = f"repeated rows: {100 * other:.2g} %"
        errors = np.where(known, errors, other)
        sources.append(source)
    return errors, "; ".join(sources)


def levels_of(light: Array) -> NDArray[np.int64]:
    """Return the number of the light level of each row, from 0, (n,)."""
    return np.unique(light, return_inverse=True)[1].astype(np.int64)
