"""What the memory benchmark runs, what it sees of a running conversion, and its second clip."""

from __future__ import annotations

import io
import math
import os
import re
import subprocess
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import redirect_stdout
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.measuring import measured, peak_mib

MIDDLE = 60.0
"""Grey value that the flicker swings around."""

FLIPPED = 0.1
"""Share of the pixels that flicker against the rest, drawn anew for each frame."""


@dataclass(frozen=True, kw_only=True)
class Burst:
    """Recipe of a clip in which the whole field flickers, with noise.

    Attributes
    ----------
    width, height, frames : int
    fps : float
        Frames a second; one bright, one dark in turn.
    swing : float
        Between dark and bright [ln units].
    seed : int
        Of the noise.
    """

    width: int
    height: int
    frames: int
    fps: float
    swing: float
    seed: int = 20260

    @property
    def name(self) -> str:
        """A file name that tells every recipe from every other."""
        size = f"{self.width}x{self.height}x{self.frames}"
        return f"burst_{size}_{self.fps:g}fps_swing{self.swing:g}_seed{self.seed}"

    def render(self) -> Iterator[NDArray[np.uint8]]:
        """Yield the frames, uint8 (rows, columns)."""
        rng = np.random.default_rng(self.seed)
        levels = MIDDLE * np.exp(0.5 * self.swing * np.array([-1.0, 1.0]))
        dark, bright = np.clip(np.rint(levels), 0, 255).astype(np.uint8)
        for k in range(self.frames):
            flipped = rng.random((self.height, self.width), np.float32) < FLIPPED
            yield np.where(flipped ^ (k % 2 == 1), bright, dark)


def stored_burst(burst: Burst, folder: Path) -> Path:
    """Return the ``.npy`` file of the clip, (frames, rows, columns); make it if need be."""
    path = folder / f"{burst.name}.npy"
    if not path.exists():
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile(dir=folder, suffix=".part", delete=False) as part:
            np.save(part, np.stack(list(burst.render())))
        Path(part.name).replace(path)  # whole, or not there
    return path


def convert(spec: dict[str, Any]) -> dict[str, Any]:
    """Run ``adv2e convert`` in this process; return its cost, peak memory and events.

    Raises
    ------
    RuntimeError
        It failed; it has said why on standard error.
    """
    from adv2e.cli import main  # noqa: PLC0415 - in the process that is measured

    printed = io.StringIO()

    def run() -> Any:
        try:
            with redirect_stdout(printed):
                main(spec["options"]["arguments"])
        except SystemExit as end:
            return end.code
        return 0

    status, cost = measured(run)
    if status:
        raise RuntimeError(f"exit status {status}")
    return {**cost.as_dict(), "peak_mib": peak_mib(), "events": count_in(printed.getvalue())}


def count_in(summary: str) -> int:
    """Return the number of events that the summary of a conversion tells.

    Raises
    ------
    RuntimeError
        It tells none.
    """
    found = re.search(r": ([\d,]+) events ", summary)
    if found is None:
        raise RuntimeError(f"no number of events in {summary!r}")
    return int(found[1].replace(",", ""))


@dataclass(frozen=True)
class Moment:
    """A look at a running conversion.

    Attributes
    ----------
    seconds : float
        Time since its start.
    frames : int
        Frames taken.
    rss_mib : float
        Memory.
    cpu_s : float
        Processor time of all its threads.
    """

    seconds: float
    frames: int
    rss_mib: float
    cpu_s: float = math.nan


def watched(command: Sequence[str]) -> tuple[list[Moment], str]:
    """Run a conversion that shows its progress; return what was seen of it, and what it printed.

    Linux only: memory is read from /proc.

    Raises
    ------
    RuntimeError
        It failed; the message is the last line that it wrote.
    """
    began = time.perf_counter()
    moments: list[Moment] = []
    told = ""
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        while text := process.stderr.read1(4096).decode(errors="replace"):
            told = (told + text)[-4096:]
            taken = frames_taken(told)
            if taken is not None and not (moments and moments[-1].frames == taken):
                seconds = time.perf_counter() - began
                moments.append(Moment(seconds, taken, *_look(process.pid)))
        printed = process.stdout.read().decode()
    if process.returncode:
        lines = told.strip().splitlines() or [f"exit status {process.returncode}"]
        raise RuntimeError(lines[-1])
    return moments, printed


def frames_taken(progress: str) -> int | None:
    """Return the number of frames that a progress bar told last, ``12/34 [``; None: none yet."""
    found = re.findall(r"(\d+)/\d+ \[", progress)
    return int(found[-1]) if found else None


def _look(pid: int) -> tuple[float, float]:
    """Return memory [MiB] and processor time [s] of a process; NaN when it has just ended."""
    status = Path(f"/proc/{pid}/status").read_text()
    # behind the name, which may hold anything: state, ten others, time as user and as system
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    found = re.search(r"VmRSS:\s+(\d+)", status)
    if found is None:
        return math.nan, math.nan
    ticks = int(fields[11]) + int(fields[12])
    return int(found[1]) / 1024, ticks / os.sysconf("SC_CLK_TCK")
