"""From a table to what it says of the camera: a :class:`adv2e.reports.result.Diagnosis`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from adv2e import __version__
from adv2e.config import to_dict
from adv2e.config.paths import set_key
from adv2e.diagnosis.tables.declared import Declared
from adv2e.diagnosis.tables.latency_problem import LatencyProblem
from adv2e.diagnosis.tables.measurements import Latencies, measurements_of
from adv2e.diagnosis.tables.noise_problem import NoiseProblem
from adv2e.diagnosis.tables.problem import Problem, held_rows, is_key
from adv2e.diagnosis.tables.selection import Draws, Model, Selection, Selector
from adv2e.diagnosis.tables.table import Table
from adv2e.errors import DataError
from adv2e.files.names import shown
from adv2e.reports.result import (
    Band,
    Curve,
    Diagnosis,
    ErrorRow,
    Estimate,
    Finding,
    Interval,
    Rejected,
    Verdict,
)
from adv2e.reports.wording import OF_TABLES

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Settings:
    """How a table is to be characterised.

    Attributes
    ----------
    where : sequence of str
        ``COLUMN=VALUE``: only rows that meet all of them.
    judge : sequence of str
        Rows that meet all of them are kept for judging; none: each light level is held out in turn.
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
    tick : callable
        Called with a line of progress.
    """

    where: Sequence[str] = ()
    judge: Sequence[str] = ()
    white: float | None = None
    contrast: float = 1.0
    error: float | None = None
    seed: int = 0
    draws: int = 199
    tick: Callable[[str], None] = field(default=lambda line: None)


def characterise(table: Table, declared: Declared, settings: Settings | None = None) -> Diagnosis:
    """Return which effects the table asks for beyond the declared model.

    Parameters
    ----------
    table : Table
        Of latencies or of noise rates (:mod:`adv2e.diagnosis.tables.measurements`).
    declared : Declared
        Written keys are held; a change of one is a finding.
    settings : Settings, optional

    Raises
    ------
    DataError
        The table is wrong, or too small to hold a level out.
    """
    settings = settings or Settings()
    problem = problem_of(table, declared, settings)
    selector = Selector(problem, settings.seed, settings.draws, settings.tick)
    chosen = selector.select()
    draws = selector.drawn(chosen.after)
    return Diagnosis(
        verdict=cast(Verdict, chosen.verdict),
        sentence=_sentence(chosen, problem),
        recording=shown(table.name),
        declared=declared.name,
        effects=_findings(chosen.after, draws, problem),
        alternatives=_alternatives(chosen),
        nuisances={
            free.key: value
            for free, value in zip(chosen.after.free, chosen.after.fit.values, strict=True)
            if free in problem.nuisances
        },
        rejected=[
            *(
                Rejected(" + ".join(m.names), why, m.values, m.error / chosen.before.error)
                for m, why in chosen.tried
            ),
            *(Rejected(name, why) for name, why in problem.out_of_reach.items()),
        ],
        errors=_errors(chosen, problem),
        global_p_before=_number(chosen.before.p),
        global_p_after=_number(chosen.after.p),
        signatures=[],
        curves=_curves(problem, chosen, selector.drawn(chosen.before), draws),
        maps=[],
        detectable=[],
        masked=[],
        split=_split(problem, settings),
        notes=[*problem.notes, f"Errors of the rows: {problem.error_source}."],
        model=found_model(declared, chosen.after, problem),
        facts={
            "rows": str(problem.measured.size),
            "light levels": str(np.unique(problem.level).size),
            "drawn tables": str(settings.draws),
            "seed": str(settings.seed),
            "adv2e": __version__,
        },
        wording=OF_TABLES,
    )


def problem_of(
    table: Table, declared: Declared, settings: Settings
) -> LatencyProblem | NoiseProblem:
    """Return the model of the table's chosen rows; the errors are those of `characterise`."""
    for condition in settings.where:
        table = table.kept(table.matching(condition, "--where"))
    judged = np.ones(len(table), dtype=np.bool_)
    for condition in settings.judge:
        judged &= table.matching(condition, "--judge")
    if not settings.judge:
        judged[:] = False
    elif not judged.any():
        raise DataError(f"{table.name}: --judge: no row meets {' and '.join(settings.judge)}")
    data = measurements_of(table)
    problem: LatencyProblem | NoiseProblem
    if isinstance(data, Latencies):
        problem = LatencyProblem(
            data, declared, judged, settings.white, settings.contrast, settings.error
        )
        problem.check(table.name)
    else:
        problem = NoiseProblem(data, declared, judged, settings.white, settings.error)
    rest = int((~problem.judged).sum())
    if rest <= len(problem.nuisances) + 1:
        raise DataError(
            f"{table.name}: {rest} rows are left for fitting {len(problem.nuisances)} parameters"
            " and an effect; that is too few"
        )
    return problem


def found_model(declared: Declared, model: Model, problem: Problem) -> dict[str, Any]:
    """Return the declared configuration with what was fitted, as nested mappings.

    Keys that were not written stand as they were fitted: effects that are not found are off.
    """
    tree = to_dict(declared.config)
    values = problem.completed(model.values)
    for key, value in problem.neutral.items():
        values.setdefault(key, value)
    for key, value in values.items():
        if is_key(key):
            set_key(tree, key, value)
    return tree


def _findings(model: Model, draws: Draws, problem: Problem) -> list[Finding]:
    intervals = _intervals(model, draws, problem)
    found: list[Finding] = []
    for effect in model.effects:
        parameters = problem.completed({free.key: model.values[free.key] for free in effect.free})
        inside: dict[str, Any] = {free.key: intervals[free.key] for free in effect.free}
        same = next((one for one in found if one.name == effect.name), None)
        if same is not None:  # two keys of one effect, added one after another
            found.remove(same)
            parameters = {**same.parameters, **parameters}
            inside = {**same.interval, **inside}
        found.append(Finding(effect.name, parameters, inside))
    return found


def _intervals(model: Model, draws: Draws, problem: Problem) -> dict[str, Interval]:
    """Return 95 % intervals, widened where the model misfits by more than the stated errors."""
    freedom = int((~problem.judged).sum()) - len(model.free)
    factor = max(1.0, (model.fit.sum_of_squares / freedom) ** 0.5) if freedom > 0 else 1.0
    intervals = {}
    for k, free in enumerate(model.free):
        low, high = np.quantile(draws.logs[:, k] - model.fit.logs[k], (0.025, 0.975))
        at = model.fit.logs[k]
        intervals[free.key] = (
            float(np.exp(at + factor * min(low, 0.0))),
            float(np.exp(at + factor * max(high, 0.0))),
        )
    return intervals


def _alternatives(chosen: Selection) -> list[str]:
    names: list[str] = []
    for model in chosen.alternatives:
        names += [n for n in model.names if n not in (*chosen.after.names, *names)]
    return names or [" + ".join(model.names) for model in chosen.alternatives]


def _errors(chosen: Selection, problem: Problem) -> list[ErrorRow]:
    held = f"weighted root mean square of ln(measured/predicted) {problem.what}, on light held out"
    floor = float(np.sqrt(chosen.floors.mean()))
    rows = [_row(held, chosen.before.error, chosen.after.error, floor)]
    levels = np.unique(problem.level[held_rows(problem)])
    for k, level in enumerate(levels if levels.size > 1 else ()):
        light = float(problem.light[problem.level == level][0])
        at_level = (chosen.before.errors[k], chosen.after.errors[k], chosen.floors[k])
        name = f"the same, at {light:g} {problem.light_unit}"
        rows.append(_row(name, *(float(square**0.5) for square in at_level)))
    return rows


def _row(name: str, before: float, after: float, floor: float) -> ErrorRow:
    return ErrorRow(name, Estimate(before), Estimate(after), Estimate(floor))


def _curves(problem: Problem, chosen: Selection, before: Draws, after: Draws) -> list[Curve]:
    """Return measured and predicted values over the light, a curve a group of rows."""
    curves = []
    for group in problem.groups:
        rows = group.rows[np.argsort(problem.light[group.rows], kind="stable")]
        bands = [
            _band(problem, model, draws, rows)
            for model, draws in ((chosen.before, before), (chosen.after, after))
        ]
        curves.append(
            Curve(
                title=f"{problem.what.capitalize()}, {group.title}",
                x_label=f"light [{problem.light_unit}]",
                y_label=f"{problem.what} [{problem.unit}]",
                x=problem.light[rows],
                measured=np.exp(problem.measured[rows]),
                before=bands[0],
                after=bands[1],
                x_log=True,
                y_log=True,
            )
        )
    return curves


def _band(problem: Problem, model: Model, draws: Draws, rows: NDArray[np.int64]) -> Band:
    keys = [free.key for free in model.free]

    def at(logs: Array) -> Array:
        values = dict(zip(keys, np.exp(logs).tolist(), strict=True))
        return np.exp(problem.predict(values)[rows])

    many = np.array([at(logs) for logs in draws.logs])
    low, high = np.quantile(many, (0.025, 0.975), axis=0)
    return Band(at(model.fit.logs), low, high)


def _split(problem: Problem, settings: Settings) -> str:
    if problem.judged.any():
        rows = int(problem.judged.sum())
        return f"fitted without the {rows} rows where {' and '.join(settings.judge)}, judged there"
    return "each light level held out in turn: fitted to all others, judged on it"


def _sentence(chosen: Selection, problem: Problem) -> str:
    names = " and ".join(dict.fromkeys(chosen.after.names))
    change = f"held-out error {chosen.before.error:.3g} before, {chosen.after.error:.3g} after"
    if chosen.verdict == "consistent":
        return f"Nothing is missing: the declared model fits the {problem.what} within its errors."
    if chosen.verdict == "unexplained":
        return (
            f"Something is missing, and no effect of the library accounts for it ({change}; a"
            f" constant: {chosen.constant:.3g})."
        )
    if chosen.verdict == "not_identifiable":
        others = " or ".join(" and ".join(model.names) for model in chosen.alternatives)
        return f"Either {names} is missing or {others}: the table cannot tell ({change})."
    if chosen.verdict == "partly_explained":
        return f"Missing: {names}; more than the errors of the table remains ({change})."
    return f"Missing: {names} ({change})."


def _number(value: float | None) -> float:
    assert value is not None
    return value
