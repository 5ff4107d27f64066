"""Simulations of small sequences, through `adv2e.simulate` and ``adv2e convert``."""

from __future__ import annotations

import importlib.util
import os
import subprocess
import sys
import zipfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from dev.digests.running import sha
from numpy.typing import NDArray

ROWS, COLUMNS, COUNT, RATE_HZ = 36, 48, 30, 120.0

Array = NDArray[Any]
Clip = tuple[Array, Array]
"""Frames and their times [s]."""

OWN_EFFECT = '''\
"""An effect of one's own that acts at every place of the signal path."""

import numpy as np

from adv2e.effects.hooks import Hooks


class Everything(Hooks):
    stage = "pixel"

    def light(self, frames):
        for t_ns, image in frames:
            yield t_ns + 1000, image * np.float32(1.1)

    def gain(self, times_s):
        return 1 + 0.2 * np.sin(40 * times_s)

    def drive(self, times_s):
        return 0.1 * np.sin(70 * times_s)

    def signal(self, times_s):
        across = np.linspace(0, 0.2, self.view.columns)
        ramp = np.broadcast_to(across, (self.view.rows, self.view.columns))
        return np.sin(90 * times_s)[:, None, None] * ramp

    def thresholds(self, times_s):
        factor = 1 + 0.3 * np.sin(30 * times_s)
        return factor, 2 - factor

    def events(self, chunks):
        for events in chunks:
            pixels = events["y"].astype(np.int64) * self.view.columns + events["x"]
            yield events[self.view.uniforms("loss", pixels, events["t"]) > 0.1]
'''


# --- inputs --------------------------------------------------------------------------------------


def scene(rows: int = ROWS, columns: int = COLUMNS, count: int = COUNT) -> Array:
    """Return light in 0..1, (count, rows, columns): moving waves, a bar, dark and still corners."""
    t = np.arange(count)[:, None, None] / count
    y = np.arange(rows)[None, :, None] / rows
    x = np.arange(columns)[None, None, :] / columns
    wave = 0.5 + 0.45 * np.sin(2 * np.pi * (3 * x + 2 * y - 2 * t))
    bar = np.abs(x - (0.1 + 0.8 * t)) < 0.08
    light = np.where(bar, 1.0, wave * np.exp(-4 * y))
    still = (y > 0.85) | (x < 0.06)
    return np.where(still, 0.35, light).clip(0, 1)


def times(count: int = COUNT) -> Array:
    return np.arange(count) / RATE_HZ


def grey(**size: int) -> Clip:
    light = scene(**size)
    return np.round(255 * light).astype(np.uint8), times(len(light))


def colour() -> Clip:
    light = scene()
    channels = np.stack([light, light**0.7, 1 - light], -1)
    return np.round(255 * channels).astype(np.uint8), times()


def flash() -> Clip:
    """Large steps up and down, with times at rest between them."""
    level = np.array([20, 20, 200, 200, 200, 3, 3, 255, 255, 0] * 3, np.uint8)
    frames = np.broadcast_to(level[:, None, None], (COUNT, ROWS, COLUMNS)).copy()
    frames[:, :, ::2] //= 2
    return frames, times()


def irregular() -> Clip:
    frames, _ = grey()
    number = np.arange(COUNT)
    return frames, 12.5 + (number + 0.4 * np.sin(number * 2.3)) / RATE_HZ


def constant(level: int = 90) -> Clip:
    return np.full((COUNT, ROWS, COLUMNS), level, np.uint8), times()


CLIPS: Mapping[str, Callable[[], Clip]] = {
    "grey": grey,
    "large": lambda: grey(rows=130, columns=173, count=12),
    "one pixel": lambda: grey(rows=1, columns=1),
    "odd size": lambda: grey(rows=5, columns=7),
    "16 bits": lambda: (np.round(65535 * scene()).astype(np.uint16), times()),
    "float32": lambda: (scene().astype(np.float32), times()),
    "float64": lambda: (scene(), times()),
    "colour": colour,
    "colour floats": lambda: (np.stack([scene()] * 3, -1).astype(np.float32), times()),
    "flash": flash,
    "irregular": irregular,
    "constant": constant,
    "black": lambda: constant(0),
    "two frames": lambda: grey(count=2),
    "slow": lambda: (grey(count=6)[0], np.arange(6) / 4.0),
}


# --- cases ---------------------------------------------------------------------------------------

LINEAR = "frames.encoding=linear"

NOISELESS = (
    "pixel.thresholds.mismatch=0", "pixel.leak=null", "pixel.shot_noise=null",
    "sampling.L=1", "pixel.initial_reference=settled",
)  # fmt: skip
"""The exact circuit with dead time and nothing that is drawn."""

BUSY = (
    "sampling.L=1", "pixel.leak.rate_hz=8", "pixel.leak.photo_rate_hz=5",
    "pixel.shot_noise.rate_hz=20",
)  # fmt: skip
"""The exact circuit with leak, noise and mismatch that show in a short clip."""

QUIET_CASES = """
plain
no refractory: pixel.refractory=null
long refractory: pixel.refractory.period_us=20000
unequal thresholds: pixel.thresholds.on=0.12; pixel.thresholds.off=0.31
slow: pixel.low_pass.cutoff_hz=30
fast and dark: pixel.low_pass.cutoff_hz=3000; pixel.low_pass.dark_cutoff_hz=0
pure logarithm: pixel.log_response.linear_below=0
knee 20: pixel.log_response.linear_below=20
no low pass: pixel.low_pass=null
no low pass nor refractory: pixel.low_pass=null; pixel.refractory=null
linear L: sampling.L=7
flow L: sampling.L=4; sampling.interpolation=flow
printed: sampling.L=5; sampling.last_interval=printed
running reference: pixel.initial_reference=running
random reference: pixel.initial_reference=random
tick: readout.tick_us=100
"""
"""Added to NOISELESS."""

BUSY_CASES = """
plain
seed: seed=18446744073709551615
no refractory: pixel.refractory=null
leak alone: pixel.shot_noise=null; pixel.leak.jitter=0
shot noise alone: pixel.leak=null
mismatch: pixel.thresholds.mismatch=0.1
jitter: pixel.leak.jitter=0.3
L 10: sampling.L=10
no low pass: pixel.low_pass=null
printed: sampling.L=5; sampling.last_interval=printed
hot pixels: pixel.hot_pixels={fraction: 0.05, rate_hz: 300}
dead pixels: pixel.dead_pixels.fraction=0.1
dark current: pixel.dark_current.dn=10
photoreceptor noise: pixel.photoreceptor_noise.rms=0.05
source follower: pixel.source_follower.cutoff_hz=200
fast source follower: pixel.source_follower.cutoff_hz=5000
slew limit: pixel.slew_limit.per_s=20
reset overshoot: pixel.reset_overshoot.fraction=0.3
threshold drift: pixel.thresholds.drift_per_s=0.5
all poles: pixel.source_follower.cutoff_hz=300; pixel.slew_limit.per_s=40; \
pixel.reset_overshoot.fraction=-0.2; pixel.photoreceptor_noise.rms=0.03; \
pixel.thresholds.drift_per_s=-0.5; pixel.hot_pixels={fraction: 0.02, rate_hz: 100}
flicker: frames.flicker={frequency_hz: 100, depth: 0.3}
exposure: frames.exposure_us=6000
black level: frames.black_level_dn=5
black depth: frames.black_depth_dn=8
clock: frames.clock_offset_us=-1234; frames.clock_drift_ppm=900
shift: frames.shift_px=[1.5,-0.25]
encoding srgb: frames.encoding=srgb
encoding gamma: frames.encoding=gamma:2.4; frames.full_scale=200
encoding hlg L: frames.encoding=hlg; sampling.L=3
arbiter: readout.arbiter={event_ns: 3000, row_ns: 8000}
event loss: readout.loss.fraction=0.3
frame coupling: readout.frame_coupling={amplitude: 0.3, tau_us: 500}
readout: readout.arbiter={event_ns: 500, row_ns: 0}; readout.loss.fraction=0.1; readout.tick_us=10
"""
"""Added to BUSY."""


@dataclass(frozen=True)
class Case:
    """One simulation through `adv2e.simulate`."""

    sets: Sequence[str] = ()
    clip: str = "grey"
    files: Sequence[str] = ()
    own: bool = False


def in_memory() -> dict[str, Case]:
    """Return all simulations through `adv2e.simulate`, by name."""
    shipped = ("adv2e", "paper", "v2e", "vid2e", "ideal", "davis240c", "davis346")
    # the clips stay as small as they are
    found = {f"config {name}": Case(["sensor=null"], files=[name]) for name in shipped}
    for title, base, table in (
        ("noiseless", NOISELESS, QUIET_CASES), ("noise", BUSY, BUSY_CASES),
    ):  # fmt: skip
        for line in table.strip().splitlines():
            name, _, sets = line.partition(": ")
            found[f"{title}, {name}"] = Case([*base, *filter(None, sets.split("; "))])
    for update in ("zero_order_hold", "first_order_hold", "euler", "paper"):
        sets = [f"pixel.low_pass.update={update}", "sampling.L=2", "sampling.K=5"]
        found[f"{update}, noiseless"] = Case([*NOISELESS, *sets])
        found[f"{update}, noise"] = Case([*BUSY, *sets])
    sets = [
        "pixel.low_pass.update=first_order_hold", "sampling.L=3", "sampling.K=10",
        "sampling.last_interval=printed", "pixel.refractory=null",
    ]  # fmt: skip
    found["first_order_hold, printed"] = Case([*NOISELESS, *sets])
    sets = [
        "pixel.leak.jitter=0.3", "pixel.leak.rate_hz=8", "pixel.hot_pixels.fraction=0.05",
        "pixel.hot_pixels.rate_hz=300",
    ]  # fmt: skip
    found["paper, jitter and hot pixels"] = Case(sets, files=["paper"])
    for clip in CLIPS:
        found[f"clip {clip}, noiseless"] = Case(NOISELESS, clip)
        found[f"clip {clip}, noise"] = Case(BUSY, clip)
    found["clip flash, ideal"] = Case(clip="flash", files=["ideal"])
    found["clip large, default"] = Case(clip="large")
    found["own effect"] = Case(BUSY, own=True)
    found["own effect, paper"] = Case(["sampling.L=2"], files=["paper"], own=True)
    return found


def simulated(case: Case, threads: int, folder: Path) -> Array:
    """Return the events of a case."""
    import adv2e  # noqa: PLC0415

    # whatever a commit takes grey frames for; what a case says comes after it
    light = [] if case.clip == "colour" else [LINEAR]
    config = adv2e.load_config(list(case.files), [*light, *case.sets])
    effects = [_own_effect(folder)()] if case.own else []
    frames, instants = CLIPS[case.clip]()
    chunks = adv2e.simulate(frames, instants, config, effects=effects, threads=threads)
    return np.concatenate(list(chunks))


def _own_effect(folder: Path) -> Any:
    path = folder / "everything.py"
    path.write_text(OWN_EFFECT)
    spec = importlib.util.spec_from_file_location("everything", path)
    if spec is None or spec.loader is None:
        raise ImportError(path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.Everything


# --- the command line ----------------------------------------------------------------------------


@dataclass(frozen=True)
class Command:
    """One call of ``adv2e convert``: an input that `make` writes, and how to convert it."""

    make: Callable[[Path], Path]
    output: str
    options: Sequence[str] = field(default=())


def npy(folder: Path) -> Path:
    path = folder / "stack.npy"
    np.save(path, grey()[0])
    return path


def images(folder: Path) -> Path:
    """Write a folder of grey images as PGM, which numpy alone can write."""
    into = folder / "images"
    into.mkdir()
    for number, image in enumerate(np.round(65535 * scene()).astype(">u2")):
        head = f"P5 {COLUMNS} {ROWS} 65535\n".encode()
        (into / f"frame_{number:04d}.pgm").write_bytes(head + image.tobytes())
    return into


def video(folder: Path) -> Path:
    """Write a film of colour frames without compression, as YUV4MPEG2."""
    luma = np.round(16 + 219 * scene()).astype(np.uint8)
    blue, red = 255 - luma[:, ::2, ::2] // 2, 64 + luma[:, ::2, ::2] // 2
    path = folder / "film.y4m"
    with path.open("wb") as file:
        file.write(f"YUV4MPEG2 W{COLUMNS} H{ROWS} F{RATE_HZ:.0f}:1 Ip A1:1 C420jpeg\n".encode())
        for planes in zip(luma, blue, red, strict=True):
            file.write(b"FRAME\n" + b"".join(plane.tobytes() for plane in planes))
    return path


def recording(folder: Path) -> Path:
    """Write the frames of a DAVIS240C folder, with irregular times."""
    into = images(folder)
    _, instants = irregular()
    lines = [f"{t:.9f} {p.name}\n" for t, p in zip(instants, sorted(into.iterdir()), strict=True)]
    (into / "images.txt").write_text("".join(lines))
    return into


NPY = ("--fps", "120", "--set", LINEAR)

COMMANDS: Mapping[str, Command] = {
    "command npy to txt": Command(npy, "out.txt", NPY),
    "command npy to h5": Command(npy, "out.h5", NPY),
    "command video to h5 with frames": Command(video, "out.h5", ["--with-frames"]),
    "command video to txt, L 1": Command(video, "out.txt", ["--set", "sampling.L=1"]),
    "command images to zip": Command(images, "out.zip", ["--fps", "30000/1001"]),
    "command recording to folder": Command(
        recording, "out", ["-c", "davis240c", "--set", "sensor=null"]
    ),
    "command recording to standard output": Command(
        recording, "-", ["--start", "0.05", "--stop", "0.2", "--t0", "zero", "--set", "seed=3"]
    ),
    "command own effect": Command(npy, "out.txt", [*NPY, "--effect", "everything.py"]),
}


def converted(command: Command, threads: int, folder: Path) -> tuple[Array, str]:
    """Return the events in the output, and a digest of all that it holds."""
    (folder / "everything.py").write_text(OWN_EFFECT)
    source = command.make(folder)
    words = ["convert", str(source), "-o", command.output, "--threads", str(threads), "-q"]
    done = subprocess.run(
        [sys.executable, "-m", "adv2e", *words, *command.options],
        cwd=folder, check=False, capture_output=True,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
    )  # fmt: skip
    if done.returncode:
        raise RuntimeError(done.stderr.decode().strip())
    if command.output == "-":
        return _text_events(done.stdout), sha(done.stdout)
    out = folder / command.output
    if out.suffix == ".h5":
        return _hdf5(out)
    parts = dict(_parts(out))
    text = parts.get("events.txt", parts.get(out.name, b""))
    return _text_events(text), sha(*(name.encode() + data for name, data in sorted(parts.items())))


def _parts(out: Path) -> Iterator[tuple[str, bytes]]:
    """Yield the files of an output; not what is said about how it was made."""
    if out.suffix == ".zip":
        with zipfile.ZipFile(out) as archive:
            for name in archive.namelist():
                if not name.endswith(".json"):
                    yield name, archive.read(name)
        return
    for path in [out] if out.is_file() else sorted(out.rglob("*")):
        if path.is_file() and path.suffix != ".json":
            yield path.name, path.read_bytes()


def _text_events(text: bytes) -> Array:
    rows = [line.split() for line in text.decode().splitlines()]
    moments = [round(float(t) * 1e6) for t, *_ in rows]
    rest = np.array([row[1:] for row in rows], np.int64).reshape(-1, 3)
    return _events(np.array(moments, np.int64), *rest.T)


def _hdf5(path: Path) -> tuple[Array, str]:
    import h5py  # noqa: PLC0415

    found: dict[str, Array] = {}
    with h5py.File(path) as file:
        file.visititems(
            lambda name, item: found.update({name: item[()]})
            if isinstance(item, h5py.Dataset) else None
        )  # fmt: skip
    ts, xs, ys, ps = (found[f"events/{name}"] for name in ("ts", "xs", "ys", "ps"))
    moments = np.round(ts * 1e6) if ts.dtype.kind == "f" else ts
    digest = sha(*(f"{n} {found[n].dtype}".encode() + found[n].tobytes() for n in sorted(found)))
    return _events(moments, xs, ys, ps), digest


def _events(t: Array, x: Array, y: Array, p: Array) -> Array:
    events = np.empty(t.size, [("t", "<i8"), ("x", "<u2"), ("y", "<u2"), ("p", "u1")])
    events["t"], events["x"], events["y"], events["p"] = t, x, y, p
    return events


def cases() -> dict[str, Callable[[int, Path], tuple[Array, str]]]:
    """Return what runs each simulation, by name."""

    def simulation(case: Case) -> Callable[[int, Path], tuple[Array, str]]:
        def run(threads: int, folder: Path) -> tuple[Array, str]:
            events = simulated(case, threads, folder)
            return events, sha(events.tobytes())

        return run

    def conversion(command: Command) -> Callable[[int, Path], tuple[Array, str]]:
        return lambda threads, folder: converted(command, threads, folder)

    return {name: simulation(case) for name, case in in_memory().items()} | {
        name: conversion(command) for name, command in COMMANDS.items()
    }
