#!/usr/bin/env python
"""Convert for an hour over random clips, configurations and formats, and end it at random moments.

Each trial makes a few clips, converts them undisturbed, and converts them again while a signal, a
killed process or a full disk ends the work, up to three times.  Then the work is called once more,
and every byte is compared::

    python scripts/dev/soak.py --minutes 60
    python scripts/dev/soak.py --trials 20 --seed 3 -o soak.md

After each end, no file under its final name may differ from that of the undisturbed run, no process
may be left, and the exit status must be that of the signal.  At the end nothing may lie beside the
results.  The exit status is 1 if anything of that does not hold (Linux only).
"""

from __future__ import annotations

import hashlib
import json
import os
import random
import resource
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

import click
import cv2
import numpy as np
from numpy.typing import NDArray
from writing import output_option, table, write_report

RECIPE = "recipe.json"

_END_S = 20.0
"""Time in which processes must be gone after the one that began them."""

_HANGS_S = 300.0

_PYTHON_BEGINS = ('File "<frozen site>"', "Could not import runpy module")
"""Told by a Python that a signal ends before it has come to the program."""

_SIZES = ((32, 24), (64, 48), (97, 61), (240, 180))
_FORMATS = ("h5", "txt", "csv", "npz", "zip", "folder", "evt3", "aedat4")
_SETS = (
    (),
    ("sampling.L=1",),
    ("sampling.L=3", "pixel.low_pass=null"),
    ("pixel.refractory=null",),
    ("pixel.thresholds.on=0.1", "pixel.thresholds.off=0.15"),
    ("readout.tick_us=10",),
    ("pixel.shot_noise.rate_hz=20", "pixel.leak.rate_hz=2"),
)


@dataclass
class Record:
    """Counts of trials, ends, files and bytes, and each thing that did not hold."""

    counts: Counter[str] = field(default_factory=Counter)
    losses: list[str] = field(default_factory=list)

    def text(self) -> str:
        """Return the table."""
        rows = [[name, f"{count:,}"] for name, count in self.counts.items()]
        return table(("what", "count"), [*rows, ["**losses**", f"**{len(self.losses)}**"]])


def frames_of(
    draw: random.Random, size: tuple[int, int], count: int
) -> Iterator[NDArray[np.uint8]]:
    """Yield frames of a texture that moves."""
    width, height = size
    rng = np.random.default_rng(draw.getrandbits(32))
    texture = cv2.GaussianBlur(rng.random((height * 2, width * 2)), (0, 0), 2)
    texture = cv2.normalize(texture, None, 0, 255, cv2.NORM_MINMAX).astype(np.uint8)
    step = draw.randint(0, 3), draw.randint(0, 3)
    for k in range(count):
        shifted = np.roll(texture, (k * step[1], k * step[0]), axis=(0, 1))
        yield np.ascontiguousarray(shifted[:height, :width])


def make_clips(draw: random.Random, root: Path) -> None:
    """Make one to four clips below a folder: videos, and folders of images with their times."""
    for number in range(draw.randint(1, 4)):
        size, count = draw.choice(_SIZES), draw.randint(2, 60)
        place = root / draw.choice((".", "a", "a/b"))
        place.mkdir(parents=True, exist_ok=True)
        frames = frames_of(draw, size, count)
        if draw.random() < 0.6:
            code = cv2.VideoWriter_fourcc(*"FFV1")
            writer = cv2.VideoWriter(str(place / f"{number}.avi"), code, 30, size)
            for frame in frames:
                writer.write(cv2.cvtColor(frame, cv2.COLOR_GRAY2BGR))
            writer.release()
            continue
        (place / f"{number}" / "images").mkdir(parents=True)
        lines, t_s = [], 0.0
        for k, frame in enumerate(frames):
            name = f"images/{k:05}.png"
            cv2.imwrite(str(place / f"{number}" / name), frame)
            lines.append(f"{t_s:.6f} {name}\n")
            t_s += draw.uniform(0.01, 0.05)
        (place / f"{number}" / "images.txt").write_text("".join(lines), encoding="utf-8")


def files_in(dest: Path) -> dict[str, str]:
    """Return the digest of each file under its final name."""
    return {
        path.relative_to(dest).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(dest.rglob("*"))
        if path.is_file()
        and not path.name.startswith("manifest")
        and not any(part.startswith(".adv2e") for part in path.relative_to(dest).parts)
    }


def is_recipe(path: Path) -> bool:
    """Tell whether a file is a whole recipe."""
    with suppress(ValueError):
        return "sequences" in json.loads(path.read_text(encoding="utf-8"))
    return False


def strays_in(dest: Path) -> list[str]:
    """Return what lies in a folder that no user is to find."""
    return [str(path) for path in dest.rglob("*") if path.name.startswith((".adv2e", "new"))]


def small_disk(most: int) -> None:
    """Let no file of this process grow beyond `most` bytes."""
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (most, most))


def as_in_front() -> None:
    """Have SIGINT end the process, though a shell may have put all of this into the background."""
    signal.signal(signal.SIGINT, signal.default_int_handler)


class Trial:
    """One set of clips and one command, undisturbed and disturbed, in a folder of its own."""

    def __init__(self, number: int, seed: int, root: Path, record: Record) -> None:
        self._draw = random.Random(f"{seed}-{number}")
        self._number, self._root, self._record = number, root, record
        source = root / "source"
        make_clips(self._draw, source)
        self._options = ["--format", self._draw.choice(_FORMATS), "--seed", str(number)]
        for one in self._draw.choice(_SETS):
            self._options += ["--set", one]
        self._is_batch = self._draw.random() < 0.7
        clips = [path for path in source.rglob("*") if path.suffix == ".avi"]
        clips += [path.parent for path in source.rglob("images.txt")]
        self._source = source if self._is_batch else self._draw.choice(sorted(clips))
        if self._is_batch:
            self._options += ["--jobs", str(self._draw.randint(1, 3))]

    def command(self, dest: Path) -> list[str]:
        """Return the command line that makes `dest`."""
        program = [sys.executable, "-m", "adv2e"]
        if self._is_batch:
            return [*program, "batch", str(self._source), str(dest), *self._options]
        target = str(dest / "out")
        convert = [*program, "convert", str(self._source), "-o", target, "--overwrite"]
        return [*convert, *self._options]

    def lose(self, what: str) -> None:
        """Note something that does not hold."""
        self._record.losses.append(f"trial {self._number}: {what}: {' '.join(self._options)}")

    def run(self) -> None:
        """Do it all."""
        wanted, dest = self._root / "wanted", self._root / "dest"
        began = time.monotonic()
        self._finish(wanted)
        took_s = time.monotonic() - began
        expected = files_in(wanted)
        dest.mkdir()
        for _ in range(self._draw.randint(1, 3)):
            self._disturb(dest, took_s)
            for name, digest in files_in(dest).items():
                # a recipe is of what is done so far
                whole = is_recipe(dest / name) if name == RECIPE else expected.get(name) == digest
                if not whole:
                    self.lose(f"{name} is under its final name and not whole")
        self._finish(dest)
        found = files_in(dest)
        if found != expected:
            self.lose(f"made {sorted(found)}, expected {sorted(expected)}, or other bytes")
        if strays := strays_in(dest):
            self.lose(f"left over: {strays}")
        self._record.counts["files compared"] += len(found)
        self._record.counts["bytes compared"] += sum((dest / name).stat().st_size for name in found)
        self._record.counts["trials"] += 1

    def _finish(self, dest: Path) -> None:
        dest.mkdir(exist_ok=True)
        done = subprocess.run(
            self.command(dest), capture_output=True, text=True, check=False, timeout=_HANGS_S
        )
        self._record.counts["runs to the end"] += 1
        if done.returncode:
            self.lose(f"undisturbed, it ended with {done.returncode}: {done.stderr[-300:]}")

    def _disturb(self, dest: Path, took_s: float) -> None:
        kinds = ["SIGKILL", "SIGINT", "SIGTERM", "full disk"]
        kind = self._draw.choice([*kinds, "a process killed"] if self._is_batch else kinds)
        begin: Callable[[], None] = as_in_front
        if kind == "full disk":
            begin = partial(small_disk, int(10 ** self._draw.uniform(2, 6)))
        process = subprocess.Popen(
            self.command(dest), stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
            start_new_session=True,
            preexec_fn=begin,  # noqa: PLW1509 - this program has one thread
        )  # fmt: skip
        self._record.counts[f"ended by {kind}"] += 1
        if kind != "full disk":
            time.sleep(self._draw.uniform(0, 1.1 * took_s))
            if kind == "a process killed":
                workers = children_of(process.pid)
                if workers:
                    kill(self._draw.choice(workers), signal.SIGKILL)
            else:
                kill(process.pid, signal.Signals[kind])
        try:
            _, told = process.communicate(timeout=_HANGS_S)
        except subprocess.TimeoutExpired:
            self.lose(f"hangs after {kind}")
            os.killpg(process.pid, signal.SIGKILL)
            process.communicate()
            return
        self._check_end(kind, process.returncode, told)
        until = time.monotonic() + _END_S
        while is_group(process.pid) and time.monotonic() < until:
            time.sleep(0.05)
        if is_group(process.pid):
            self.lose(f"processes are left {_END_S:g} s after {kind}")
            os.killpg(process.pid, signal.SIGKILL)

    def _check_end(self, kind: str, status: int, told: str) -> None:
        allowed = {
            "SIGKILL": {-9, 0},
            "SIGINT": {130, 0, -2},  # as soon as Python itself begins, it is its own
            "SIGTERM": {143, 0, -15},
            "full disk": {0, 1},
            "a process killed": {0, 1},
        }
        if kind == "SIGINT" and status == 1 and any(one in told for one in _PYTHON_BEGINS):
            self._record.counts["of these, while Python itself began"] += 1
            return
        if status not in allowed[kind]:
            self.lose(f"exit status {status} after {kind}: {told[-1000:]}")
        if "Traceback" in told and status not in (-2, 130):
            self.lose(f"a traceback after {kind}: {told[-1000:]}")
        if status == 0:
            self._record.counts["of these, it had ended before"] += 1


def children_of(pid: int) -> list[int]:
    """Return the processes that a process began, and those that they did."""
    found = []
    for folder in Path("/proc").iterdir():
        if folder.name.isdecimal():
            try:
                parent = int((folder / "stat").read_text().rpartition(")")[2].split()[1])
            except (OSError, IndexError):
                continue
            if parent == pid:
                found += [int(folder.name), *children_of(int(folder.name))]
    return found


def kill(pid: int, number: signal.Signals) -> None:
    """Send a signal to a process that may have ended."""
    with suppress(ProcessLookupError):
        os.kill(pid, number)


def is_group(group: int) -> bool:
    """Tell whether any process of a group is there."""
    try:
        os.killpg(group, 0)
    except ProcessLookupError:
        return False
    return True


@click.command(help=__doc__, context_settings={"max_content_width": 100})
@click.option("--minutes", type=click.FloatRange(min=0), default=60.0, show_default=True)
@click.option("--trials", type=click.IntRange(min=1), help="Stop after so many, too.")
@click.option("--seed", type=int, default=0, show_default=True)
@output_option
def main(minutes: float, trials: int | None, seed: int, output: Path | None) -> None:
    """Go on until the time is over."""
    record = Record()
    until = time.monotonic() + 60 * minutes
    number = 0
    while time.monotonic() < until and (trials is None or number < trials):
        with tempfile.TemporaryDirectory(prefix="adv2e-soak-") as folder:
            Trial(number, seed, Path(folder), record).run()
        number += 1
        left = max(0.0, until - time.monotonic()) / 60
        told = f"\r{number} trials, {len(record.losses)} losses, {left:.0f} min left "
        click.echo(told, nl=False, err=True)
    click.echo(err=True)
    for loss in record.losses:
        click.echo(loss, err=True)
    write_report(record.text(), output, {"counts": record.counts, "losses": record.losses})
    if record.losses:
        raise click.exceptions.Exit(1)


if __name__ == "__main__":
    main()
