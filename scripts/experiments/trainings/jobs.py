"""Trainings of several configurations and seeds: each is done once, several at a time."""

from __future__ import annotations

import hashlib
import json
import multiprocessing
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path
from typing import Any, Protocol

import click
import cv2
from networks import torch_module
from writing import load_pyplot

from adv2e.errors import DataError
from experiments.simulators.clip import Simulator
from experiments.trainings.training import written

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
