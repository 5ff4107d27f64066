"""From a table to what it says of the camera: a :class:`adv2e.reports.result.Diagnosis`."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e import __version__
from adv2e.config import to_dict
from adv2e.config.tree import set_key
from adv2e.diagnosis.tables.latency_problem import LatencyProblem
from adv2e.diagnosis.tables.measurements import Latencies, measurements_of
from adv2e.diagnosis.tables.noise_problem import NoiseProblem
from adv2e.diagnosis.tables.problem import Array, Declared, Settings, is_key
from adv2e.diagnosis.tables.selection import Choice, FittedSet, Selector
from adv2e.diagnosis.tables.table import Table
from adv2e.errors import DataError
from adv2e.files.regular import shown
from adv2e.reports.markup import OF_TABLES
from adv2e.reports.result import (
    Band,
    Curve,
    Diagnosis,
    ErrorRow,
    Estimate,
    Finding,
    Interval,
    Rejected,
)


def characterise(table: Table, declared: Declared, settings: Settings | None = None) -> Diagnosis:
    """Return the diagnosis of a table: effects that the declared model lacks.

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
    selector = Selector(problem, settings)
    chosen = selector.select()
    before, after = chosen.before, chosen.after
    found = after.settings
    split = "each light level held out in turn: fitted to all others, judged on it"
    if problem.test.any():
        rows = f"the {problem.test.sum()} rows where {' and '.join(settings.judge)}"
        split = f"fitted without {rows}, judged there"
    effects = _findings(after, selector)
    out_of_reach = [Rejected(*one) for one in problem.out_of_reach.items()]
    return Diagnosis(
        verdict=chosen.verdict,
        remark=_remark(chosen, selector),
        recording=shown(table.name),
        declared=declared.name,
        effects=effects,
        alternatives=_alternatives(chosen),
        nuisances={one.key: found[one.key] for one in problem.nuisances.parameters},
        rejected=[*chosen.rejected, *out_of_reach],
        errors=_errors(chosen, selector),
        global_p_before=selector.drawn(before).p,
        global_p_after=selector.drawn(after).p,
        signatures=[],
        curves=_curves(chosen, selector),
        maps=[],
        detectable=[],
        masked=[],
        split=split,
        notes=[*problem.notes, f"Errors of the rows: {problem.error_source}."],
        model=_model(declared, {**problem.neutral, **found}),
        facts={
            "rows": str(problem.measured.size),
            "light levels": str(np.unique(problem.level).size),
            "drawn tables": str(settings.draws),
            "seed": str(settings.seed),
            "adv2e": __version__,
        },
        wording=OF_TABLES,
        declared_values={
            key: declared.written.get(key) for one in effects for key in one.parameters
        },
    )


def problem_of(
    table: Table, declared: Declared, settings: Settings
) -> LatencyProblem | NoiseProblem:
    """Return the model of the table's chosen rows; the errors are those of `characterise`."""
    for condition in settings.where:
        table = table.kept(table.matching(condition, "--where"))
    test = np.full(len(table), bool(settings.judge))
    for condition in settings.judge:
        test &= table.matching(condition, "--judge")
    if settings.judge and not test.any():
        raise DataError(f"{table.name}: --judge: no row meets {' and '.join(settings.judge)}")
    data = measurements_of(table)
    problem: LatencyProblem | NoiseProblem
    if isinstance(data, Latencies):
        problem = LatencyProblem(data, declared, test, settings)
    else:
        problem = NoiseProblem(data, declared, test, settings)
    rest, unknown = int((~problem.test).sum()), len(problem.nuisances.parameters)
    if rest <= unknown + 1:
        raise DataError(
            f"{table.name}: {rest} rows are left for fitting {unknown} parameters and an effect;"
            " that is too few"
        )
    return problem


def _model(declared: Declared, values: dict[str, float]) -> dict[str, Any]:
    """Return the declared configuration with what was fitted, as nested mappings.

    Keys that were not written stand as they were fitted: effects that are not found are off.
    """
    tree = to_dict(declared.config)
    for key, value in values.items():
        if is_key(key):
            set_key(tree, key, value)
    return tree


def _findings(model: FittedSet, selector: Selector) -> list[Finding]:
    intervals, values = _intervals(model, selector), model.settings
    found: dict[str, Finding] = {}
    for effect in model.effects:
        keys = [one.key for one in effect.parameters]
        # two keys of one effect may have been added one after another
        same = found.pop(effect.name, Finding(effect.name, {}, {}))
        besides = [key for key, _ in effect.extra]
        found[effect.name] = Finding(
            effect.name,
            {**same.parameters, **{key: values[key] for key in (*keys, *besides)}},
            {**same.interval, **{key: intervals[key] for key in keys}},
        )
    return list(found.values())


def _intervals(model: FittedSet, selector: Selector) -> dict[str, Interval]:
    """Return 95 % intervals, widened where the model misfits by more than the stated errors."""
    freedom = int((~selector.problem.test).sum()) - len(model.point)
    factor = max(1.0, (model.misfit / freedom) ** 0.5) if freedom > 0 else 1.0
    apart = selector.drawn(model).logs - model.point
    intervals = {}
    for one, at, column in zip(model.joint.parameters, model.point, apart.T, strict=True):
        low, high = np.quantile(column, (0.025, 0.975))
        ends = at + factor * min(low, 0.0), at + factor * max(high, 0.0)
        intervals[one.key] = float(np.exp(ends[0])), float(np.exp(ends[1]))
    return intervals


def _alternatives(chosen: Choice) -> list[str]:
    names = dict.fromkeys(name for model in chosen.alternatives for name in model.names)
    others = [name for name in names if name not in chosen.after.names]
    return others or [" + ".join(model.names) for model in chosen.alternatives]


def _errors(chosen: Choice, selector: Selector) -> list[ErrorRow]:
    problem, floors = selector.problem, selector.floors
    held = f"weighted root mean square of ln(measured/predicted) {problem.what}, on light held out"
    rows = [_row(held, chosen.before.error, chosen.after.error, float(np.sqrt(floors.mean())))]
    levels = np.unique(problem.level[problem.held_out])
    for k, level in enumerate(levels if levels.size > 1 else ()):
        light = float(problem.light[problem.level == level][0])
        at_level = (chosen.before.errors[k], chosen.after.errors[k], floors[k])
        name = f"the same, at {light:g} {problem.light_unit}"
        rows.append(_row(name, *(float(square**0.5) for square in at_level)))
    return rows


def _row(name: str, before: float, after: float, floor: float) -> ErrorRow:
    return ErrorRow(name, Estimate(before), Estimate(after), Estimate(floor))


def _curves(chosen: Choice, selector: Selector) -> list[Curve]:
    """Return measured and predicted values over the light, a curve a group of rows."""
    problem, curves = selector.problem, []
    for title, group in problem.groups.items():
        rows = group[np.argsort(problem.light[group], kind="stable")]
        before, after = (_band(model, selector, rows) for model in (chosen.before, chosen.after))
        curves.append(
            Curve(
                title=f"{problem.what.capitalize()}, {title}",
                x_label=f"light [{problem.light_unit}]",
                y_label=f"{problem.what} [{problem.unit}]",
                x=problem.light[rows],
                measured=np.exp(problem.measured[rows]),
                before=before,
                after=after,
                x_log=True,
                y_log=True,
            )
        )
    return curves


def _band(model: FittedSet, selector: Selector, rows: NDArray[np.int64]) -> Band:
    def at(logs: Array) -> Array:
        return np.exp(selector.predicted(model.joint, logs)[rows])

    many = np.array([at(logs) for logs in selector.drawn(model).logs])
    low, high = np.quantile(many, (0.025, 0.975), axis=0)
    return Band(at(model.point), low, high)


def _remark(chosen: Choice, selector: Selector) -> str:
    change = f"error on light held out: {chosen.before.error:.3g} before"
    change += f", {chosen.after.error:.3g} after"
    if chosen.verdict == "consistent":
        return "The declared model fits the table within its errors: keep that model as it is."
    if chosen.verdict == "unexplained":
        constant = f"{change}, {selector.constant:.3g} with it"
        return f"No effect does better than a constant ({constant}): do not add any."
    if chosen.verdict == "not_identifiable":
        told = "only another table tells which is right"
        return f"The table cannot tell these effects apart ({change}): {told}."
    if chosen.verdict == "partly_explained":
        told = "use the model found, but know what still differs"
        return f"More than the errors of the table is left ({change}): {told}."
    return f"What is left is within the errors of the table ({change}): use the model found."
