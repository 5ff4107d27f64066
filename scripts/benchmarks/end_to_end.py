"""From a video file to an event file, and what its parts cost by themselves."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from adv2e.background import default_threads
from benchmarks.clips import as_srgb, encoded, stored
from benchmarks.processes import Job, Log, Measured, number, run_rounds
from benchmarks.report import peak_text, table
from benchmarks.settings import CAMERAS, CUTOFF_HZ, IDEAL, THRESHOLD, Peers, Plan

ABOUT = (
    "346x260, 240 frames a second, light coded as sRGB, MP4 (mp4v). Whole processes, from start to"
    " end, so with imports and compiled code loaded from its cache: median (least..most). The parts"
    " below are measured each by itself, inside a process, after warming up."
)
QUIET = tuple(one for one in IDEAL if not one.startswith("sampling."))
WHOLE, PART = "whole: ", "part: "

_CASES = {
    "adv2e to HDF5, noise off, L = 1": (".h5", (*QUIET, "sampling.L=1")),
    "adv2e to text, noise off, L = 1": (".txt", (*QUIET, "sampling.L=1")),
    "adv2e to HDF5, as shipped, L = 1": (".h5", ("sampling.L=1",)),
    "adv2e to text, as shipped, L = 1": (".txt", ("sampling.L=1",)),
    "adv2e to HDF5, as shipped (L = 10)": (".h5", ()),
}
_DECIDING = {
    "the start": "start: nothing but the imports",
    "decoding": "decoding, to linear light",
    "the pixel": "pixel, noise off, L = 1",
    "writing": "writing HDF5, noise off",
}
"""Parts that make up a conversion to HDF5, noise off, L = 1."""

_MODULE = "benchmarks.conversion"


def end_to_end(
    plan: Plan, peers: Peers, scratch: Path, notes: list[str], log: Log
) -> list[Measured]:
    """Measure whole conversions, and their parts; what could not be measured is added to `notes`.

    Outputs go to the folder `scratch`.
    """
    camera = CAMERAS["346x260"]
    # what both tools take video for: the same light then as of the frames in memory
    clip = as_srgb(stored(replace(camera, frames=97) if plan.quick else camera, plan.folder))
    video = str(encoded(clip, camera.fps))
    jobs = list(_conversions(plan, video, scratch))
    warm = [*plan.warm(), *jobs]
    jobs += _peer_conversions(plan, peers, video, scratch, notes)
    jobs += _parts(plan, video, scratch)
    return run_rounds(jobs, plan.rounds, log, warm=warm)


def _conversions(plan: Plan, video: str, scratch: Path) -> list[Job]:
    jobs = []
    for number_, (name, (suffix, sets)) in enumerate(_CASES.items()):
        target = str(scratch / f"out{number_}{suffix}")
        command = [sys.executable, "-m", "adv2e", "convert", video, "-o", target]
        command += ["--overwrite", "-q"]
        for one in sets:
            command += ["--set", one]
        command += ["--threads", str(plan.threads)] if plan.threads else []
        jobs.append(_whole(name, command, target, plan.threads))
    return jobs


def _whole(name: str, command: Sequence[str], target: str, threads: int | None) -> Job:
    options = {"command": list(command), "target": target}
    action = f"{_MODULE}:run_command"
    return Job(name=WHOLE + name, options=options, action=action, threads=threads)


def _peer_conversions(
    plan: Plan, peers: Peers, video: str, scratch: Path, notes: list[str]
) -> list[Job]:
    """Return the conversions by EventCV, if it is there."""
    if "eventcv" not in peers.tools:
        return []
    if not (shutil.which("ffmpeg") and shutil.which("ffprobe")):
        notes.append("EventCV reads files through ffmpeg and ffprobe, which are not on PATH.")
        return []
    jobs = []
    for steps in ("off", "10", "adaptive"):
        target = str(scratch / f"eventcv_{steps}.h5")
        command = [
            peers.python, "-m", "eventcv", "simulate", video, target, "--quiet",
            "--threshold", str(THRESHOLD), "--cutoff-hz", str(CUTOFF_HZ), "--sigma-thres", "0",
            "--leak-rate-hz", "0", "--shot-noise-rate-hz", "0", "--refractory-us", "0",
            "--upsample", steps,
        ]  # fmt: skip
        name = f"EventCV to HDF5, sub-steps {steps}, noise off"
        jobs.append(_whole(name, command, target, plan.threads))
    return jobs


def _parts(plan: Plan, video: str, scratch: Path) -> list[Job]:
    given: dict[str, Any] = {
        "video": video,
        "sets": [*QUIET, "sampling.L=1"],
        "threads": plan.threads,
        "scratch": str(scratch),
    }
    parts: dict[str, tuple[str, dict[str, Any]]] = {
        "start: nothing but the imports": ("start", {}),
        "decoding, to linear light": ("decode", {}),
        "pixel, noise off, L = 1": ("pixel", {}),
        "pixel, as shipped, L = 1": ("pixel", {"sets": ["sampling.L=1"]}),
        "pixel, as shipped (L = 10)": ("pixel", {"sets": []}),
        "writing HDF5, noise off": ("write", {"suffix": ".h5"}),
        "writing text, noise off": ("write", {"suffix": ".txt"}),
    }
    return [
        Job(
            name=PART + name,
            options={**given, **more},
            action=f"{_MODULE}:{action}",
            threads=plan.threads,
        )
        for name, (action, more) in parts.items()
    ]


def end_to_end_report(found: Sequence[Measured]) -> str:
    """Return the tables of whole conversions and parts, and which part decides."""
    whole = [one for one in found if one.job.name.startswith(WHOLE)]
    parts = [one for one in found if one.job.name.startswith(PART)]
    header = ("conversion", "wall s", "CPU s", "time", "MB", "peak MiB")
    rows = [
        [
            one.job.name.removeprefix(WHOLE),
            str(one.wall_s()),
            number(one.cpu_s().median),
            str(one.ratio(whole[0])),
            number(one.last["bytes"] / 1e6),
            peak_text(one),
        ]
        for one in whole
    ]
    part_rows = [
        [one.job.name.removeprefix(PART), str(one.wall_s()), number(one.cpu_s().median)]
        for one in parts
    ]
    return "\n\n".join(
        [ABOUT, table(header, rows), table(("part", "wall s", "CPU s"), part_rows), decides(parts)]
    )


def decides(parts: Sequence[Measured]) -> str:
    """Return a sentence on which of decoding, pixel and writing takes longest, noise off, HDF5.

    Decoding runs in one thread; pixel and compression share the cores.
    """
    named = {one.job.name.removeprefix(PART): one.wall_s().median for one in parts}
    if any(name not in named for name in _DECIDING.values()):
        return "Which part decides is not known: some could not be measured."
    chosen = {part: named[name] for part, name in _DECIDING.items() if part != "the start"}
    slowest = max(chosen, key=lambda name: chosen[name])
    shares = ", ".join(f"{name} {number(value)} s" for name, value in chosen.items())
    return (
        f"To HDF5, noise off, L = 1, on {default_threads()} cores: {shares}; {slowest} decides."
        f" Overlapped without loss they would take {number(chosen[slowest])} s, one after the other"
        f" {number(sum(chosen.values()))} s, beside"
        f" {number(named[_DECIDING['the start']])} s to start."
    )
