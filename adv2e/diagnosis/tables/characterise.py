"""From a table to what it says of the camera: a :class:`adv2e.reports.result.Diagnosis`."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from adv2e import __version__
from adv2e.config import to_dict
from adv2e.config.tree import set_key
from adv2e.diagnosis.tables.latency import LatencyProblem
from adv2e.diagnosis.tables.noise_problem import NoiseProblem
from adv2e.diagnosis.tables.problem import Declared, Settings
from adv2e.diagnosis.tables.selection import Choice, FittedSet, Selector
from adv2e.diagnosis.tables.table import Latencies, Table, measurements_of
from adv2e.errors import DataError
from adv2e.files.regular import shown
from adv2e.reports.markup import OF_TABLES
from adv2e.reports.result import Band, Curve, Diagnosis, ErrorRow, Estimate, Finding, Rejected

_REMARKS = {
    "consistent": "The declared model fits the table within its errors: keep that model as it is.",
    "unexplained": "No effect predicts light held out: do not add any ({change} adding {best}, the"
    " best; {constant:.3g} with a constant).",
    "not_identifiable": "The table cannot tell these effects apart ({change}): only another table"
    " tells which is right.",
    "partly_explained": "More than the errors of the table is left ({change}): use the model found,"
    " but know what still differs.",
    "together": "Only together do these effects meet all rows within their errors. So few light"
    " levels do not tell one that is held out ({change}).",
    "explained": "What is left is within the errors of the table ({change}): use the model found.",
}


def characterise(table: Table, declared: Declared, settings: Settings | None = None) -> Diagnosis:
    """Return the diagnosis of a table: effects that the declared model lacks.

    Parameters
    ----------
    table : Table
        Of latencies or of noise rates (:mod:`adv2e.diagnosis.tables.table`).
    declared : Declared
        Written keys are held; a change of one is a finding.

    Raises
    ------
    DataError
        The table is wrong, or too small to hold a level out.
    """
    settings = settings or Settings()
    problem = problem_of(table, declared, settings)
    selector = Selector(problem, settings)
    chosen = selector.select()
    before, after, found = chosen.before, chosen.after, chosen.after.settings
    split = "each light level held out in turn: fitted to all others, judged on it"
    if problem.test.any():
        rows = f"the {problem.test.sum()} rows where {' and '.join(settings.judge)}"
        split = f"fitted without {rows}, judged there"
    # the declared configuration with what was fitted; effects that are not found are off
    model = to_dict(declared.config)
    for key, value in {**problem.neutral, **found}.items():
        if "[" not in key:  # or it is no key, but a threshold of the table
            set_key(model, key, value)
    effects = _findings(after, selector)
    best = chosen.best if chosen.verdict == "unexplained" else after
    change = f"error on light held out: {before.error:.3g} before, {best.error:.3g} after"
    names = dict.fromkeys(name for rival in chosen.alternatives for name in rival.names)
    others = [name for name in names if name not in after.names]
    return Diagnosis(
        verdict=chosen.verdict,
        remark=_REMARKS[
            "together" if chosen.together and not chosen.alternatives else chosen.verdict
        ].format(change=change, best=" + ".join(best.names), constant=selector.constant),
        recording=shown(table.name),
        declared=declared.name,
        effects=effects,
        alternatives=others or [" + ".join(rival.names) for rival in chosen.alternatives],
        nuisances={one.key: found[one.key] for one in problem.nuisances.parameters},
        rejected=[*chosen.rejected, *(Rejected(*one) for one in problem.out_of_reach.items())],
        errors=_errors(chosen, selector),
        global_p_before=selector.drawn(before).p,
        global_p_after=selector.drawn(after).p,
        curves=_curves(chosen, selector),
        split=split,
        notes=[*problem.notes, f"Errors of the rows: {problem.error_source}."],
        model=model,
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


def _findings(model: FittedSet, selector: Selector) -> list[Finding]:
    """Return what was found, with 95 % intervals.

    They are widened where the model misfits by more than the stated errors.
    """
    freedom = int((~selector.problem.test).sum()) - len(model.point)
    factor = max(1.0, (model.misfit / freedom) ** 0.5) if freedom > 0 else 1.0
    apart = np.quantile(selector.drawn(model).logs - model.point, (0.025, 0.975), axis=0)
    ends = np.exp(model.point + factor * np.clip(apart, [[-np.inf], [0.0]], [[0.0], [np.inf]]))
    keys = [one.key for one in model.joint.parameters]
    intervals = {
        key: (float(low), float(high)) for key, (low, high) in zip(keys, ends.T, strict=True)
    }
    found: dict[str, Finding] = {}
    for effect in model.effects:
        # two keys of one effect may have been added one after another
        same = found.pop(effect.name, Finding(effect.name, {}, {}))
        own = [one.key for one in effect.parameters]
        values = {key: model.settings[key] for key in (*own, *dict(effect.extra))}
        found[effect.name] = Finding(
            effect.name,
            {**same.parameters, **values},
            {**same.interval, **{key: intervals[key] for key in own}},
        )
    return list(found.values())


def _errors(chosen: Choice, selector: Selector) -> list[ErrorRow]:
    problem = selector.problem
    squares = np.array([chosen.before.errors, chosen.after.errors, selector.floors])
    held = f"weighted root mean square of ln(measured/predicted) {problem.what}, on light held out"
    rows = [(held, squares.mean(axis=1))]
    levels = np.unique(problem.level[problem.held_out])
    for k, level in enumerate(levels if levels.size > 1 else ()):
        light = float(problem.light[problem.level == level][0])
        rows.append((f"the same, at {light:g} {problem.light_unit}", squares[:, k]))
    return [
        ErrorRow(name, Estimate(before), Estimate(after), Estimate(floor))
        for name, row in rows
        for before, after, floor in [np.sqrt(row).tolist()]
    ]


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
    low, high = np.quantile(selector.drawn(model).predicted[:, rows], (0.025, 0.975), axis=0)
    middle = selector.predicted(model.joint, model.point)[rows]
    return Band(np.exp(middle), np.exp(low), np.exp(high))
