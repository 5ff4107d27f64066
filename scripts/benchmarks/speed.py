#!/usr/bin/env python
"""How fast adv2e is, and EventCV on the same frames.

Makes its own clips, and runs every measurement in a process of its own, in interleaved rounds::

    python scripts/benchmarks/speed.py --quick
    python scripts/benchmarks/speed.py --end-to-end --peer-python other/bin/python -o benchmark.md

Writes Markdown to standard output and with ``-o FILE.md`` also to that file, with the raw numbers
in ``FILE.json``.  ``--peer-python`` names a Python in which ``eventcv`` is installed; where it is
not, it is left out, and said so.
"""

from __future__ import annotations

import fnmatch
import json
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

import click
from writing import output_option, table, write_report

from benchmarks.clips import Clip, as_srgb, encoded
from benchmarks.measure import (
    ALL,
    DEAD_TIME,
    IDEAL,
    LEAK,
    MISMATCH,
    SHOT,
    Job,
    JobError,
    Log,
    Measured,
    Plan,
    about,
    machine_line,
    number,
    of_a_plan,
    peer_arguments,
    run_rounds,
)

SHIPPED_KNEE = "pixel.log_response.linear_below=2.72"
ALL_WEAK = (*ALL[:-1], "pixel.shot_noise.rate_hz=0.1")
POLE = "pixel.source_follower.cutoff_hz=1000"
NOISE = "pixel.photoreceptor_noise.rms=0.03"
TWO_POLES = (
    "pixel.dark_current.dn=10",
    "pixel.low_pass={cutoff_hz: 2200, dark_cutoff_hz: 0.1}",
    "pixel.source_follower.cutoff_hz=100",
)
"""Parameters by still pixels of a DAVIS346; see configs/davis346.yaml."""

OFF_NAME = "exact, noise off"
"""The setting that others are compared with."""

SMALL, LARGE, AT_REST = "346x260", "1280x720", "346x260, 9/10 at rest"
DENSE = "346x260, dense"
CAMERAS = {
    "240x180": Clip(width=240, height=180, frames=480),
    SMALL: Clip(width=346, height=260, frames=480),
    LARGE: Clip(width=1280, height=720, frames=97),
    AT_REST: Clip(width=346, height=260, frames=1920, moving=0.1),
    DENSE: Clip(width=346, height=260, frames=480, encoding="srgb"),
}
"""Clips by name."""
BESIDE_PEER = (SMALL, LARGE, DENSE)
NOISY_DENSE = ("photoreceptor noise 0.03", "two poles and noise as measured")

SPEED_ABOUT = (
    "Frames in memory to sorted events in memory, compiled and warmed up (four frames; then the"
    " garbage of the imports is collected, and 0.4 s waited for threads that spin, whatever the"
    " tool), each run in a process of its own,"
    " rounds interleaved: median (least..most). Mpx-frames: pixels times frames, in"
    " millions, as the pixel sees them (after interpolation). CPU: processor time of all threads."
    " Time: wall time relative to the first"
    " row of the table, paired by round. Peak memory is that of the whole process, with the"
    " interpreter, libraries, clip and all events."
)
FILES_ABOUT = (
    "240 frames a second, light coded as sRGB, MP4 (mp4v). Whole processes, from start to"
    " end, so with imports and compiled code loaded from its cache: median (least..most). Time is"
    " relative to the first row, paired by round."
)


@dataclass(frozen=True, kw_only=True)
class Setting:
    """A configuration of adv2e on one of :data:`CAMERAS`: what it adds to the ideal pixel.

    Where `config` names a shipped one, it adds to that.
    Slow ones take a `share` of the clip's frames; of these, every `stride`-th is taken.
    """

    clip: str
    name: str
    sets: tuple[str, ...] = ()
    config: str | None = None
    share: float = 1.0
    stride: int = 1


def settings() -> Iterator[Setting]:
    """Yield all settings of adv2e."""
    main = {OFF_NAME: (), "all effects, shot 5 Hz": ALL, "all effects, shot 0.1 Hz": ALL_WEAK}
    for clip in CAMERAS:
        if clip == DENSE:
            continue
        for name, sets in main.items():
            yield Setting(clip=clip, name=name, sets=sets)
        for name, sets in main.items():
            # pixels that pass the knee between two frames are solved one by one: few at this one
            yield Setting(clip=clip, name=f"knee 2.72: {name}", sets=(*sets, SHIPPED_KNEE))
    alone = {
        "mismatch 0.03": (MISMATCH,),
        "leak 0.1 Hz": (LEAK,),
        "dead time 0.5 ms": (DEAD_TIME,),
        "shot 5 Hz": (SHOT,),
        "second pole 300 Hz": ("pixel.source_follower.cutoff_hz=300",),
        "second pole 1000 Hz": (POLE,),
        "overshoot 0.1": ("pixel.reset_overshoot.fraction=0.1",),
        "second pole 1000 Hz, all effects, shot 0.1 Hz": (*ALL_WEAK, POLE),
    }
    for name, sets in alone.items():
        yield Setting(clip=SMALL, name=name, sets=sets)
    for form in ("first_order_hold", "paper"):
        sets = (f"pixel.low_pass.update={form}", "sampling.K=10")
        yield Setting(clip=SMALL, name=f"{form}, K = 10", sets=sets, share=0.5)
    noisy = {
        "photoreceptor noise 0.03": (NOISE,),
        "photoreceptor noise 0.03, second pole 1000 Hz": (NOISE, POLE),
        "two poles as measured": TWO_POLES,
        "two poles and noise as measured": (*TWO_POLES, "pixel.photoreceptor_noise.rms=0.055"),
    }
    for name, sets in noisy.items():
        yield Setting(clip=SMALL, name=name, sets=sets)
        yield Setting(clip=AT_REST, name=name, sets=sets, share=0.25)
    dense = {OFF_NAME: (), "all effects, shot 5 Hz": ALL, "second pole 1000 Hz": (POLE,)}
    for name, sets in {**dense, **{key: noisy[key] for key in NOISY_DENSE}}.items():
        yield Setting(clip=DENSE, name=name, sets=sets)
    shipped = "davis346"
    yield Setting(clip=DENSE, name=f"{shipped}, L = 1", sets=("sampling.L=1",), config=shipped)
    decoded = ("frames.encoding=srgb", SHIPPED_KNEE, "sampling.L=10")
    yield Setting(clip=SMALL, name="sRGB decoded, L = 10, noise off", sets=decoded, stride=10)


def _clip(name: str, plan: Plan) -> Clip:
    """Return the clip of that name, in quick mode a short one."""
    clip = CAMERAS[name]
    return replace(clip, frames=25 if clip.width > 400 else 49) if plan.quick else clip


def setting_jobs(plan: Plan) -> Iterator[Job]:
    """Yield the jobs of adv2e, on frames in memory."""
    for one in settings():
        clip = _clip(one.clip, plan)
        frames = max(8, round(one.share * clip.frames / one.stride))
        name = f"{one.clip}: {one.name}"
        yield plan.job(name, clip, one.sets, one.config, frames=frames, stride=one.stride)


def peer_jobs(plan: Plan, python: str) -> Iterator[Job]:
    """Yield the jobs of EventCV, on frames in memory."""
    for camera in BESIDE_PEER:
        clip = str(as_srgb(_clip(camera, plan), plan.folder))
        for steps, effects in (("off", 0), ("10", 0), ("adaptive", 0), ("10", 1)):
            what = "all effects" if effects else "noise off"
            options = {"arguments": peer_arguments(bool(effects), steps)}
            name = f"{camera}: EventCV, sub-steps {steps}, {what}"
            yield Job(
                name=name, tool="eventcv", python=python, clip=clip, options=options,
                threads=plan.threads,
            )  # fmt: skip


def chosen(jobs: Sequence[Job], globs: Sequence[str], option: str) -> list[Job]:
    """Return the jobs whose names fit; those of a clip stay together, its first one first."""
    clips = {job.name.partition(": ")[0]: None for job in jobs}
    ordered = [job for clip in clips for job in jobs if job.name.startswith(f"{clip}: ")]
    found = [job for job in ordered if any(fnmatch.fnmatch(job.name, one) for one in globs)]
    if not found:
        raise JobError(
            f"{option} {', '.join(globs)}: no setting has such a name; names are 'clip: setting'"
        )
    return found


def file_jobs(plan: Plan, peer: str | None, scratch: Path, notes: list[str]) -> list[Job]:
    """Return whole conversions of videos, named ``clip: what``; notes how EventCV reads them."""
    by_itself = bool(shutil.which("ffmpeg") and shutil.which("ffprobe"))
    if peer and not by_itself:
        notes.append(
            "EventCV reads files through ffmpeg and ffprobe, which are not on PATH: here OpenCV"
            " decodes for it."
        )
    quiet = (
        *(one for one in IDEAL if not one.startswith("sampling.")),
        "frames.encoding=srgb",
        "sampling.L=1",
    )
    usual = {
        "adv2e to HDF5, noise off, L = 1": (".h5", quiet),
        "adv2e to text, noise off, L = 1": (".txt", quiet),
        "adv2e to HDF5, as shipped, L = 1": (".h5", ("sampling.L=1",)),
        "adv2e to text, as shipped, L = 1": (".txt", ("sampling.L=1",)),
        "adv2e to HDF5, as shipped (L = 10)": (".h5", ()),
    }
    first = next(iter(usual))
    commands = {}
    for camera, cases in {SMALL: usual, DENSE: {first: usual[first]}}.items():
        # what both tools take video for
        clip = replace(CAMERAS[camera], frames=97) if plan.quick else CAMERAS[camera]
        video = str(encoded(as_srgb(clip, plan.folder), clip.fps))
        for name, (suffix, sets) in cases.items():
            target = str(scratch / f"out{len(commands)}{suffix}")
            words = [word for one in sets for word in ("--set", one)]
            words += ["--threads", str(plan.threads)] if plan.threads else []
            program = [sys.executable, "-m", "adv2e", "convert", video, "-o", target]
            commands[f"{camera}: {name}"] = [*program, "--overwrite", "-q", *words], target
        for steps in ("off", "10", "adaptive") if peer else ():
            target = str(scratch / f"out{len(commands)}.h5")
            command = _peer_command(str(peer), video, target, steps, by_itself)
            commands[f"{camera}: EventCV to HDF5, sub-steps {steps}, noise off"] = command, target
    return [
        Job(
            name=name, action="run_command", options={"command": command, "target": target},
            threads=plan.threads,
        )
        for name, (command, target) in commands.items()
    ]  # fmt: skip


def _peer_command(python: str, video: str, target: str, steps: str, by_itself: bool) -> list[str]:
    """Return the command by which EventCV converts a video, `by_itself` or decoded by OpenCV."""
    given = peer_arguments(False, steps)
    if not by_itself:
        return [
            python,
            str(Path(__file__).with_name("worker.py")),
            video,
            target,
            json.dumps(given),
        ]
    given["threshold"] = given.pop("pos_thres")
    del given["neg_thres"]
    words = [w for k, v in given.items() for w in (f"--{k.replace('_', '-')}", f"{v}")]
    return [python, "-m", "eventcv", "simulate", video, target, "--quiet", *words]


# --- tables --------------------------------------------------------------------------------------


def seen_frames(one: Measured) -> int:
    """Return the number of frames after interpolation by the last ``sampling.L``."""
    factor = 1
    for given in one.job.options.get("sets", ()):
        key, _, value = given.partition("=")
        factor = int(value) if key == "sampling.L" else factor
    return (int(one.last["frames"]) - 1) * factor + 1


def megapixel_frames(one: Measured) -> float:
    """Return pixels times frames that the pixel sees, in millions."""
    return float(one.last["pixels"]) * seen_frames(one) / 1e6


def by_clip(measured: Sequence[Measured]) -> dict[str, list[Measured]]:
    """Return what was measured, by clip; jobs are named ``clip: what``."""
    clips: dict[str, list[Measured]] = {}
    for one in measured:
        clips.setdefault(one.job.name.partition(": ")[0], []).append(one)
    return clips


def speed_tables(measured: Sequence[Measured]) -> str:
    """Return a table a clip."""
    head = (
        "setting", "Mpx-frames/s", "a CPU second", "CPU ns a pixel-frame", "CPU ns an event",
        "time", "frames", "M events", "Mev/s", "peak MiB",
    )  # fmt: skip
    parts = [
        f"**{clip}**\n\n{table(head, [_speed_row(one, rows[0]) for one in rows])}"
        for clip, rows in by_clip(measured).items()
    ]
    return "\n\n".join([SPEED_ABOUT, *parts])


def _speed_row(one: Measured, first: Measured) -> list[str]:
    size, events = megapixel_frames(one), one.last["events"] / 1e6
    return [
        one.job.name.partition(": ")[2],
        str(one.wall_s().inverse(size)),
        number(size / one.cpu_s().median),
        number(1e3 * one.cpu_s().median / size),
        number(1e3 * one.cpu_s().median / events) if events else "-",
        str(one.ratio(first).times(megapixel_frames(first) / size)),  # lengths may differ
        number(seen_frames(one)),
        number(events),
        number(events / one.wall_s().median),
        one.peak_text(),
    ]


def relative_table(measured: Sequence[Measured]) -> str:
    """Return how long EventCV takes, relative to adv2e with the same effects; empty without it."""
    named = {one.job.name: one for one in measured}
    peers = [name.partition(": ")[2] for name in named if "EventCV" in name]
    rows = []
    for name in dict.fromkeys(peers):
        own = "all effects, shot 5 Hz" if "all effects" in name else OFF_NAME
        pairs = [[named.get(f"{clip}: {one}") for one in (name, own)] for clip in BESIDE_PEER]
        cells = [
            str(a.ratio(b).times(megapixel_frames(b) / megapixel_frames(a))) if a and b else "-"
            for a, b in pairs
        ]
        if any(cell != "-" for cell in cells):
            rows.append([name, *cells])
    return table(("relative time", *BESIDE_PEER), rows) if rows else ""


def files_table(found: Sequence[Measured]) -> str:
    """Return a table a clip of whole conversions."""
    head = ("conversion", "wall s", "CPU s", "time", "CPU", "MB", "peak MiB")
    parts = []
    for clip, measured in by_clip(found).items():
        rows = [
            [
                one.job.name.partition(": ")[2], str(one.wall_s()), number(one.cpu_s().median),
                str(one.ratio(measured[0])), str(one.ratio(measured[0], "cpu_s")),
                number(one.last["bytes"] / 1e6), one.peak_text(),
            ]
            for one in measured
        ]  # fmt: skip
        parts.append(f"**{clip}**\n\n{table(head, rows)}")
    return "\n\n".join([FILES_ABOUT, *parts])


@click.command()
@of_a_plan(rounds=3, quick_rounds=1)
@click.option("--only", default="*", metavar="GLOB", help="Only settings of such names (speed).")
@click.option("--speed/--no-speed", default=True, show_default=True)
@click.option("--end-to-end", "files", is_flag=True, help="Also MP4 to files.")
@click.option(
    "--peer-python", type=click.Path(exists=True, dir_okay=False), default=sys.executable,
    help="Python with EventCV.  [default: this one]",
)  # fmt: skip
@output_option
def main(
    plan: Plan, log: Log, only: str, speed: bool, files: bool, peer_python: str,
    output: Path | None,
) -> None:  # fmt: skip
    """Measure the speed of adv2e and of EventCV."""
    parts: list[str] = []
    notes: list[str] = []
    found: list[Measured] = []
    peer = peer_of(peer_python, notes)
    if speed:
        peers = peer_jobs(plan, peer) if peer else ()
        jobs = chosen([*setting_jobs(plan), *peers], [only], "--only")
        found += run_rounds(jobs, plan.rounds, log, warm=plan.warm())
        parts += ["## Speed", speed_tables(found), relative_table(found)]
    if files:
        with tempfile.TemporaryDirectory(prefix="adv2e-benchmark-") as scratch:
            jobs = file_jobs(plan, peer, Path(scratch), notes)
            whole = run_rounds(jobs, plan.rounds, log, warm=jobs[:5])
        found += whole
        parts += ["## File to file", files_table(whole)]
    notes += [f"Failed: {failure}." for failure in log.failures]
    text = "\n\n".join(filter(None, ["# Benchmark", about(found), *notes, *parts]))
    numbers = {
        "machine": machine_line(),
        "notes": notes,
        "measured": [asdict(one) for one in found],
    }
    write_report(text, output, numbers)


def peer_of(python: str, notes: list[str]) -> str | None:
    """Return the Python if EventCV works in it; note it if it does not."""
    command = [python, "-c", "import eventcv"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if not done.returncode:
        return python
    reason = (done.stderr.strip().splitlines() or ["it does not start"])[-1]
    notes.append(f"EventCV took no part: {reason}.")
    return None


if __name__ == "__main__":
    main()
