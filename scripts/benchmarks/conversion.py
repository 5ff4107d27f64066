"""What the processes of the file-to-file benchmark run: whole conversions, and their parts.

Each function takes a job as a dict and returns what :class:`benchmarks.processes.Round` reports.
"""

from __future__ import annotations

import itertools
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

from adv2e.files.states import state_of
from benchmarks.measuring import children_cpu_s, children_peak_mib, measured, peak_mib

_NO_BYTECODE = "PYTHONDONTWRITEBYTECODE"


def _as_users() -> dict[str, str]:
    """Return the environment, but that Python keeps what it made of sources, as it usually does."""
    return {name: value for name, value in os.environ.items() if name != _NO_BYTECODE}


def run_command(spec: dict[str, Any]) -> dict[str, Any]:
    """Run a command line; return its cost and the size of the file or folder that it wrote.

    Raises
    ------
    RuntimeError
        It failed.
    """
    command, target = spec["options"]["command"], Path(spec["options"]["target"])
    before = children_cpu_s()
    done, cost = measured(
        lambda: subprocess.run(
            command, env=_as_users(), capture_output=True, text=True, check=False
        )
    )
    if done.returncode:
        raise RuntimeError((done.stderr.strip().splitlines() or ["it failed without a word"])[-1])
    return {
        "wall_s": cost.wall_s,
        "cpu_s": children_cpu_s() - before,
        "peak_mib": children_peak_mib(),
        "bytes": state_of(target).bytes,
    }


def start(spec: dict[str, Any]) -> dict[str, Any]:
    """Time a process that imports all that a conversion needs, and ends."""
    modules = "cli.convert conversion.pipeline formats.monash.writer sources.video.source"
    imports = "; ".join(f"import adv2e.{name}" for name in modules.split())
    command = [sys.executable, "-c", imports]
    before = children_cpu_s()
    _, cost = measured(lambda: subprocess.run(command, env=_as_users(), check=True))
    return {"wall_s": cost.wall_s, "cpu_s": children_cpu_s() - before}


def _light(options: dict[str, Any], most: int | None = None) -> list[Any]:
    """Return (t_ns, light) of all frames of the video, or of so many."""
    from adv2e.effects.frames.encoding import LightDecoder  # noqa: PLC0415 - in the process
    from adv2e.sources import open_source  # noqa: PLC0415

    source = open_source(options["video"])
    decoder = LightDecoder(source.encoding, source.full_scale, source.dtype, source.colour)
    frames = itertools.islice(source.frames(), most)
    return [(frame.t_ns, decoder.decode(frame.image)) for frame in frames]


def decode(spec: dict[str, Any]) -> dict[str, Any]:
    """Time reading the video and turning it into light, nothing kept but the light."""
    _light(spec["options"], 2)  # imports
    light, cost = measured(lambda: _light(spec["options"]))
    return {**cost.as_dict(), "frames": len(light), "pixels": light[0][1].size}


def _events(options: dict[str, Any], light: list[Any]) -> list[Any]:
    from adv2e import load_config  # noqa: PLC0415
    from adv2e.conversion.simulation import events_from_light  # noqa: PLC0415

    config = load_config([], options["sets"])
    return list(events_from_light(light, config, threads=options["threads"]))


def pixel(spec: dict[str, Any]) -> dict[str, Any]:
    """Time light in memory to events in memory."""
    light = _light(spec["options"])
    _events(spec["options"], light[:4])
    events, cost = measured(lambda: _events(spec["options"], light))
    count = sum(len(part) for part in events)
    return {**cost.as_dict(), "events": count, "peak_mib": peak_mib()}


def write(spec: dict[str, Any]) -> dict[str, Any]:
    """Time writing events in memory to a file."""
    from adv2e.formats.writing import open_sink  # noqa: PLC0415

    options = spec["options"]
    light = _light(options)
    events = _events(options, light)
    height, width = light[0][1].shape
    target = Path(options["scratch"]) / f"written{options['suffix']}"

    def put(parts: list[Any]) -> None:
        with open_sink(
            target,
            width=width,
            height=height,
            metadata={},
            overwrite=True,
            threads=options["threads"],
        ) as sink:
            for part in parts:
                sink.write_events(part)

    put(events[:1])
    _, cost = measured(lambda: put(events))
    count = sum(len(part) for part in events)
    return {**cost.as_dict(), "events": count, "bytes": target.stat().st_size}
