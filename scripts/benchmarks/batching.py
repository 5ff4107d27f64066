"""What the processes of the benchmark of batches run."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

from benchmarks.conversion import run_command
from benchmarks.measuring import measured


def pixel(spec: dict[str, Any]) -> dict[str, Any]:
    """Time the pixel alone: frames of all clips in memory to events, one clip after the other."""
    from adv2e import load_config, simulate  # noqa: PLC0415 - in the process that is measured
    from adv2e.sources import open_source  # noqa: PLC0415

    options = spec["options"]
    config = load_config([], [*options["sets"], "frames.encoding=srgb"])
    clips = []
    for path in options["clips"]:
        frames = list(open_source(path).frames())
        clips.append(([one.image for one in frames], [one.t_ns * 1e-9 for one in frames]))

    def run(some: list[Any]) -> int:
        return sum(
            len(events)
            for images, times in some
            for events in simulate(images, times, config, threads=options["threads"])
        )

    run(clips[:1])
    count, cost = measured(lambda: run(clips))
    return {**cost.as_dict(), "events": count}


def shell(spec: dict[str, Any]) -> dict[str, Any]:
    """Run a shell script that writes to the folder `target`, empty before; as `run_command`."""
    target = Path(spec["options"]["target"])
    shutil.rmtree(target, ignore_errors=True)
    target.mkdir()
    command = ["sh", "-e", "-c", spec["options"]["script"]]
    return run_command({"options": {"command": command, "target": str(target)}})
