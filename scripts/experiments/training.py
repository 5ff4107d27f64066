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
"""

from __future__ import annotations

import hashlib
import json
import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import click
import numpy as np
from networks import damage_told, torch_module
from writing import load_pyplot, save_figure

from adv2e.errors import DataError
from experiments.clip import Simulator
from experiments.simulators import named, sets_option, sources_option

CHECKPOINT, BEST, CURVE = "checkpoint.pt", "best.pt", "curve.json"

Update = Callable[[Any, Any, np.random.Generator], float]
"""Takes the network, the optimiser and chance; makes one step and returns its loss."""


@dataclass
class Curve:
    """Course of a training: the loss of each step, and checks in between.

    ``step`` of a check is after how many; `seconds` is how long the steps took, over all runs.
    """

    losses: list[float] = field(default_factory=list)
    checks: list[dict[str, float]] = field(default_factory=list)
    seconds: float = 0.0

    def best(self, name: str) -> dict[str, float]:
        """Return the check in which a measure was largest, the first of equals."""
        return max(self.checks, key=lambda one: one[name])


@dataclass(frozen=True)
class Training:
    """A training: network, step, and settings.

    `build` returns the network, by PyTorch's chance.  `settings` are all that decides the numbers
    besides the number of steps, for JSON; ``seed`` and ``rate`` (of Adam) are needed.  After
    `every` steps comes a checkpoint, where `check` measures the network; of the measure `best_by`
    larger is better.  `slowing` returns the share of the rate that a step has, from its number.
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
        """Train up to a number of steps, from where the folder is; return network and curve."""
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
    """Return the states that a checkpoint holds, and what else: settings, chance, curve."""
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


def identity(simulator: Simulator) -> dict[str, str]:
    """Return what a training keeps of its simulator: name, nature, and a digest of all it is."""
    digest = hashlib.sha256(repr(simulator).encode()).hexdigest()[:16]
    return {"simulator": simulator.name, "nature": simulator.nature, "digest": digest}


def one_anew(names: str, sets: Sequence[str], v2e_sources: Path | None) -> Simulator:
    """Return the one simulator of that name, on one thread.

    Raises
    ------
    UsageError
        There are several.
    """
    chosen = named(names.split(","), sets=sets, v2e_sources=v2e_sources, threads=1)
    if len(chosen) != 1:
        raise click.UsageError(f"--simulators {names}: must be one")
    return chosen[0]


def simulators_option(default: str) -> Any:
    """Return the options that choose the simulator which makes events of new clips."""

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
