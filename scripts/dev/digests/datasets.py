"""Data sets that ``adv2e export`` makes of a small recording, as they are read back.

Numbers, their types and their names count; how files are packed, and when, does not.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from dev.digests.event_files import recording, text
from dev.digests.running import Holds, done, sha, unversioned

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
    if path.suffix == ".npy":
        yield "", _bytes(np.load(path))
    elif path.suffix in (".h5", ".hdf5"):
        yield from _hdf5(path)
    elif path.suffix in (".png", ".jpg"):
        yield "", _bytes(cv2.imread(str(path), cv2.IMREAD_UNCHANGED))
    elif path.suffix == ".json":
        yield "", _told(path.read_text())
    else:
        yield "", path.read_bytes()


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
        found = json.loads(text)
    except ValueError:
        return text.encode()
    return json.dumps(unversioned(found), sort_keys=True).encode()


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


def cases() -> dict[str, Callable[[int, Path], Holds]]:
    """Return what makes each data set, by name."""
    return {
        f"dataset {name}": lambda threads, folder, words=words: exported(words, threads, folder)
        for name, words in EXPORTS.items()
    }
