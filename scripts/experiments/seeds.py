"""Trainings of several configurations and seeds, and which differences their seeds carry.

Two configurations differ where chance alone would hardly part their seeds so far: by the exact test
of all ways to deal the values out to both, of the difference of the means, two-sided, at 5 % over
all pairs together (Holm).  Five seeds a configuration are the least with which six pairs can pass.
What it cannot see: it is about other seeds with the same test data, not about other test data.
"""

from __future__ import annotations

import hashlib
import json
import multiprocessing
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from itertools import combinations
from pathlib import Path
from typing import Any, Protocol

import click
import cv2
import numpy as np
from networks import torch_module
from writing import load_pyplot, table

from adv2e.errors import DataError
from experiments.simulators.clip import Simulator
from experiments.simulators.named import named, sets_option, sources_option
from experiments.training import written

MEASURED = "measures.json"
LEVEL = 0.05
Values = Mapping[str, Sequence[float]]
"""One value a seed, by configuration."""


class Job(Protocol):
    """One training with its test."""

    @property
    def folder(self) -> Path:
        """Where it is kept."""

    @property
    def settings(self) -> dict[str, Any]:
        """All that decides its numbers, with ``simulator`` and ``seed``."""

    def run(self) -> dict[str, Any]:
        """Train and test; return ``measures`` by name, and what else is to be kept."""


def done(job: Job) -> dict[str, Any]:
    """Return what came of a training, which is read where it was kept; on one thread."""
    path = job.folder / MEASURED
    if path.exists():
        held = json.loads(path.read_text("utf-8"))
        if held["settings"] == job.settings:
            return held
    torch_module().set_num_threads(1)
    cv2.setNumThreads(1)
    held = {"settings": job.settings, **job.run()}
    raw = json.dumps(held, indent=1) + "\n"
    written(path, lambda place: place.write_text(raw, "utf-8"))
    return held


def about(simulator: Simulator) -> dict[str, str]:
    """Return what a training keeps of its simulator: name, nature, and a digest of all it is."""
    digest = hashlib.sha256(repr(simulator).encode()).hexdigest()[:16]
    return {"simulator": simulator.name, "nature": simulator.nature, "digest": digest}


def all_done(jobs: Sequence[Job], processes: int) -> None:
    """Train and test all, so many at a time, each in a process of its own."""
    torch_module()  # what is missing is told at once, and by this process
    load_pyplot()
    if processes == 1:
        for number, job in enumerate(jobs, 1):
            done(job)
            click.echo(f"{job.folder.name} done, {number} of {len(jobs)}", err=True)
        return
    # forked processes would share the locks of PyTorch's threads
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(processes, mp_context=context) as pool:
        coming = {pool.submit(done, job): job for job in jobs}
        try:
            for number, one in enumerate(as_completed(coming), 1):
                one.result()
                click.echo(f"{coming[one].folder.name} done, {number} of {len(jobs)}", err=True)
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise


def measured(folder: Path) -> list[dict[str, Any]]:
    """Return what came of all trainings in a folder, by configuration and seed.

    Raises
    ------
    DataError
        There is none, or they differ in more than simulator and seed.
    """
    paths = folder.glob(f"*/{MEASURED}")
    found = [json.loads(path.read_text("utf-8")) for path in paths]
    if not found:
        raise DataError(f"{folder}: no */{MEASURED} in it; small makes them")
    for one in found[1:]:
        for name in found[0]["settings"]:
            a, b = (each["settings"].get(name) for each in (found[0], one))
            if name not in ("simulator", "nature", "digest", "seed") and a != b:
                raise DataError(
                    f"{folder}: trainings with {name} {a!r} and {b!r}: not to be compared"
                )
    return sorted(found, key=lambda one: (one["settings"]["simulator"], one["settings"]["seed"]))


def values_of(found: Iterable[Mapping[str, Any]], name: str) -> dict[str, list[float]]:
    """Return one measure, a value a seed, by configuration."""
    values: dict[str, list[float]] = {}
    for one in found:
        values.setdefault(one["settings"]["simulator"], []).append(one["measures"][name])
    return values


def p_value(a: Sequence[float], b: Sequence[float]) -> float:
    """Return the share of all deals whose means are as far apart at least."""
    both, total = np.array([*a, *b]), len(a) + len(b)
    apart = abs(np.mean(a) - np.mean(b))
    first = both[np.array(list(combinations(range(total), len(a))))].sum(1)
    differences = first / len(a) - (both.sum() - first) / len(b)
    return float(np.mean(np.abs(differences) >= apart - 1e-12))


def parted(values: Values, level: float = LEVEL) -> list[tuple[str, str]]:
    """Return the pairs that differ, the one with the larger mean first."""
    pairs = list(combinations(values, 2))
    chances = sorted((p_value(values[a], values[b]), (a, b)) for a, b in pairs)
    found = []
    for left, (chance, (a, b)) in zip(range(len(pairs), 0, -1), chances, strict=True):
        if chance * left > level:
            break
        found.append((a, b) if np.mean(values[a]) > np.mean(values[b]) else (b, a))
    return found


def sentence(name: str, values: Values, larger_is_better: bool) -> str:
    """Return in words which configurations a measure puts apart."""
    found = [pair if larger_is_better else pair[::-1] for pair in parted(values)]
    if not found:
        return f"{name}: the seeds do not part any two configurations: no ranking."
    rest = len(list(combinations(values, 2))) - len(found)
    said = "; ".join(f"{better} is better than {worse}" for better, worse in found)
    return f"{name}: {said}. The other pairs ({rest}) are not parted by their seeds."


def report(found: Sequence[Mapping[str, Any]], measures: Mapping[str, bool]) -> str:
    """Return the table of all measures and what their spread carries, in Markdown.

    `measures` tells of each whether larger is better; those that were not taken are left out.
    """
    taken = {name: larger for name, larger in measures.items() if name in found[0]["measures"]}
    rows, said = [], []
    for name, larger in taken.items():
        values = values_of(found, name)
        for configuration, each in values.items():
            spread = f"{np.std(each, ddof=1):.4f}" if len(each) > 1 else ""
            seeds = " ".join(f"{one:.4f}" for one in each)
            rows.append([configuration, name, f"{np.mean(each):.4f}", spread, seeds])
        said.append(f"- {sentence(name, values, larger)}")
    natures = {one["settings"]["simulator"]: one["settings"]["nature"] for one in found}
    about = [f"- {name}: {nature}" for name, nature in natures.items()]
    head = ["configuration", "measure", "mean", "deviation", "each seed"]
    about_level = f"At {LEVEL:.0%} over all pairs of a measure, by the exact test of all deals:"
    return "\n".join([table(head, rows), "", about_level, "", *said, "", *about])


def anew(names: str, sets: Sequence[str], v2e_sources: Path | None) -> list[Simulator]:
    """Return the simulators of a list of names, each on one thread."""
    chosen = [name for name in names.split(",") if name]
    return list(named(chosen, sets=sets, v2e_sources=v2e_sources, threads=1))


def simulators_option(default: str) -> Any:
    """Return the options that choose simulators which make events of new clips."""

    def add(command: Callable[..., None]) -> Callable[..., None]:
        names = click.option("--simulators", "names", default=default, show_default=True)
        return names(sets_option(sources_option(command)))

    return add
