"""Layouts in by trainers' folders out: each cell is the same to the byte, whatever is exported."""

import h5py
import numpy as np
import pytest
from test_trainers_folders import TIMES_US, record

from adv2e import convert, export
from adv2e.errors import DataError
from adv2e.formats.registry import FORMATS
from adv2e.options import EXPORTS as KINDS

SIZE = 240, 180
READ = [found for found in FORMATS if found.reader and found.writer]
LABELLED = ("spikingjelly", "nmnist")
OPTIONS = {
    kind: {"window_us": 50_000} for kind in ("voxel", "histogram", "surface", "picture", "rvt")
}
NEED_IMAGES = ("e2vid", "ev-segnet")


@pytest.fixture(scope="session")
def recordings(tmp_path_factory):
    """A recording in the first layout, with its boxes and its flow beside it."""
    root = tmp_path_factory.mktemp("layouts")
    source = root / "source" / "train" / "cat" / "one.h5"
    record(source, size=SIZE)
    side = source.with_name("one.h5.side")
    side.mkdir()
    names = [f"flow/{n}.npy" for n in range(len(TIMES_US) - 1)]
    (side / "flow").mkdir()
    for n, name in enumerate(names):
        np.save(side / name, np.full((*SIZE[::-1], 2), n + 0.5, np.float32))
    spans = zip(TIMES_US, TIMES_US[1:], names, strict=False)
    lines = [f"{a / 1e6:.9f} {b / 1e6:.9f} {name}\n" for a, b, name in spans]
    (side / "flow.txt").write_text("".join(lines))
    fields = [("t", "<i8"), *((name, "<f4") for name in "xywh"), ("class_id", "<u4")]
    np.save(side / "boxes_bbox.npy", np.array([(100_000, 30, 40, 100, 80, 0)], fields))
    return root, source


def content(path):
    """Return what a file holds: of HDF5, its datasets, as attributes name the source."""
    if path.suffix != ".h5":
        return path.read_bytes()
    held = {}
    with h5py.File(path) as file:
        file.visititems(
            lambda name, each: (
                held.update({name: (each.dtype.str, each.shape, each[()].tobytes())})
                if isinstance(each, h5py.Dataset)
                else None
            )
        )
    return held


def exported(source, folder, kind):
    """Export, and return what lies there by its path, but for lists that name the folder."""
    of = source.parents[2] if kind in LABELLED else source
    export(of, folder, kind, doubt=lambda line: None, **OPTIONS.get(kind, {}))
    return {
        path.relative_to(folder).as_posix(): content(path)
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.name not in ("export.json", "train.txt", "valid.txt")
    }


@pytest.fixture(scope="session")
def expected(recordings):
    root, source = recordings
    return {kind: exported(source, root / "expected" / kind, kind) for kind in KINDS}


@pytest.mark.thorough
@pytest.mark.parametrize("found", READ, ids=lambda found: found.name)
def test_every_layout_gives_every_folder(found, recordings, expected, tmp_path):
    _, source = recordings
    suffix = found.suffixes[0]
    path = tmp_path / "source" / "train" / "cat" / f"one{suffix}"
    path.parent.mkdir(parents=True)
    frames = "w" in found.frames
    layout = {"layout": found.name} if found.is_hdf5 else {"format": found.name}
    convert(source, path, take="events", with_frames=frames, **layout)
    for kind in KINDS:
        if kind in NEED_IMAGES and not frames:
            with pytest.raises(DataError, match="one"):
                exported(path, tmp_path / kind, kind)
            continue
        made = exported(path, tmp_path / kind, kind)
        if kind in ("evreal", "dsec") and not frames:
            images = {name for name in expected[kind] if "image" in name or "flow" in name}
            assert made.keys() >= expected[kind].keys() - images
            made = {name: data for name, data in made.items() if name not in images}
        assert {name for name in made if made[name] != expected[kind].get(name)} == set(), kind
