"""Digests of what ``info``, ``export`` and ``diagnose`` make of small inputs.

Numbers, names and texts count.  Versions of programs do not, nor how files are packed, nor when.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from dev.digests.damaged import DAMAGED
from dev.digests.event_files import EVENT_FILES, recording, text
from dev.digests.pictures import PICTURES, Make
from dev.digests.running import Holds, done, run, sha, short, unversioned
from dev.digests.simulations import LINEAR, scene

Cases = dict[str, Callable[[int, Path], Holds]]
"""What runs each case with so many threads in a folder, by name."""

OF_LIBRARIES = re.compile(r"(?<=that can be read, or damaged: ).*")
"""The end of an error that a library words."""


def told(words: str, make: Make, threads: int, folder: Path) -> Holds:
    """Return what is told of an input, or its error."""
    name, *options = words.split()
    make(folder / name)
    status, out, err = run(folder, "info", name, "--json", *options)
    holds = short(json.loads(out)) if status == 0 else {"status": status}
    return holds | ({"stderr": OF_LIBRARIES.sub("...", err)} if err else {})


def information() -> Cases:
    inputs = {**PICTURES, **EVENT_FILES, **DAMAGED}
    return {f"info {words}": partial(told, words, make) for words, make in inputs.items()}


# --- data sets -----------------------------------------------------------------------------------

EXPORTS: Mapping[str, str] = {
    "voxel, windows of time": "one --to voxel --window 20ms",
    "voxel, windows of events": "one --to voxel --count 700 --bins 3",
    "voxel, images": "one --to voxel --at images --polarity split",
    "voxel, whole windows": "one --to voxel --window 15ms --span window",
    "voxel, e2vid": "one --to voxel --window 33ms --normalise e2vid",
    "voxel, event_cnn_minimal": "one two --to voxel --window 33ms --normalise event_cnn_minimal",
    "voxel, text": "plain.txt --to voxel --window 40ms --size 64x40",
    "e2vid, one": "one --to e2vid --valid 0.4",
    "e2vid, two": "one two --to e2vid",
    "ev-segnet": "one --to ev-segnet",
    "ev-segnet, counts": "one --to ev-segnet --counts raw --window 20ms --split test --rows 30",
}
"""Words that follow ``adv2e export``, by the name of a case."""


def content(path: Path) -> Iterator[tuple[str, bytes]]:
    """Yield what a file holds, in parts with a name."""
    if path.suffix in (".h5", ".hdf5"):
        yield from _hdf5(path)
    elif path.suffix == ".npy":
        yield "", _bytes(np.load(path))
    elif path.suffix in (".png", ".jpg"):
        yield "", _bytes(cv2.imread(str(path), cv2.IMREAD_UNCHANGED))
    else:
        yield "", _told(path.read_text()) if path.suffix == ".json" else path.read_bytes()


def _hdf5(path: Path) -> Iterator[tuple[str, bytes]]:
    import h5py  # noqa: PLC0415

    with h5py.File(path) as file:
        names = [""]
        file.visit(names.append)
        for name in names:
            item = file[name or "/"]
            for key, value in sorted(item.attrs.items()):
                yield f"{name}@{key}", _told(value) if isinstance(value, str) else _bytes(value)
            if isinstance(item, h5py.Dataset):
                yield name, _bytes(item[()])


def _bytes(values: Any) -> bytes:
    array = np.asarray(values)
    return f"{array.dtype} {array.shape}".encode() + array.tobytes()


def _told(text: str) -> bytes:
    """Return a description without the versions of programs; any other text as it is."""
    try:
        return json.dumps(unversioned(json.loads(text)), sort_keys=True).encode()
    except ValueError:
        return text.encode()


def exported(words: str, threads: int, folder: Path) -> Holds:
    """Return a digest of each file of an export, and of each part of an HDF5 file."""
    recording(folder / "one")
    recording(folder / "two", turn=True)
    text(folder / "plain.txt")
    done(folder, "export", *words.split(), "-o", "out", "--threads", str(threads), "-q")
    here = str(folder).encode()  # lists of files hold whole paths
    return {
        f"{path.relative_to(folder).as_posix()} {name}".strip(): sha(data.replace(here, b"."))[:16]
        for path in sorted((folder / "out").rglob("*")) if path.is_file()
        for name, data in content(path)
    }  # fmt: skip


def datasets() -> Cases:
    return {f"dataset {name}": partial(exported, words) for name, words in EXPORTS.items()}


# --- reports -------------------------------------------------------------------------------------

HIDDEN: Mapping[str, tuple[str, ...]] = {
    "nothing": (),
    "dead time": ("--set", "pixel.refractory.period_us=20000"),
}
"""Effects of a recording that nobody declares."""

WITHOUT = """
thresholds initial_reference threshold_mismatch threshold_drift low_pass dark_current
source_follower high_pass slew_limit photoreceptor_noise reset_overshoot leak photo_leak shot_noise
hot_pixels dead_pixels frame_coupling readout double_read timestamp_tick black_level exposure_blur
clock_offset clock_drift misregistration flicker frame_encoding
"""
"""All effects but refractory and event_loss: all take minutes."""

DECLARED = ("--set", LINEAR, "--set", "sampling.L=1")


def reported(hidden: tuple[str, ...], threads: int, folder: Path) -> Holds:
    """Return the report of a recording, in its short form, without the time that it took."""
    light = scene(rows=12, columns=16, count=60)
    np.save(folder / "clip.npy", np.round(65535 * light).astype(np.uint16))
    made = ("-o", "recording.zip", "--fps", "300", "--seed", "5", "-q")
    done(folder, "convert", "clip.npy", *made, *DECLARED, *hidden)
    without = [word for name in WITHOUT.split() for word in ("--without", name)]
    words = ("-o", "report", "--threads", str(threads), "-q")
    done(folder, "diagnose", "recording.zip", *words, *DECLARED, *without)
    found = json.loads((folder / "report" / "report.json").read_text())
    del found["facts"]["time taken"]
    return short(found)


def reports() -> Cases:
    return {f"report {name}": partial(reported, hidden) for name, hidden in HIDDEN.items()}
