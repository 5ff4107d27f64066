"""Runs one measurement in a process of its own, as its only argument says.

That is JSON: see :class:`benchmarks.measure.Job`.  Prints one line of JSON.  Imports nothing of
adv2e unless the tool is adv2e, so that it runs in the Python of another tool, and so that an older
commit's package can be measured.
"""

from __future__ import annotations

import gc
import hashlib
import importlib
import io
import json
import os
import platform
import re
import shutil
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import redirect_stdout
from importlib import metadata
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import numpy as np

try:
    resource: Any = importlib.import_module("resource")
except ImportError:  # Windows
    resource = None

WARM_UP_FRAMES = 4
"""Frames of the run before the one that counts: compiles, loads, and makes threads."""
PAUSE_S = 0.4
"""So long; the threads that BLAS starts with NumPy wait busily for the first fifth of a second."""

Value = TypeVar("Value")


def measured(work: Callable[[], Value]) -> tuple[Value, dict[str, Any]]:
    """Return what `work` returns, its wall time, and the processor time of all threads [s]."""
    wall, cpu = time.perf_counter(), time.process_time()
    value = work()
    return value, {"wall_s": time.perf_counter() - wall, "cpu_s": time.process_time() - cpu}


def peak_mib() -> float | None:
    """Return the most memory this process has held [MiB]; None: not known."""
    try:
        # not ru_maxrss: Linux lets it begin with what the parent held when it started this process
        status = Path("/proc/self/status").read_text().splitlines()
        return next(int(line.split()[1]) for line in status if line.startswith("VmHWM:")) / 1024
    except (OSError, StopIteration):
        return _as_mib(resource.RUSAGE_SELF) if resource else None


def _as_mib(who: int) -> float:
    peak = resource.getrusage(who).ru_maxrss
    return float(peak) / (1 << 20 if sys.platform == "darwin" else 1 << 10)


def children_cpu_s() -> float:
    """Return the processor time of all child processes that have ended [s]."""
    if resource is None:
        return 0.0
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return float(usage.ru_utime + usage.ru_stime)


# --- frames in memory to events in memory --------------------------------------------------------


class Tool(NamedTuple):
    """A tool, and the packages that it needs.

    `simulator` makes of options and threads a function of (frames, fps), which returns events in
    whatever form the tool gives them; `columns` makes of these int64 times [us], columns, rows and
    polarities (1 or 0).
    """

    simulator: Callable[[dict[str, Any], int | None], Callable[[Any, float], Any]]
    columns: Callable[[Any], tuple[Any, ...]]
    packages: tuple[str, ...]

    def versions(self) -> dict[str, str]:
        """Return what ran."""
        found = {name: metadata.version(name) for name in self.packages}
        return {**found, "Python": platform.python_version()}


def _of_adv2e(options: dict[str, Any], threads: int | None) -> Callable[[Any, float], Any]:
    import adv2e  # noqa: PLC0415 - the package that the job names

    config = adv2e.load_config(options.get("files", []), options["sets"])

    def run(frames: Any, fps: float) -> Any:
        times = np.arange(len(frames)) / fps
        return list(adv2e.simulate(frames, times, config, threads=threads))

    return run


def _adv2e_columns(events: Any) -> tuple[Any, ...]:
    joined = np.concatenate(events)
    return tuple(joined[name] for name in "txyp")


def _of_eventcv(options: dict[str, Any], threads: int | None) -> Callable[[Any, float], Any]:
    """EventCV takes 8-bit frames as sRGB and removes that coding, so its clip is coded so.

    Its corner is 0.1 + 0.9 light of ``cutoff_hz``; between frames its log intensity is linear.
    """
    import eventcv  # noqa: PLC0415 - only where it is used

    return lambda frames, fps: eventcv.simulate(frames, fps=fps, **options["arguments"])


def _eventcv_columns(events: Any) -> tuple[Any, ...]:
    assert events.columns == ("x", "y", "t", "p"), events.columns
    assert events.timestamp_scale_ms == 0.001, "times are not in microseconds"
    x, y, t, p = events.numpy().astype(np.int64).T
    return t, x, y, p


TOOLS = {
    "adv2e": Tool(_of_adv2e, _adv2e_columns, ("numba", "numpy")),
    "eventcv": Tool(_of_eventcv, _eventcv_columns, ("eventcv", "numpy")),
}


def simulate(spec: dict[str, Any]) -> dict[str, Any]:
    """Time frames in memory to sorted events in memory."""
    tool = TOOLS[spec["tool"]]
    frames = np.load(spec["clip"])[: spec["frames"] * spec["stride"] : spec["stride"]]
    frames = np.ascontiguousarray(frames)
    fps = spec["fps"] / spec["stride"]
    run = tool.simulator(spec["options"], spec["threads"])
    run(frames[:WARM_UP_FRAMES], fps)
    gc.collect()  # what the imports left behind would be collected once, during the run
    time.sleep(PAUSE_S)
    events, cost = measured(lambda: run(frames, fps))
    peak = peak_mib()
    columns = tool.columns(events)
    digest = hashlib.sha256()
    for column in columns:
        digest.update(np.ascontiguousarray(column).astype(np.int64).tobytes())
    versions = tool.versions()
    if spec["tool"] == "adv2e":
        adv2e = sys.modules["adv2e"]
        versions |= {"adv2e": adv2e.__version__, "from": str(Path(str(adv2e.__file__)).parent)}
    return {
        **cost, "peak_mib": peak, "events": int(columns[0].size), "pixels": int(frames[0].size),
        "frames": len(frames), "versions": versions, "digest": digest.hexdigest(),
    }  # fmt: skip


def simulate_clips(spec: dict[str, Any]) -> dict[str, Any]:
    """Time the pixel alone: frames of all clips in memory to events, one clip after the other."""
    from adv2e import load_config, simulate  # noqa: PLC0415
    from adv2e.sources import open_source  # noqa: PLC0415

    config = load_config([], [*spec["options"]["sets"], "frames.encoding=srgb"])
    clips = []
    for path in spec["options"]["clips"]:
        frames = list(open_source(path).frames())
        clips.append(([one.image for one in frames], [one.t_ns * 1e-9 for one in frames]))

    def run(some: list[Any]) -> int:
        return sum(
            len(events)
            for images, times in some
            for events in simulate(images, times, config, threads=spec["threads"])
        )

    run(clips[:1])
    count, cost = measured(lambda: run(clips))
    return {**cost, "events": count}


# --- whole conversions ---------------------------------------------------------------------------


def run_command(spec: dict[str, Any]) -> dict[str, Any]:
    """Run a command line; return its cost and the size of the file or folder `target` it wrote."""
    options, before = spec["options"], children_cpu_s()
    # Python keeps what it made of sources, as it usually does for users
    environment = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
    environment |= options.get("environment", {})
    done, cost = measured(
        lambda: subprocess.run(
            options["command"], env=environment, capture_output=True, text=True, check=False
        )
    )
    if done.returncode:
        raise RuntimeError((done.stderr.strip().splitlines() or ["it failed without a word"])[-1])
    target = Path(options["target"])
    files = [target] if target.is_file() else [one for one in target.rglob("*") if one.is_file()]
    return {
        "wall_s": cost["wall_s"],
        "cpu_s": children_cpu_s() - before,
        "peak_mib": _as_mib(resource.RUSAGE_CHILDREN) if resource else None,
        "bytes": sum(one.stat().st_size for one in files),
    }


def shell(spec: dict[str, Any]) -> dict[str, Any]:
    """Run a shell script that writes to the folder `target`, empty before; as `run_command`."""
    target = Path(spec["options"]["target"])
    shutil.rmtree(target, ignore_errors=True)
    target.mkdir()
    command = ["sh", "-e", "-c", spec["options"]["script"]]
    return run_command({"options": {"command": command, "target": str(target)}})


def convert(spec: dict[str, Any]) -> dict[str, Any]:
    """Run ``adv2e convert`` in this process; return its cost, peak memory and events."""
    from adv2e.cli import main  # noqa: PLC0415 - in the process that is measured

    printed = io.StringIO()
    program = importlib.import_module("adv2e.__main__")
    if hasattr(program, "collect_seldom"):  # older ones do so in their command line
        program.collect_seldom()

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
    return {**cost, "peak_mib": peak_mib(), "events": count_in(printed.getvalue())}


def count_in(summary: str) -> int:
    """Return the number of events that the summary of a conversion tells."""
    found = re.search(r": ([\d,]+) events ", summary)
    if found is None:
        raise RuntimeError(f"no number of events in {summary!r}")
    return int(found[1].replace(",", ""))


def file_by_eventcv(video: str, out: str, arguments: str) -> None:
    """Convert a video by EventCV: what its own command does, where there is no ffmpeg for that."""
    import cv2  # noqa: PLC0415
    import eventcv  # noqa: PLC0415

    capture = cv2.VideoCapture(video)
    fps = capture.get(cv2.CAP_PROP_FPS)
    frames = []
    while (read := capture.read())[0]:
        frames.append(cv2.cvtColor(read[1], cv2.COLOR_BGR2GRAY))
    eventcv.simulate(np.stack(frames), fps=fps, out=out, **json.loads(arguments))


def main() -> None:
    """Do what the argument says; with three, convert a file by EventCV."""
    if len(sys.argv) > 2:
        file_by_eventcv(*sys.argv[1:])
        return
    spec = json.loads(sys.argv[1])
    module, _, name = spec["action"].rpartition(":")
    action = getattr(importlib.import_module(module or "benchmarks.worker"), name)
    print(json.dumps(action(spec)))


if __name__ == "__main__":
    main()
