"""Result of a diagnosis, as plain values from which the reports are written."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from adv2e.reports.headline import sentence_of
from adv2e.reports.markup import NO_OWN, OF_RECORDINGS, Own, Wording

Verdict = Literal["consistent", "explained", "partly_explained", "not_identifiable", "unexplained"]

Kind = Literal["count", "time", "other"]
"""Of summary statistics: numbers and rates of events, times of events, and all else."""

Interval = tuple[float, float]
"""Lower and upper end of a 95 % interval."""
ListInterval = tuple[tuple[float, ...], tuple[float, ...]]
"""The same of a key that is a list."""


@dataclass(frozen=True)
class Finding:
    """An effect that was added to the model.

    Attributes
    ----------
    parameters : mapping
        Fitted value of each key, by its path in the configuration.
    interval : mapping
        95 % interval of each.
    """

    name: str
    parameters: Mapping[str, Any]
    interval: Mapping[str, Interval | ListInterval]


@dataclass(frozen=True)
class SceneNumber:
    """A number of the scene that was fitted, so that it is no knowledge of the scene.

    `bounds`: between which it was sought; None: it is one of two.
    """

    name: str
    value: Any
    unit: str
    meaning: str
    bounds: tuple[float, float] | None


@dataclass(frozen=True)
class Rejected:
    """An effect that was tried and not added, and why.

    `held_out`: misfit with it on data that it was not fitted to, as a share of that of the declared
    model; the rest is what it explains.
    """

    name: str
    reason: str
    parameters: Mapping[str, Any] = field(default_factory=dict)
    held_out: float | None = None


@dataclass(frozen=True)
class Estimate:
    """A number with its 95 % interval, where one is known."""

    value: float
    interval: Interval | None = None

    @classmethod
    def of_draws(cls, values: Sequence[float] | NDArray[np.float64]) -> Estimate:
        """Return the mean of draws, and the range of their middle 95 %."""
        low, high = np.quantile(values, [0.025, 0.975])
        return cls(float(np.mean(values)), (float(low), float(high)))


ROLES = ("before", "after", "floor")
"""Of the numbers of an error: declared model, model found, draws of that against each other."""


@dataclass(frozen=True)
class ErrorRow:
    """One measure of distance between recording and simulation.

    Attributes
    ----------
    name : str
        What it measures, in a few words.
    without_chance : bool
        Of the mean of simulations: what chance makes in each of them does not count.
    """

    name: str
    before: Estimate
    after: Estimate
    floor: Estimate
    without_chance: bool = False


@dataclass(frozen=True)
class Signature:
    """One summary statistic on held-out data.

    Attributes
    ----------
    group : str
        What it belongs to, such as "time between events".
    meaning : str
        One sentence.
    measured, before, after : float
        Its value in the recording, and on average in the two models' simulations.
    z_before, z_after : float
        Distance of the recording from the simulations in their standard deviations.
    unit : str
        Of the values; of a share or a ratio: of what to what.
    """

    name: str
    group: str
    meaning: str
    measured: float
    before: float
    after: float
    z_before: float
    z_after: float
    unit: str
    kind: Kind = "other"


@dataclass(frozen=True)
class Total:
    """A number that describes all events of a recording, and of simulations: mean and 95 %."""

    name: str
    unit: str
    measured: float
    before: Estimate
    after: Estimate


@dataclass(frozen=True)
class Snapshot:
    """Events of one short time, as measured and in a simulation of either model.

    Attributes
    ----------
    start_s, length_s : float
        When the time begins, after the start of what was looked at, and how long it is.
    measured, before, after : (2, rows, columns) integers
        Numbers of OFF events and of ON events.
    """

    start_s: float
    length_s: float
    measured: NDArray[np.int64]
    before: NDArray[np.int64]
    after: NDArray[np.int64]


@dataclass(frozen=True)
class Band:
    """A curve of many simulations: median, and the range of the middle 95 %."""

    middle: NDArray[np.float64]
    low: NDArray[np.float64]
    high: NDArray[np.float64]


@dataclass(frozen=True)
class Curve:
    """Something measured over something else, with both models.

    Attributes
    ----------
    title, x_label, y_label : str
        With units.
    x : (n,) or (n + 1,)
        Places of the points, or, one more than values, borders of bins.
    measured : (n,)
        NaN where there is nothing to measure.
    x_log, y_log : bool
        Logarithmic axes.
    x_names : sequence of str
        Names of the bins, in the place of numbers at their borders.
    """

    title: str
    x_label: str
    y_label: str
    x: NDArray[np.float64]
    measured: NDArray[np.float64]
    before: Band
    after: Band
    x_log: bool = False
    y_log: bool = False
    x_names: Sequence[str] = ()


@dataclass(frozen=True)
class ResidualMap:
    """Residual over the sensor, (rows, columns), in standard deviations; NaN: masked."""

    title: str
    before: NDArray[np.float64]
    after: NDArray[np.float64]


@dataclass(frozen=True)
class Detectable:
    """Smallest size of an effect that would have been seen 8 times in 10, if there is one."""

    name: str
    key: str
    size: float | None
    unit: str


@dataclass(frozen=True)
class Masked:
    """Data that was set aside, and the share of events in it."""

    what: str
    share: float


@dataclass(frozen=True, kw_only=True)
class Diagnosis:
    """Result of a diagnosis.

    Attributes
    ----------
    verdict : Verdict
        "unfinished" is none: the diagnosis goes on.
    remark : str
        What the verdict says besides :attr:`sentence`.
    recording, declared : str
        Names of the inputs.
    effects : list of Finding
        In the order in which they were added.
    alternatives : list of str
        Effects that fit the data as well.
    nuisances : mapping
        Keys that were not declared, with their fitted values.
    errors : list of ErrorRow
        The first is the one that ``report.json`` gives.
    global_p_before, global_p_after : float
        Probability of a residual as large if nothing were missing, in all data that are compared:
        below 0.01 something is left.
    snapshot : Snapshot, optional
        None where there are no events to show, as of tables.
    curves, maps
        The picture of the residual.
    split : str
        How the data were divided into those for training, validation and test.
    notes : list of str
        What the reader should know besides, such as the bound of the interpolation error.
    model : mapping
        The configuration found, for ``model.yaml``.
    facts : mapping
        Small things for the end of the report: sizes, seeds, simulations, seconds, versions.
    own : Own
        Effects of the user's own that competed.
    input_checks : list of str
        Those of the notes that are on the recording itself, such as what may be wrong with it.
    wording : Wording
        What the reports call things.
    declared_values : mapping
        What the declared model holds of each key that was fitted, by path; None: it is off.
    defaults : collection of str
        Those of these keys that nobody wrote: the program's defaults stand for them.
    view : list of SceneNumber
        How the camera saw a known film, as fitted; none where frames or light are the scene.
    still : str
        What a diagnosis that is not finished is at.
    """

    verdict: Verdict | Literal["unfinished"]
    remark: str
    recording: str
    declared: str
    effects: list[Finding]
    alternatives: list[str] = field(default_factory=list)
    nuisances: Mapping[str, Any]
    rejected: list[Rejected] = field(default_factory=list)
    errors: list[ErrorRow] = field(default_factory=list)
    global_p_before: float = math.nan
    global_p_after: float = math.nan
    signatures: list[Signature] = field(default_factory=list)
    curves: list[Curve] = field(default_factory=list)
    maps: list[ResidualMap] = field(default_factory=list)
    detectable: list[Detectable] = field(default_factory=list)
    masked: list[Masked] = field(default_factory=list)
    split: str = ""
    notes: list[str] = field(default_factory=list)
    model: Mapping[str, Any]
    facts: Mapping[str, str] = field(default_factory=dict)
    own: Own = NO_OWN
    input_checks: Sequence[str] = ()
    wording: Wording = OF_RECORDINGS
    declared_values: Mapping[str, Any] = field(default_factory=dict)
    defaults: Collection[str] = ()
    totals: Sequence[Total] = ()
    snapshot: Snapshot | None = None
    view: Sequence[SceneNumber] = ()
    still: str = ""

    @property
    def compared(self) -> str:
        """The data whose numbers are compared."""
        if self.verdict == "unfinished" and not self.errors:
            return "on the data for fitting"
        return "on data that was not used for fitting"

    @property
    def sentence(self) -> str:
        """The finding in one sentence, with its numbers."""
        return sentence_of(self)
