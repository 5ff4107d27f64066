"""Simulations of small sequences, through `adv2e.simulate` and ``adv2e convert``."""

from __future__ import annotations

import os
import runpy
import subprocess
import sys
import zipfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from dev.digests.running import sha
from numpy.typing import NDArray

ROWS, COLUMNS, COUNT, RATE_HZ = 36, 48, 30, 120.0

Array = NDArray[Any]
Run = Callable[[int, Path], tuple[Array, str]]
"""Takes threads and a folder; returns events and a digest."""

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


def grey(white: float = 255, dtype: str = "u1", **size: int) -> Array:
    return np.round(white * scene(**size)).astype(dtype)


def colours() -> Array:
    light = scene()
    return np.stack([light, light**0.7, 1 - light], -1)


def flash() -> Array:
    """Large steps up and down, with times at rest between them."""
    level = np.array([20, 20, 200, 200, 200, 3, 3, 255, 255, 0] * 3, np.uint8)
    frames = np.broadcast_to(level[:, None, None], (COUNT, ROWS, COLUMNS)).copy()
    frames[:, :, ::2] //= 2
    return frames


def irregular_s() -> Array:
    number = np.arange(COUNT)
    return 12.5 + (number + 0.4 * np.sin(number * 2.3)) / RATE_HZ


CLIPS: Mapping[str, Callable[[], Array]] = {
    "grey": grey,
    "large": lambda: grey(rows=130, columns=173, count=12),
    "one pixel": lambda: grey(rows=1, columns=1),
    "odd size": lambda: grey(rows=5, columns=7),
    "16 bits": lambda: grey(65535, "u2"),
    "float32": lambda: scene().astype(np.float32),
    "float64": scene,
    "colour": lambda: np.round(255 * colours()).astype(np.uint8),
    "colour floats": lambda: np.stack([scene()] * 3, -1).astype(np.float32),
    "flash": flash,
    "irregular": grey,
    "constant": lambda: np.full((COUNT, ROWS, COLUMNS), 90, np.uint8),
    "black": lambda: np.zeros((COUNT, ROWS, COLUMNS), np.uint8),
    "two frames": lambda: grey(count=2),
    "slow": lambda: grey(count=6),
}
"""Frames.  They stay as small as they are."""


def times(clip: str, count: int) -> Array:
    """Return the times of a clip's frames [s]."""
    return (
        irregular_s()
        if clip == "irregular"
        else np.arange(count) / (4.0 if clip == "slow" else RATE_HZ)
    )


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
"""Names of cases, and what each adds to NOISELESS."""

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
high pass: pixel.high_pass.cutoff_hz=5
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
"""The same, added to BUSY."""

OTHERS = (
    ("first_order_hold, printed", "", NOISELESS, "pixel.low_pass.update=first_order_hold;"
     " sampling.L=3; sampling.K=10; sampling.last_interval=printed; pixel.refractory=null"),
    ("paper, jitter and hot pixels", "paper", (), "pixel.leak.jitter=0.3; pixel.leak.rate_hz=8;"
     " pixel.hot_pixels.fraction=0.05; pixel.hot_pixels.rate_hz=300"),
)  # fmt: skip
"""Name, configuration, what is set first, and then."""


def in_memory() -> Iterator[tuple[str, Run]]:
    """Yield all simulations through `adv2e.simulate`, with their names."""
    cameras = "davis240c", "davis346", "gen4", "atis"
    for name in ("adv2e", "paper", "v2e", "vid2e", "ideal", *cameras):
        yield f"config {name}", simulation(["sensor=null"], file=name)
    for title, base, lines in (
        ("noiseless", NOISELESS, QUIET_CASES), ("noise", BUSY, BUSY_CASES),
    ):  # fmt: skip
        for line in lines.strip().splitlines():
            name, _, sets = line.partition(": ")
            yield f"{title}, {name}", simulation([*base, *filter(None, sets.split("; "))])
    for update in ("zero_order_hold", "first_order_hold", "euler", "paper"):
        sets = [f"pixel.low_pass.update={update}", "sampling.L=2", "sampling.K=5"]
        yield f"{update}, noiseless", simulation([*NOISELESS, *sets])
        yield f"{update}, noise", simulation([*BUSY, *sets])
    for name, file, first, then in OTHERS:
        yield name, simulation([*first, *then.split("; ")], file=file)
    for clip in CLIPS:
        yield f"clip {clip}, noiseless", simulation(NOISELESS, clip)
        yield f"clip {clip}, noise", simulation(BUSY, clip)
    yield "clip flash, ideal", simulation(clip="flash", file="ideal")
    yield "clip large, default", simulation(clip="large")
    yield "own effect", simulation(BUSY, own=True)
    yield "own effect, paper", simulation(["sampling.L=2"], file="paper", own=True)


def simulation(
    sets: Sequence[str] = (), clip: str = "grey", *, file: str = "", own: bool = False
) -> Run:
    """Return what simulates a clip, with a shipped configuration and the own effect if asked."""
    # whatever a commit takes grey frames for; what a case says comes after it
    light = [] if clip == "colour" else [LINEAR]

    def run(threads: int, folder: Path) -> tuple[Array, str]:
        import adv2e  # noqa: PLC0415

        (folder / "everything.py").write_text(OWN_EFFECT)
        effects = [runpy.run_path(str(folder / "everything.py"))["Everything"]()] if own else []
        config = adv2e.load_config([file] if file else [], [*light, *sets])
        frames = CLIPS[clip]()
        instants = times(clip, len(frames))
        chunks = adv2e.simulate(frames, instants, config, effects=effects, threads=threads)
        events = np.concatenate(list(chunks))
        return events, sha(events.tobytes())

    return run


# --- the command line ----------------------------------------------------------------------------


def npy(folder: Path) -> Path:
    path = folder / "stack.npy"
    np.save(path, grey())
    return path


def images(folder: Path) -> Path:
    """Write a folder of grey images as PGM, which numpy alone can write."""
    into = folder / "images"
    into.mkdir()
    for number, image in enumerate(grey(65535, ">u2")):
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
    pairs = zip(irregular_s(), sorted(into.iterdir()), strict=True)
    (into / "images.txt").write_text("".join(f"{t:.9f} {path.name}\n" for t, path in pairs))
    return into


COMMANDS: Mapping[str, tuple[Callable[[Path], Path], str]] = {
    "npy to txt": (npy, f"out.txt --fps 120 --set {LINEAR}"),
    "npy to h5": (npy, f"out.h5 --fps 120 --set {LINEAR}"),
    "video to h5 with frames": (video, "out.h5 --with-frames"),
    "video to txt, L 1": (video, "out.txt --set sampling.L=1"),
    "images to zip": (images, "out.zip --fps 30000/1001"),
    "recording to folder": (recording, "out -c davis240c --set sensor=null"),
    "recording to standard output": (
        recording, "- --start 0.05 --stop 0.2 --t0 zero --set seed=3",
    ),
    "own effect": (npy, f"out.txt --fps 120 --set {LINEAR} --effect everything.py"),
}  # fmt: skip
"""Writes an input, and what follows ``adv2e convert INPUT -o``."""


def conversion(make: Callable[[Path], Path], words: str) -> Run:
    """Return what converts, and reads the events and a digest of all that the output holds."""
    output, *options = words.split()

    def run(threads: int, folder: Path) -> tuple[Array, str]:
        import adv2e  # noqa: PLC0415

        (folder / "everything.py").write_text(OWN_EFFECT)
        command = [sys.executable, "-m", "adv2e", "convert", str(make(folder)), "-o", output]
        done = subprocess.run(
            [*command, "--threads", str(threads), "-q", *options],
            cwd=folder, check=False, capture_output=True,
            env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
        )  # fmt: skip
        if done.returncode:
            raise RuntimeError(done.stderr.decode().strip())
        out = folder / output
        if output == "-":
            out = folder / "out.txt"
            out.write_bytes(done.stdout)
        events = adv2e.read_events(out).events
        return events, sha(done.stdout) if output == "-" else sha(*_parts(out))

    return run


def _parts(out: Path) -> Iterator[bytes]:
    """Yield what an output holds, with names; not what is said about how it was made."""
    if out.suffix == ".h5":
        for name, array in sorted(arrays(out).items()):
            yield f"{name} {array.dtype}".encode() + array.tobytes()
        return
    if out.suffix == ".zip":
        with zipfile.ZipFile(out) as archive:
            files = {name: archive.read(name) for name in archive.namelist()}
    else:
        paths = [out] if out.is_file() else [path for path in out.rglob("*") if path.is_file()]
        files = {path.name: path.read_bytes() for path in paths}
    for name, data in sorted(files.items()):
        if not name.endswith(".json"):
            yield name.encode() + data


def arrays(path: Path) -> dict[str, Array]:
    """Return the datasets of an HDF5 file, by name."""
    import h5py  # noqa: PLC0415

    with h5py.File(path) as file:
        names: list[str] = []
        file.visit(names.append)
        return {name: file[name][()] for name in names if isinstance(file[name], h5py.Dataset)}


def cases() -> dict[str, Run]:
    """Return what runs each simulation, by name."""
    commands = {f"command {name}": conversion(*how) for name, how in COMMANDS.items()}
    return {**dict(in_memory()), **commands}
