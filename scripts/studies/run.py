"""Recording and diagnosing one case."""

from __future__ import annotations

import hashlib
import os
import subprocess
import tempfile
import time
import traceback
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from adv2e.config import load_config
from adv2e.diagnosis.data.evidence import Evidence, read_evidence
from adv2e.diagnosis.diagnose import diagnose
from adv2e.diagnosis.known_light import read_known_light
from adv2e.reports.result import Diagnosis
from studies.cases import REPOSITORY, Case, camera, settings, stimulus
from studies.results import Line

STUDIED = ("adv2e", "tests/camera", "scripts/studies/cases.py", "scripts/studies/run.py")
"""Paths that results depend on: their commit is the last that changed any of it."""


@dataclass(frozen=True)
class Setup:
    """How recordings are made: columns and rows [px], length [s], frames a second.

    And how many bits a pixel of a frame has, and what is simulated between two frames; or whether
    there are none, but a lamp of which the light is known.
    """

    width: int = 48
    height: int = 36
    seconds: float = 0.8
    fps: float = 500.0
    bits: int = 16
    interpolation: str = "linear"
    known_light: bool = False

    def camera_for(self, case: Case, study_seed: int) -> Any:
        """Return the camera of a case, with a scene before it."""
        size, seed = (self.width, self.height), case.seed(study_seed)
        scene = (
            stimulus.scene(stimulus.bench(self.seconds, seed)) if self.known_light
            else camera.SCENES[case.scene(study_seed)](size, seed=seed)
        )  # fmt: skip
        declared = {
            "frames": {"full_scale": 2**self.bits - 1},
            # pictures between frames are blended, or moved in eight steps
            "sampling": {
                "interpolation": self.interpolation, "L": 1 if self.interpolation == "linear" else 8
            },
        }  # fmt: skip
        return camera.Camera(
            scene, settings.merged(settings.BENCH, declared), hidden=case.hidden, size=size,
            duration_s=self.seconds, fps=self.fps, seed=seed,
        )  # fmt: skip

    def read(self, path: Path, case: Case, study_seed: int) -> Evidence:
        """Return the recording of a case, which lies at `path`; a table of light comes beside."""
        if not self.known_light:
            return read_evidence(path)
        clock = (
            settings.find(case.hidden, f"frames.clock_{name}", 0.0)
            for name in ("offset_us", "drift_ppm")
        )
        rows = stimulus.bench(self.seconds, case.seed(study_seed))
        table = path.with_suffix(".stimulus.csv")
        stimulus.write_table(table, stimulus.stamped(rows, *clock))
        return read_known_light(path, table)


def commit() -> str:
    """Return the last commit that changed what is studied.

    What was changed since then is told by ``-dirty-`` and a digest of it, so that no other results
    are taken for those of it.
    """
    number = _git("log", "-1", "--format=%h", "--", *STUDIED)
    changed = _git("diff", "--no-ext-diff", "HEAD", "--", *STUDIED)
    added = _git("ls-files", "--others", "--exclude-standard", "--", *STUDIED).splitlines()
    if not changed and not added:
        return number
    digest = hashlib.sha1(changed.encode(), usedforsecurity=False)
    for name in added:
        digest.update(name.encode() + (REPOSITORY / name).read_bytes())
    return f"{number}-dirty-{digest.hexdigest()[:8]}"


def _git(*arguments: str) -> str:
    command = ["git", "-C", str(REPOSITORY), *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()


def diagnosed(
    case: Case, setup: Setup, study_seed: int, threads: int, log: Callable[[str], None]
) -> Line:
    """Record and diagnose a case, and return its line.

    What goes wrong is part of the line, as ``failed``, with where it did.
    """
    line = {
        "key": case.key, "kind": case.kind, "effects": list(case.effects), "size": case.size,
        "repeat": case.repeat, "study_seed": study_seed, "scene": case.scene(study_seed),
        "setup": asdict(setup), "hidden": dict(settings.paths(case.hidden)),
    }  # fmt: skip
    lines: list[str] = []

    def noted(text: str) -> None:
        lines.append(text)
        log(text)

    try:
        with tempfile.TemporaryDirectory(prefix="adv2e-study-") as folder:
            path = Path(folder) / "recording.zip"
            began = time.perf_counter()
            recorder = setup.camera_for(case, study_seed)
            recorder.record(path)
            recorded = time.perf_counter()
            declared = load_config([path.with_name("recording.declared.yaml")])
            found = diagnose(
                setup.read(path, case, study_seed), declared, without=case.without, sizes=False,
                threads=threads, log=noted,
            )  # fmt: skip
        line |= outcome(found)
        fitted = [key for one in found.effects for key in one.parameters]
        line["truth"] = {key: settings.find(recorder.truth, key, None) for key in fitted}
        line["seconds"] = {
            "recording": round(recorded - began, 1),
            "diagnosis": round(time.perf_counter() - recorded, 1),
        }
    except Exception as error:
        frames = traceback.extract_tb(error.__traceback__)
        where = f"{Path(frames[-1].filename).name}:{frames[-1].lineno}"
        line["failed"] = f"{type(error).__name__}: {error} ({where})"
    load = round(os.getloadavg()[0], 1)
    return line | {"ended": round(time.time()), "threads": threads, "load": load, "log": lines}


def outcome(found: Diagnosis) -> Line:
    """Return what is kept of a diagnosis."""
    error = found.errors[0]
    return {
        "verdict": found.verdict,
        "found": [
            {"name": one.name, "parameters": dict(one.parameters), "interval": dict(one.interval)}
            for one in found.effects
        ],
        "alternatives": found.alternatives,
        "rejected": {one.name: one.reason for one in found.rejected},
        "error": {
            "before": error.before.value, "after": error.after.value, "floor": error.floor.value
        },
        "global_p": {"before": found.global_p_before, "after": found.global_p_after},
        "events": int(found.facts["events"].replace(",", "")),
        "simulations": int(found.facts["simulations"].replace(",", "")),
    }  # fmt: skip
