"""Accuracy against cost: each tool and number of sub-steps a point."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from benchmarks.accuracy import TimeError, Truth, chosen_pixels, time_error
from benchmarks.clips import Clip, as_srgb, stored
from benchmarks.processes import Job, Log, Measured, run_rounds
from benchmarks.settings import CAMERAS, Peers, Plan, peer_arguments, stepped

FORMS = ("first_order_hold", "zero_order_hold", "euler", "paper")
STEPS = (1, 2, 5, 10, 20, 50, 100)
QUICK_STEPS = (1, 10, 100)
PEER_STEPS = ("off", "2", "5", "10", "20", "50", "100", "adaptive")
QUICK_PEER_STEPS = ("off", "10", "adaptive")


@dataclass(frozen=True)
class Point:
    """A tool with a number of sub-steps.

    Attributes
    ----------
    curve : str
        What it belongs to.
    steps : str
        Sub-steps a frame; empty where there are none to choose.
    measured : Measured
    error : TimeError
    """

    curve: str
    steps: str
    measured: Measured
    error: TimeError

    @property
    def cpu_ns(self) -> float:
        """Processor time a pixel and frame [ns], median of the rounds."""
        last = self.measured.last
        return 1e9 * self.measured.cpu_s().median / float(last["pixels"] * last["frames"])

    def as_dict(self) -> dict[str, Any]:
        """Return everything, for JSON."""
        error = {k: None if math.isnan(v) else v for k, v in asdict(self.error).items()}
        return {"curve": self.curve, "steps": self.steps, "cpu_ns": self.cpu_ns, "error": error}


def frontier(plan: Plan, peers: Peers, scratch: Path, log: Log) -> list[Point]:
    """Measure all points on the same frames, noise off.

    The events of the pixels that are compared go to the folder `scratch`.
    """
    count = 13 if plan.quick else 49
    camera = replace(CAMERAS["346x260"], frames=count)
    clip = stored(camera, plan.folder)
    pixels = chosen_pixels(camera.width * camera.height, 150 if plan.quick else 600)
    named = {}
    every = [*_own_jobs(plan, camera), *_peer_jobs(plan, peers, clip)]
    for number, (curve, steps, job) in enumerate(every):
        probe = {"pixels": list(pixels), "path": str(scratch / f"probe{number}.npz")}
        named[job.name] = (curve, steps, replace(job, probe=probe, threads=plan.threads))
    jobs = [job for _, _, job in named.values()]
    truth = Truth(str(clip), count, camera.fps, pixels)
    points = []
    # its costs lie on a logarithmic axis: two rounds are enough
    for measured in run_rounds(jobs, min(plan.rounds, 2), log, warm=plan.warm()):
        curve, steps, job = named[measured.job.name]
        assert job.probe is not None
        error = time_error(Path(job.probe["path"]), truth.of(job.tool))
        points.append(Point(curve, steps, measured, error))
    return points


def _own_jobs(plan: Plan, camera: Clip) -> Iterator[tuple[str, str, Job]]:
    """Yield (curve, sub-steps, job)."""
    yield "exact", "", plan.job("exact", camera, ())
    for form in FORMS:
        for K in QUICK_STEPS if plan.quick else STEPS:
            yield form, str(K), plan.job(f"{form} {K}", camera, stepped(form, K))


def _peer_jobs(plan: Plan, peers: Peers, clip: Path) -> Iterator[tuple[str, str, Job]]:
    for name, tool, options in peer_arguments(peers, plan.threads):
        job = Job(name=name, tool=tool, python=peers.python, clip=str(clip), options=options)
        if "all effects" in name:
            continue
        if tool != "eventcv":
            yield name.partition(",")[0], "", job
        elif options["arguments"]["upsample"] == "off":  # once for all numbers of sub-steps
            for steps in QUICK_PEER_STEPS if plan.quick else PEER_STEPS:
                given = {**options["arguments"], "upsample": steps, "max_upsample": 128}
                yield (
                    "EventCV",
                    steps.replace("off", "1"),
                    replace(
                        job,
                        name=f"EventCV {steps}",
                        clip=str(as_srgb(clip)),
                        options={"arguments": given},
                    ),
                )
