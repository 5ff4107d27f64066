"""Tables of the study, in Markdown, and the confusion matrix as a picture."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from statistics import median

import numpy as np
from numpy.typing import NDArray
from writing import load_pyplot, save_figure, table

from adv2e.diagnosis.selection.search import LEVEL
from studies import scoring
from studies.cases import (
    KINDS,
    LEFT_OUT,
    LIBRARY,
    MIDDLE,
    NOTHING,
    OUTSIDE,
    OWN_PERIOD,
    PAIRS,
    SAME,
    SIZES,
    Plan,
    catalogue,
)
from studies.results import Line

_SIZES = ("none", *SIZES)


def report(lines: Sequence[Line], commit: str) -> str:
    """Return all tables of one commit's cases."""
    parts = [
        f"# `adv2e diagnose` on an undeclared effect\n\nCommit {commit}. {_how(lines)}",
        "## How much was run\n\n" + progress_table(lines),
        "## Effects in the library, middle size: pooled\n\n" + pooled_table(lines),
        "## Nothing missing: false alarms\n\n" + alarm_table(lines),
        "## Effects in the library: three sizes\n\n" + sizes_table(_of(lines, LIBRARY)),
        *_by_size("Effect left out of the library", lines, LEFT_OUT, strangers_table),
        *_by_size("Effects outside the library", lines, OUTSIDE, strangers_table),
        *_by_size("Two effects", lines, PAIRS, pair_table),
    ]
    if own := _of(lines, OWN_PERIOD):
        parts.append("## Frames of another rate read out\n\n" + sizes_table(own))
    failures = failure_list(lines)
    if failures:
        parts.append("## What went wrong, and what competed\n\n" + failures)
    return "\n\n".join(parts) + "\n"


def _done(lines: Sequence[Line]) -> list[Line]:
    """Return those that did not fail."""
    return [one for one in lines if "failed" not in one]


def share(hits: int, count: int) -> str:
    """Return a count, its share and the 95 % interval of that."""
    if not count:
        return "0 of 0"
    low, high = scoring.interval(hits, count)
    return f"{hits} of {count}: {hits / count:.1%} ({low:.1%} to {high:.1%})"


def _of(lines: Iterable[Line], kind: str, size: str | None = None) -> list[Line]:
    return [one for one in lines if one["kind"] == kind and size in (None, one["size"])]


def _by_size(
    title: str, lines: Sequence[Line], kind: str, made: Callable[[Sequence[Line]], str]
) -> list[str]:
    return [
        f"## {title}: {size} size\n\n{made(_of(lines, kind, size))}"
        for size in SIZES
        if _of(lines, kind, size)
    ]


def _how(lines: Sequence[Line]) -> str:
    setups = Counter(
        "{width}x{height} px, {seconds:g} s, {fps:g} frames a second of {bits} bits,"
        " {interpolation} interpolation".format(**one["setup"])
        for one in lines
    )
    lacking = sorted({name for one in lines for name in one["lacking"]})
    text = f"Recordings: {'; '.join(f'{what} ({n})' for what, n in setups.items())}."
    done = _done(lines)
    if done:
        each = median([one["seconds"]["diagnosis"] for one in done])
        made = median([one["seconds"]["recording"] for one in done])
        many = median([one["simulations"] for one in done])
        load = median([one["load"] for one in done])
        threads = ", ".join(str(n) for n in sorted({one["threads"] for one in done}))
        text += (
            f" Median of a recording: {each:.0f} s for the diagnosis, {many:.0f} simulations,"
            f" {threads} thread(s), load of the machine {load:.1f}; {made:.0f} s to record it."
        )
    if lacking:
        text += f" Not in the library yet, so not studied: {', '.join(lacking)}."
    return text


def progress_table(lines: Sequence[Line]) -> str:
    """Return how many cases of each kind and size there are, of those of a full study."""
    known = [name for name in catalogue.LIBRARY if not any(name in one["lacking"] for one in lines)]
    repeats = 1 + max((one["repeat"] for one in lines if one["kind"] != NOTHING), default=0)
    plan = Plan(KINDS, SIZES, known, repeats=repeats)
    planned = Counter((case.kind, case.size) for case in plan.cases())
    run = Counter((one["kind"], one["size"]) for one in _done(lines))
    rows = []
    for kind in KINDS:
        cells = [
            f"{run[kind, size]} of {planned[kind, size]}" if planned[kind, size] else ""
            for size in _SIZES
        ]
        rows.append([kind, *cells])
    return table(("kind", "no effect", *SIZES), rows)


def pooled_table(lines: Sequence[Line]) -> str:
    """Return the targets over all effects of the library at the middle size."""
    pool = _done(_of(lines, LIBRARY, MIDDLE))
    kinds = [scoring.outcome(one) for one in pool]
    named = [one for one, kind in zip(pool, kinds, strict=True) if kind in scoring.NAMED]
    near = [flag for one in named if (flag := scoring.is_near(one)) is not None]
    covered = [flag for one in named for flag in scoring.covered(one)]
    misnamed = sum(kind in scoring.MISNAMED for kind in kinds)
    at_floor = sum(map(scoring.is_at_floor, named))
    rows = [
        ("named, or among look-alikes", share(len(named), len(pool)), "9 in 10 or more"),
        ("wrong name accepted", share(misnamed, len(pool)), "1 in 20 or fewer"),
        ("named: parameters within 10 %", share(sum(near), len(near)), ""),
        ("named: truth in the 95 % interval, by key", share(sum(covered), len(covered)), ""),
        ("named: held-out error at most 1.1 of its floor", share(at_floor, len(named)), ""),
    ]
    return table(("", "count, share (95 %)", "wanted"), rows)


def alarm_table(lines: Sequence[Line]) -> str:
    """Return how often something was found where nothing was missing."""
    quiet = _done(_of(lines, NOTHING))
    alarms = sum(scoring.outcome(one) == scoring.ALARM for one in quiet)
    low = sum(one["global_p"]["before"] < LEVEL for one in quiet)
    named = sum(bool(one["found"]) for one in quiet)
    rows = [
        (f"global test on the last part below {LEVEL:.0%}", share(low, len(quiet))),
        ("any verdict but consistent", share(alarms, len(quiet))),
        ("an effect named", share(named, len(quiet))),
    ]
    return table(("", "count, share (95 %)"), rows)


def sizes_table(lines: Sequence[Line]) -> str:
    """Return what was said of each effect at each size, in few words.

    Other names stand where the true one was not added, in brackets those that do as well.  Without
    a name it is the verdict; nothing stands where a case was not run.
    """
    rows = []
    for name, group in _grouped(lines):
        cells = [
            "; ".join(_in_short(one, name) for one in group if one["size"] == size)
            for size in SIZES
        ]
        rows.append([name, *cells])
    return table(("effect", *SIZES), rows)


def _in_short(line: Line, name: str) -> str:
    kind = scoring.outcome(line)
    if kind == scoring.FAILED or not line["found"]:
        return kind
    said = f"{scoring.names(line).removeprefix(name).strip()} {_worst([line])}".strip()
    return f"{said}, something left" if line["verdict"] == "partly_explained" else said


def _worst(lines: Sequence[Line]) -> str:
    """Return the error of the parameter farthest from the truth."""
    errors = [max(found.values()) for one in lines if (found := scoring.parameter_errors(one))]
    return f"{100 * max(errors):.1f} %" if errors else ""


def strangers_table(lines: Sequence[Line]) -> str:
    """Return what was said where the true name was not to be had."""
    lines = _done(lines)
    wrong = [one for one in lines if scoring.outcome(one) == scoring.WRONG]
    text = f"A name was accepted with nothing left to explain: {share(len(wrong), len(lines))}"
    if alike := [
        name for one in wrong if _neighbours(one) & _given(one) for name in one["effects"]
    ]:
        text += (
            f"; of these, with the same thing under another key: {len(alike)} ({', '.join(alike)})"
        )
    held = {kind: [one for one in lines if scoring.outcome(one) == kind]
            for kind in scoring.OF_STRANGERS}  # fmt: skip
    rows = [
        [kind, str(len(found)), "; ".join(_taken_as(*group) for group in _grouped(found))]
        for kind, found in held.items()
        if found
    ]
    return f"{text}.\n\n{table(('outcome', 'cases', 'effects'), rows)}"


def pair_table(lines: Sequence[Line]) -> str:
    """Return what became of two effects at once."""
    rows = [
        [name, *_counts(group, scoring.OF_PAIRS), _names(group)] for name, group in _grouped(lines)
    ]
    total = ["all", *_counts(lines, scoring.OF_PAIRS), ""]
    return table(("effects", *scoring.OF_PAIRS, "named"), [*rows, total])


def failure_list(lines: Sequence[Line]) -> str:
    """Return each case that went wrong, with what the search said."""
    parts = []
    for one in lines:
        kind = scoring.outcome(one)
        if kind in (scoring.CLEAR, *scoring.NAMED, scoring.BOTH):
            continue
        if one["kind"] in (OUTSIDE, LEFT_OUT) and kind in (scoring.UNEXPLAINED, scoring.MISSED):
            continue
        hidden = ", ".join(f"{key} = {value}" for key, value in one["hidden"].items())
        said = [one["failed"]] if "failed" in one else [scoring.names(one) or one["verdict"]]
        parts.append(
            f"**{one['key']}** (scene {one['scene']}; {hidden or 'as declared'}): {kind}\n\n```\n"
            + "\n".join([*said, *one["log"]])
            + "\n```"
        )
    return "\n\n".join(parts)


def _neighbours(line: Line) -> set[str]:
    true = set(line["effects"])
    return {name for pair in SAME if true & set(pair) for name in pair} - true


def _given(line: Line) -> set[str]:
    return {*(one["name"] for one in line["found"]), *line["alternatives"]}


def _taken_as(name: str, lines: Sequence[Line]) -> str:
    given = _names(lines)
    return f"{name} as {given}" if given else name


def _grouped(lines: Sequence[Line]) -> list[tuple[str, list[Line]]]:
    """Return the lines of each set of effects, in the catalogue's order."""
    order = (*catalogue.LIBRARY, *catalogue.OUTSIDE)
    held: dict[tuple[str, ...], list[Line]] = {}
    for one in sorted(lines, key=lambda one: [order.index(name) for name in one["effects"]]):
        held.setdefault(tuple(one["effects"]), []).append(one)
    return [(" + ".join(names), group) for names, group in held.items()]


def _counts(lines: Sequence[Line], outcomes: Sequence[str]) -> list[str]:
    found = Counter(scoring.outcome(one) for one in lines)
    return [str(found[kind]) if found[kind] else "" for kind in outcomes]


def _names(lines: Sequence[Line]) -> str:
    return "; ".join(dict.fromkeys(name for one in lines if (name := scoring.names(one))))


# --- the picture ---------------------------------------------------------------------------------

VERDICTS = (scoring.UNEXPLAINED, scoring.MISSED, scoring.FAILED)


def confusion(lines: Sequence[Line]) -> NDArray[np.float64]:
    """Return how often each name was given for each effect, (effects, names and verdicts).

    A recording counts one for the name given; look-alikes share it evenly, and so do several
    names.  Rows and columns are in the catalogue's order, then come ``VERDICTS``.
    """
    order = list(catalogue.LIBRARY)
    matrix = np.zeros((len(order), len(order) + len(VERDICTS)))
    for one in lines:
        row, kind = order.index(one["effects"][0]), scoring.outcome(one)
        if kind in VERDICTS:
            matrix[row, len(order) + VERDICTS.index(kind)] += 1.0
            continue
        given = [*(found["name"] for found in one["found"]), *one["alternatives"]]
        for name in given:
            matrix[row, order.index(name)] += 1.0 / len(given)
    return matrix


def draw(lines: Sequence[Line], path: Path) -> None:
    """Write the figure."""
    panels = []
    for size in SIZES:
        found = [one for one in lines if one["kind"] == LIBRARY and one["size"] == size]
        if found:
            panels.append((size, found))
    count = max(1, len(panels))
    figure, axes = load_pyplot().subplots(
        1, count, figsize=(7.4 * count, 7.2), layout="constrained", squeeze=False
    )
    columns = [*catalogue.LIBRARY, *VERDICTS]
    for one, (size, found) in zip(axes[0], panels, strict=False):
        matrix = confusion(found)
        runs = np.maximum(matrix.sum(axis=1, keepdims=True), 1.0)
        one.imshow(matrix / runs, cmap="Blues", vmin=0.0, vmax=1.0, aspect="auto")
        for row, column in np.argwhere(matrix > 0):
            deep = matrix[row, column] / runs[row, 0] > 0.6
            one.text(
                column, row, f"{matrix[row, column]:.2g}", ha="center", va="center", fontsize=6,
                color="white" if deep else "black",
            )  # fmt: skip
        one.axvline(len(catalogue.LIBRARY) - 0.5, color="grey", lw=0.8)
        one.set_xticks(range(len(columns)), columns, rotation=90, fontsize=7)
        one.set_yticks(range(len(catalogue.LIBRARY)), catalogue.LIBRARY, fontsize=7)
        one.set(
            title=f"{size} size, {len(found)} recordings", xlabel="named", ylabel="in the recording"
        )
    save_figure(figure, path)
