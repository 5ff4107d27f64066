#!/usr/bin/env python
"""Damage small files of every kind, read them, and tell what does not end in one right line.

Each is a good file with some bits, bytes, numbers or parts of it changed, read by ``adv2e info``,
``convert``, ``render``, ``compare``, ``config check`` or ``characterise`` in a process of its own,
a copy (fork) of one that has imported all there is, so that each begins in a few milliseconds::

    python scripts/dev/fuzz_readers.py --count 4000
    python scripts/dev/fuzz_readers.py --seconds 600 --seed 7 -o found
    python scripts/dev/fuzz_readers.py --only monash --first 1234 --count 1 -o found

Told are internal errors, signals, more than 1 GiB, more than 10 s of computing, lines that
libraries print, and errors that are not one line.  The same seed and number give the same file.
Exit status 1 if anything was found; with ``-o`` what was read lies there, by number.  Linux only.
"""

from __future__ import annotations

import faulthandler
import importlib
import os
import random
import re
import resource
import shutil
import signal
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

import click
import cv2
import numpy as np
from dev.fuzz_seeds import Seed, all_seeds

_LIBRARIES = re.compile(
    r"libpng|TIFF|JPEG|\[ ?(WARN|ERROR|INFO)|OpenCV|HDF5|ffmpeg|\] ?@ ?0x|\[[a-z0-9_,]+ @ 0x"
    r"|Traceback|Warning|Error:|terminate called|Assertion",
    re.IGNORECASE,
)
"""Lines that libraries print for themselves."""


@dataclass(frozen=True)
class Limits:
    """Limits of a command: computing time [s], time [s], memory beyond the start [MiB]."""

    cpu_s: float = 10.0
    wall_s: float = 60.0
    mib: int = 1024


@dataclass(frozen=True)
class Outcome:
    """How a command ended.

    Attributes
    ----------
    wrong : str
        What is wrong with that; empty: nothing.
    status : int
        Exit status; that of a signal is negative.
    said : str
        What it wrote to standard error.
    """

    wrong: str
    status: int
    said: str
    mib: float


def run(arguments: Sequence[str], folder: Path, limits: Limits) -> Outcome:
    """Run ``adv2e`` with `arguments` in a copy of this process and judge how it ends."""
    said = folder / "stderr"
    hears, tells = os.pipe()
    child = os.fork()
    if not child:
        # the copy itself: what is mapped from files counts in this process alone
        os.write(tells, str(_resident_mib()).encode())
        _become(lambda: _command(arguments), folder, said, limits)
    os.close(tells)
    status, usage, slow = _wait(child, limits)
    began_mib = float(os.read(hears, 64) or 0)
    os.close(hears)
    text = said.read_text("utf-8", errors="replace") if said.exists() else ""
    mib = usage.ru_maxrss / 1024
    code = os.waitstatus_to_exitcode(status)
    wrong = "too slow" if slow or code == -signal.SIGXCPU else judged(code, text)
    if not wrong and mib - began_mib > limits.mib:
        wrong = f"{mib:.0f} MiB"
    return Outcome(wrong, code, text, mib)


def judged(code: int, said: str) -> str:
    """Return what is wrong with an exit status and what was said with it."""
    lines = said.splitlines()
    told = [line for line in lines if line.startswith("adv2e: error:")]
    if code < 0:
        return f"ended by {signal.Signals(-code).name}"
    if code not in (0, 1):
        return f"exit status {code}"
    if "internal error" in said:
        return "internal error"
    if "not enough memory" in said:
        return "too much memory"
    if any(_LIBRARIES.search(line) for line in lines if line not in told):
        return "a library speaks"
    if (len(told), lines[-1:]) != (code, told[-1:] if code else lines[-1:]):
        return f"{len(told)} lines of error with exit status {code}"
    return ""


def _command(arguments: Sequence[str]) -> None:
    from adv2e.__main__ import main  # noqa: PLC0415 - imported already, in the process copied

    sys.argv = ["adv2e", *arguments]
    main()


def _become(action: Callable[[], None], folder: Path, said: Path, limits: Limits) -> None:
    """Be the process that runs one action; never returns."""
    code = 70
    try:
        nothing = os.open(os.devnull, os.O_RDWR)
        errors = os.open(said, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        for number, file in ((0, nothing), (1, nothing), (2, errors)):
            os.dup2(file, number)
        sys.stderr = open(2, "w", 1, closefd=False)  # noqa: SIM115 - pytest has its own
        faulthandler.disable()
        os.chdir(folder)
        seconds = int(time.process_time() + limits.cpu_s) + 1
        resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds + 5))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        most = _virtual_bytes() + (limits.mib << 20)
        resource.setrlimit(resource.RLIMIT_AS, (most, most))
        action()
        code = 0
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else 0 if end.code is None else 1
    finally:
        os._exit(code)


def _wait(child: int, limits: Limits) -> tuple[int, resource.struct_rusage, bool]:
    """Wait for a process, killing it at the limit; return status, usage, whether it was killed."""
    until = time.monotonic() + limits.wall_s
    pause_s = 0.002
    while True:
        done, status, usage = os.wait4(child, os.WNOHANG)
        if done:
            return status, usage, False
        if time.monotonic() > until:
            os.kill(child, signal.SIGKILL)
            _, status, usage = os.wait4(child, 0)
            return status, usage, True
        time.sleep(pause_s)
        pause_s = min(0.05, 1.5 * pause_s)


def _virtual_bytes() -> int:
    return int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()


def _resident_mib() -> float:
    return int(Path("/proc/self/statm").read_text().split()[1]) * resource.getpagesize() / 2**20


# --- the command line ----------------------------------------------------------------------------

READERS = """
cli.info cli.convert cli.render cli.compare cli.config cli.characterise inspection.inspect
inspection.report rendering comparison.compare comparison.report diagnosis.tables.characterise
formats.hdf5_layouts formats.npz formats.hdf5 formats.ddd formats.text formats.davis240c
conversion.pipeline conversion.simulation
sources.video.source sources.images.source sources.npy sources.davis240c
"""
"""Modules that are imported before processes are copied."""


def prepare() -> None:
    """Import and compile whatever readers need, so that the copies of this process need not."""
    cv2.setNumThreads(1)
    for name in READERS.split():
        importlib.import_module(f"adv2e.{name}")
    from adv2e import load_config, simulate  # noqa: PLC0415

    frames = [np.full((4, 5), light, np.float32) for light in (0.1, 0.4)]
    list(simulate(frames, [0.0, 0.1], load_config(["ideal"]), threads=1))


def one(seeds: list[Seed], seed: int, number: int, keep: Path | None) -> tuple[str, Outcome]:
    """Make and read one file; return what was done, and how it ended."""
    draw = random.Random(f"{seed}/{number}")
    chosen = draw.choice(seeds)
    command = draw.choice(chosen.commands)
    with tempfile.TemporaryDirectory(prefix="fuzz-") as name:
        folder = Path(name)
        chosen.write(folder, draw)
        outcome = run([*command, *_QUIET.get(command[0], ())], folder, Limits())
        if outcome.wrong and keep is not None:
            shutil.copytree(folder, keep / f"{number}", dirs_exist_ok=True)
    return f"{chosen.name}: {' '.join(command)}", outcome


_QUIET = {"convert": ("-q", "--threads", "1"), "render": ("-q",)}


@click.command()
@click.option("--count", type=click.IntRange(min=1), help="Files.  [default: 1000]")
@click.option(
    "--seconds", type=click.FloatRange(min=0), help="Go on for so long, in place of that."
)
@click.option("--seed", type=int, default=0, show_default=True)
@click.option("--first", type=int, default=0, show_default=True, help="Number of the first file.")
@click.option("--only", default="", help="Kinds with this in their name.")
@click.option("-o", "--output", type=click.Path(path_type=Path), help="Folder for what was found.")
def main(
    count: int | None, seconds: float | None, seed: int, first: int, only: str, output: Path | None
) -> None:  # fmt: skip
    """Read damaged files of every kind and tell what ends badly."""
    # conversions that make seeds begin threads, which the process that is copied must not have
    with (
        tempfile.TemporaryDirectory() as scratch,
        ProcessPoolExecutor(1, get_context("spawn")) as pool,
    ):
        made = pool.submit(all_seeds, Path(scratch)).result()
    prepare()
    seeds = [seed for seed in made if only in seed.name]
    if not seeds:
        raise click.UsageError(f"--only {only}: no such kind")
    last = first + (count or (sys.maxsize if seconds else 1000))
    until = time.monotonic() + (seconds or float("inf"))
    found: Counter[str] = Counter()
    ended: Counter[str] = Counter()
    number = first
    while number < last and time.monotonic() < until:
        what, outcome = one(seeds, seed, number, output)
        ended["read" if outcome.status == 0 else "refused"] += not outcome.wrong
        if outcome.wrong:
            found[outcome.wrong] += 1
            lines = outcome.said.strip().splitlines()
            click.echo(f"{number} {what}: {outcome.wrong}: {lines[-1] if lines else ''}"[:500])
        number += 1
    told = ", ".join(f"{n} {wrong}" for wrong, n in found.most_common()) or "nothing wrong"
    click.echo(
        f"{number - first} files: {ended['read']} read, {ended['refused']} refused in one line;"
        f" {told}"
    )
    raise SystemExit(bool(found))


if __name__ == "__main__":
    main()
