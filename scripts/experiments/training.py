"""Trains a network in steps that can be stopped and taken up again, exactly.

A folder holds one training:

================== ===============================================================================
``checkpoint.pt``  network, optimiser, the states of both generators of chance, what it was told
``best.pt``        the network where the measure to go by was best, if there is one
``curve.json``     the loss of each step, and what was measured in between
``curve.png``      the same, drawn
================== ===============================================================================

Each file is written under another name first, so that a stopped training leaves whole ones.  On one
thread of a CPU a training that was stopped anywhere comes to the numbers of one that was not.

Trainings of several configurations and seeds are each done once, several at a time.  Two
configurations differ where chance alone would hardly part their seeds so far: by the exact test
of all ways to deal the values out to both, of the difference of the means, two-sided, at 5 % over
all pairs together (Holm).  Five seeds a configuration are the least with which six pairs can pass.
What it cannot see: it is about other seeds with the same test data, not about other test data.
"""

from __future__ import annotations

import hashlib
import json
import math
import multiprocessing
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass, field
from itertools import combinations
from pathlib import Path
from typing import Any, Protocol

import click
import cv2
import numpy as np
from networks import damage_told, torch_module
from writing import load_pyplot, one_line_errors, output_option, save_figure, table

from adv2e.errors import DataError
from experiments.clip import Simulator
from experiments.simulators import named, sets_option, sources_option

CHECKPOINT, BEST, CURVE = "checkpoint.pt", "best.pt", "curve.json"

Update = Callable[[Any, Any, np.random.Generator], float]
"""Takes the network, the optimiser and chance; makes one step and returns its loss."""


@dataclass
class Curve:
    """What a training went through.

    Attributes
    ----------
    losses : list of float
        One a step.
    checks : list of mapping
        What was measured in between, and ``step``, after how many.
    seconds : float
        How long the steps took, over all runs.
    """

    losses: list[float] = field(default_factory=list)
    checks: list[dict[str, float]] = field(default_factory=list)
    seconds: float = 0.0

    def best(self, name: str) -> dict[str, float]:
        """Return the check in which a measure was largest, the first of equals."""
        return max(self.checks, key=lambda one: one[name])

    def summary(self) -> dict[str, float]:
        """Return the loss of the last 50 steps, and how long one took."""
        return {
            "loss": float(np.mean(self.losses[-50:])),
            "seconds a step": self.seconds / len(self.losses),
        }


@dataclass(frozen=True)
class Training:
    """What is trained, and how.

    Attributes
    ----------
    build : callable
        Returns the network, by PyTorch's chance.
    update : Update
    settings : mapping
        All that decides the numbers besides the number of steps, for JSON.  ``seed`` and ``rate``
        (of Adam) are needed.
    every : int
        Steps between checkpoints.
    check : callable, optional
        Measures the network at each of them, and at the end.
    best_by : str, optional
        The measure to go by: the larger the better.
    device : str
        ``cpu`` or ``cuda``.
    slowing : callable, optional
        Returns the share of the rate that a step has, from its number.
    """

    build: Callable[[], Any]
    update: Update
    settings: Mapping[str, Any]
    every: int = 100
    check: Callable[[Any], dict[str, float]] | None = None
    best_by: str | None = None
    device: str = "cpu"
    slowing: Callable[[int], float] | None = None

    def run(self, folder: Path, steps: int) -> tuple[Any, Curve]:
        """Train up to a number of steps, from where the folder is; return network and curve.

        Raises
        ------
        DataError
            The folder holds a training with other settings or of more steps, or the loss is not
            finite any more.
        MissingExtraError
            PyTorch or Matplotlib is not installed.
        """
        torch = torch_module()
        load_pyplot()  # rather now than after the first steps
        folder.mkdir(parents=True, exist_ok=True)
        torch.manual_seed(self.settings["seed"])
        net = self.build().to(self.device)
        optimiser = torch.optim.Adam(net.parameters(), lr=self.settings["rate"])
        rng = np.random.default_rng(self.settings["seed"])
        curve = self._resume(folder / CHECKPOINT, net, optimiser, rng)
        if len(curve.losses) > steps:
            raise DataError(
                f"{folder / CHECKPOINT}: holds {len(curve.losses)} steps, more than {steps};"
                " take another folder"
            )
        while len(curve.losses) < steps:
            net.train()
            if self.slowing is not None:
                share = self.slowing(len(curve.losses))
                optimiser.param_groups[0]["lr"] = self.settings["rate"] * share
            start = time.perf_counter()
            loss = self.update(net, optimiser, rng)
            curve.seconds += time.perf_counter() - start
            curve.losses.append(loss)
            done = len(curve.losses)
            if not math.isfinite(loss):
                raise DataError(f"{folder}: the loss of step {done} is {loss}: lower the rate")
            if done % self.every == 0 or done == steps:
                self._pause(folder, net, optimiser, rng, curve)
        return net.eval(), curve

    def _pause(
        self, folder: Path, net: Any, optimiser: Any, rng: np.random.Generator, curve: Curve
    ) -> None:
        """Measure, and write what a later run goes on from."""
        torch = torch_module()
        done = len(curve.losses)
        if self.check is not None:
            net.eval()
            with torch.no_grad():
                curve.checks.append({"step": done, **self.check(net)})
            if self.best_by is not None and curve.best(self.best_by) is curve.checks[-1]:
                written(folder / BEST, lambda path: torch.save(net.state_dict(), path))
        state = {
            "net": net.state_dict(),
            "optimiser": optimiser.state_dict(),
            "torch": torch.get_rng_state(),
            "cuda": torch.cuda.get_rng_state_all() if self.device != "cpu" else [],
            "rest": json.dumps(
                {
                    "settings": dict(self.settings),
                    "numpy": rng.bit_generator.state,
                    "curve": vars(curve),
                }
            ),
        }
        written(folder / CHECKPOINT, lambda path: torch.save(state, path))
        raw = json.dumps({"settings": dict(self.settings), **vars(curve)}, indent=1)
        written(folder / CURVE, lambda path: path.write_text(raw + "\n", "utf-8"))
        written(folder / "curve.png", lambda path: draw(curve, path))
        last = float(np.mean(curve.losses[-self.every :]))
        measured = "".join(
            f", {name} {value:.3f}"
            for name, value in (curve.checks[-1] if curve.checks else {}).items()
            if name != "step"
        )
        click.echo(
            f"{folder.name}: step {done}, loss {last:.4f}{measured},"
            f" {curve.seconds / done:.2f} s a step",
            err=True,
        )

    def _resume(self, path: Path, net: Any, optimiser: Any, rng: np.random.Generator) -> Curve:
        """Return the curve so far, having brought all to where it ended."""
        torch = torch_module()
        if not path.exists():
            return Curve()
        state, rest = checkpoint(path)
        settings = json.loads(json.dumps(dict(self.settings)))
        for name in sorted({*settings, *rest["settings"]}):
            old, new = rest["settings"].get(name), settings.get(name)
            if old != new:
                raise DataError(f"{path}: {name}: was {old!r}, now {new!r}; take another folder")
        net.load_state_dict(state["net"])
        optimiser.load_state_dict(state["optimiser"])
        torch.set_rng_state(state["torch"])
        if self.device != "cpu":
            torch.cuda.set_rng_state_all(state["cuda"])
        rng.bit_generator.state = rest["numpy"]
        return Curve(**rest["curve"])


def checkpoint(path: Path) -> tuple[Any, dict[str, Any]]:
    """Return the states that a checkpoint holds, and what else: settings, chance, curve.

    Raises
    ------
    DataError
        It is none.
    """
    with damage_told(f"{path}: no checkpoint of a training"):
        state = torch_module().load(path, map_location="cpu", weights_only=True)
        return state, json.loads(state["rest"])


def written(path: Path, write: Callable[[Path], object]) -> None:
    """Write a file under another name, then give it its own."""
    temporary = path.with_name(f"unfinished-{path.name}")
    write(temporary)
    temporary.replace(path)


def draw(curve: Curve, path: Path) -> None:
    """Draw losses, means over 50 parts at most, and what was measured."""
    pyplot = load_pyplot()
    names = [name for name in (curve.checks[-1] if curve.checks else {}) if name != "step"]
    figure, axes = pyplot.subplots(1 + bool(names), sharex=True, squeeze=False)
    parts = np.array_split(np.arange(len(curve.losses)), min(len(curve.losses), 50))
    losses = np.array(curve.losses)
    axes[0, 0].plot([1 + part.mean() for part in parts], [losses[part].mean() for part in parts])
    axes[0, 0].set_ylabel("loss")
    for name in names:
        axes[-1, 0].plot(
            [one["step"] for one in curve.checks], [one[name] for one in curve.checks], label=name
        )
    if names:
        axes[-1, 0].legend()
    axes[-1, 0].set_xlabel("step")
    save_figure(figure, path)


def number_of_parameters(net: Any) -> int:
    """Return how many numbers are trained."""
    return sum(one.numel() for one in net.parameters() if one.requires_grad)


MEASURED, REFERENCES = "measures.json", "references.json"
References = dict[str, dict[str, float]]
"""Measures, by name of what is measured and of the measure."""


class Job(Protocol):
    """One training with its test."""

    @property
    def settings(self) -> dict[str, Any]:
        """All that decides its numbers, with ``simulator`` and ``seed``."""

    def run(self, folder: Path) -> dict[str, Any]:
        """Train in a folder, and test; return ``measures`` by name, and what else is to be kept."""


def done(job: Job, folder: Path) -> dict[str, Any]:
    """Return what came of a training, which is read where it was kept; on one thread."""
    path = folder / MEASURED
    if path.exists():
        held = json.loads(path.read_text("utf-8"))
        if held["settings"] == job.settings:
            return held
    torch_module().set_num_threads(1)
    cv2.setNumThreads(1)
    held = {"settings": job.settings, **job.run(folder)}
    raw = json.dumps(held, indent=1) + "\n"
    written(path, lambda place: place.write_text(raw, "utf-8"))
    return held


def identity(simulator: Simulator) -> dict[str, str]:
    """Return what a training keeps of its simulator: name, nature, and a digest of all it is."""
    digest = hashlib.sha256(repr(simulator).encode()).hexdigest()[:16]
    return {"simulator": simulator.name, "nature": simulator.nature, "digest": digest}


def all_done(jobs: Sequence[Job], output: Path, processes: int) -> None:
    """Train and test all, so many at a time, each in a process and in a folder of its own."""
    torch_module()  # what is missing is told at once, and by this process
    load_pyplot()
    settings = [job.settings for job in jobs]
    folders = [output / f"{one['simulator']}-seed{one['seed']}" for one in settings]
    if processes == 1:
        for number, (job, folder) in enumerate(zip(jobs, folders, strict=True), 1):
            done(job, folder)
            click.echo(f"{folder.name} done, {number} of {len(jobs)}", err=True)
        return
    # forked processes would share the locks of PyTorch's threads
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(processes, mp_context=context) as pool:
        coming = {
            pool.submit(done, job, folder): folder.name
            for job, folder in zip(jobs, folders, strict=True)
        }
        try:
            for number, one in enumerate(as_completed(coming), 1):
                one.result()
                click.echo(f"{coming[one]} done, {number} of {len(jobs)}", err=True)
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise


def all_measured(folder: Path) -> list[dict[str, Any]]:
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


def keep_references(folder: Path, found: References) -> None:
    """Write measures that stand beside those of the trainings in a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    raw = json.dumps(found, indent=1) + "\n"
    written(folder / REFERENCES, lambda path: path.write_text(raw, "utf-8"))


def kept_references(folder: Path) -> References:
    """Return the measures that were written there; none where they were not."""
    path = folder / REFERENCES
    return json.loads(path.read_text("utf-8")) if path.exists() else {}


LEVEL = 0.05
Values = Mapping[str, Sequence[float]]
"""One value a seed, by configuration."""


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


def report(
    found: Sequence[Mapping[str, Any]],
    measures: Mapping[str, bool],
    beside: Mapping[str, Mapping[str, float]],
) -> str:
    """Return the table of all measures and what their spread carries, in Markdown.

    `measures` tells of each whether larger is better; those that were not taken are left out.
    `beside` holds measures of what was not trained, which get a table of their own.
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
    lines = [table(head, rows), "", about_level, "", *said, "", *about]
    if beside:
        names = list(next(iter(beside.values())))
        cells = [[label, *(f"{each[k]:.4f}" for k in names)] for label, each in beside.items()]
        lines += ["", table(["beside", *names], cells)]
    return "\n".join(lines)


SMALL = "ideal,adv2e,v2e,vid2e"
"""Simulators of the small trainings."""
report_option = click.option(
    "-o", "--report", "to", type=click.Path(dir_okay=False, path_type=Path), metavar="FILE.md",
    help="Write the report here too; numbers beside it.",
)  # fmt: skip


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


def counted(name: str, default: int, text: str | None = None, least: int = 1) -> Any:
    """Return an option that is a number of things."""
    return click.option(
        name, type=click.IntRange(min=least), default=default, show_default=True, help=text
    )


def rate_option(default: float, text: str = "Of Adam.") -> Any:
    """Return the option for the rate of learning."""
    return click.option(
        "--rate", type=click.FloatRange(min=0, min_open=True), default=default, show_default=True,
        help=text,
    )  # fmt: skip


def report_command(tell: Callable[[Path, Path | None], None]) -> click.Command:
    """Return the command that tells again, by `tell`, what came of the trainings in a folder."""

    @click.command()
    @click.argument(
        "folder", type=click.Path(exists=True, file_okay=False, path_type=Path), metavar="FOLDER"
    )
    @output_option
    @one_line_errors()
    def report(folder: Path, output: Path | None) -> None:
        """Tell what came of the trainings of small in FOLDER, seed by seed, and what it carries."""
        tell(folder, output)

    return report
