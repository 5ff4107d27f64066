"""A table, the model of it, and what the model may lack: what selection works on."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from adv2e.config import Config, load_config, names_of, written_keys
from adv2e.diagnosis.fitting.candidates import Candidate, FitParameter

Array = NDArray[np.float64]

CUTOFF, DARK_CUTOFF = "pixel.low_pass.cutoff_hz", "pixel.low_pass.dark_cutoff_hz"
DARK_CURRENT, FOLLOWER = "pixel.dark_current.dn", "pixel.source_follower.cutoff_hz"


@dataclass(frozen=True)
class Settings:
    """Settings of the characterisation of a table.

    Attributes
    ----------
    where : sequence of str
        ``COLUMN=VALUE``: only rows that meet all of them.
    judge : sequence of str
        Rows that meet all of them are kept for testing; none: each light level is held out in turn.
    white : float, optional
        Light that 255 DN stand for, in the table's unit; default: the highest.
    contrast : float
        Size of the steps [ln] where a table of latencies does not say.
    error : float, optional
        Relative standard error of every row; default: the table's.
    seed : int
        Of the drawn tables.
    draws : int
        How many are drawn.
    log : callable
        Takes lines for people.
    """

    where: Sequence[str] = ()
    judge: Sequence[str] = ()
    white: float | None = None
    contrast: float = 1.0
    error: float | None = None
    seed: int = 0
    draws: int = 199
    log: Callable[[str], None] = lambda text: None


@dataclass(frozen=True)
class Declared:
    """Declared model of the camera.

    Attributes
    ----------
    name : str
        Names of the files, for reports.
    config : Config
        The written keys on top of the defaults.
    written : mapping of str to value
        The keys that were written, by path; they are held.
    """

    name: str
    config: Config
    written: Mapping[str, Any]

    def held(self, path: str) -> float:
        """Return the number written for a key; 0, off, where none is or its section is off.

        Defaults of this program are no knowledge of a camera, so that a key which is not written
        stands for the effect being absent.
        """
        return float(self.written.get(path) or 0.0)

    def value(self, fitted: Mapping[str, float], path: str) -> float:
        """Return the fitted value of a key, else the declared one; see :meth:`held`."""
        return fitted[path] if path in fitted else self.held(path)


def read_declared(
    files: Sequence[str | Path] = (), sets: Sequence[str] = (), seed: int | None = None
) -> Declared:
    """Return the declared model of configuration files and ``--set`` values.

    Raises
    ------
    ConfigError, UsageError
        As :func:`adv2e.config.load_config`.
    """
    config = load_config(files, sets, seed)
    return Declared(names_of(files, sets) or "nothing", config, written_keys(files, sets))


class Problem(ABC):
    """Measured values, n in all, and a model of them.

    Attributes
    ----------
    what, unit : str
        What is measured.
    out_of_reach : mapping of str to str
        Effects that cannot act on such a table, and why.
    measured, error : (n,)
        Natural logarithms, and their standard errors.
    error_source : str
        Where those come from.
    light : (n,)
        In `light_unit`; `white` of it is 255 DN.
    level : (n,) of int
        Number of the light level.
    test : (n,) of bool
        Kept for testing, never fitted.
    groups : mapping of str to arrays of int
        Rows that make one curve over the light, by its title.
    nuisances : Candidate
        Keys that are always fitted; in a name with a bracket, what is no key of the configuration.
    neutral : mapping of str to float
        Keys that this model has at a value other than the default, where not written.
    step : float
        By which logarithms of parameters are moved for a derivative.
    tolerance : float
        A step of a fit that lowers the sum of squares by less than this share of it is the last.
    """

    what: ClassVar[str]
    unit: ClassVar[str]
    out_of_reach: ClassVar[Mapping[str, str]]
    measured: Array
    error: Array
    error_source: str
    level: NDArray[np.int64]
    groups: dict[str, NDArray[np.int64]]
    nuisances: Candidate
    candidates: list[Candidate]
    neutral: dict[str, float]
    notes: list[str]
    step: ClassVar[float] = 1e-2
    tolerance: ClassVar[float] = 1e-6

    def __init__(
        self, declared: Declared, light: Array, unit: str, test: NDArray[np.bool_], white: float
    ) -> None:
        self.declared, self.light, self.light_unit, self.white = declared, light, unit, white
        self.test = test
        self.level = np.unique(light, return_inverse=True)[1].astype(np.int64)

    @property
    def held_out(self) -> NDArray[np.bool_]:
        """Rows that errors are told of: those kept for testing, or else all, (n,)."""
        return self.test if self.test.any() else ~self.test

    @abstractmethod
    def predict(self, values: Mapping[str, float]) -> Array:
        """Return the logarithms that the model with fitted values predicts, (n,), finite."""


def of_one(name: str, key: str, *starts: float, reach: float = 30.0) -> Candidate:
    """Return an effect with one key, which reaches by a factor beyond all starts."""
    parameter = FitParameter(key, min(starts) / reach, max(starts) * reach)
    return Candidate(name, (parameter,), tuple((start,) for start in starts))


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
