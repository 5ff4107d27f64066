"""Archives that are damaged, or that state far more than they hold."""

import io
import zipfile

import cv2
import numpy as np
import pytest

from adv2e.errors import DataError
from adv2e.formats.reading import read_events
from adv2e.inspection.inspect import info
from adv2e.sources import open_source

HUGE = 300 << 20


def png(value):
    return cv2.imencode(".png", np.full((4, 5), value, np.uint8))[1].tobytes()


def archive(path, without=(), **more):
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as made:
        content = {
            "events.txt": "0.0 1 1 1\n0.1 2 2 0\n",
            "images.txt": "0.0 images/a.png\n0.1 images/b.png\n",
            "images/a.png": png(10), "images/b.png": png(90),
        }  # fmt: skip
        for name, data in (content | more).items():
            if name not in without:
                made.writestr(name, data)
    return path


def bomb(path, name, before=b""):
    """A good archive with one member of 300 MiB that takes 300 KiB."""
    archive(path, without=(name,))
    with zipfile.ZipFile(path, "a", zipfile.ZIP_DEFLATED) as made, made.open(name, "w") as member:
        member.write(before)
        for _ in range(HUGE >> 20):
            member.write(bytes(1 << 20))
    return path


@pytest.mark.parametrize("name", ["events.txt", "images.txt", "images/a.png", "adv2e.json"])
@pytest.mark.quick_cases(1)
def test_a_member_that_fills_the_memory(tmp_path, name):
    path = bomb(tmp_path / "a.zip", name)
    assert path.stat().st_size < 1 << 20
    with pytest.raises(DataError, match=rf"a\.zip: {name}: states 314,572,800 bytes"):
        list(read_events(path).images())
    if name.startswith("images"):
        with pytest.raises(DataError, match=rf"a\.zip: {name}: states 314,572,800 bytes"):
            list(open_source(path).frames())


@pytest.mark.thorough
def test_an_array_that_fills_the_memory(tmp_path):
    path = tmp_path / "a.npz"
    np.savez_compressed(path, x=[1], y=[1], p=[1], t=np.zeros(HUGE >> 3))
    with pytest.raises(DataError, match=r"a\.npz: t\.npy: states 314,572,928 bytes"):
        read_events(path)


def test_an_array_that_is_not_there(tmp_path):
    file = io.BytesIO()
    np.lib.format.write_array_header_1_0(
        file, {"descr": "<f8", "fortran_order": False, "shape": (10**12,)}
    )
    np.savez(tmp_path / "a.npz", x=[1], y=[1], p=[1])
    with zipfile.ZipFile(tmp_path / "a.npz", "a") as made:
        made.writestr("t.npy", file.getvalue())
    with pytest.raises(DataError, match=r"a\.npz: t: cut short: it holds 0 bytes"):
        read_events(tmp_path / "a.npz")


@pytest.mark.parametrize("part", [0.0, 0.02, 0.3, 0.6, 0.9, 0.99])
@pytest.mark.parametrize("kind", ["zip", "npz"])
def test_archives_cut_short(tmp_path, part, kind):
    path = tmp_path / f"a.{kind}"
    if kind == "zip":
        archive(path)
    else:
        np.savez_compressed(path, t_us=[1, 2], x=[1, 1], y=[1, 1], p=[1, 0])
    path.write_bytes(path.read_bytes()[: int(part * path.stat().st_size)])
    for read in (read_events, info, open_source):
        with pytest.raises(DataError, match=rf"a\.{kind}"):
            read(path)


def test_an_archive_cut_short_after_it_was_opened(tmp_path):
    path = tmp_path / "a.zip"
    noise = np.random.default_rng(0).integers(0, 255, (2, 200, 300), np.uint8)
    lines = {"events.txt": "0.0 1 1 1\n", "images.txt": "0.0 images/0.png\n0.1 images/1.png\n"}
    with zipfile.ZipFile(path, "w") as made:
        for name, data in lines.items():
            made.writestr(name, data)
        for n in range(2):
            made.writestr(f"images/{n}.png", cv2.imencode(".png", noise[n])[1].tobytes())
    recording, source = read_events(path), open_source(path)
    with path.open("r+b") as file:
        file.truncate(80_000)
    with pytest.raises(DataError, match=r"a\.zip"):
        list(recording.images())
    with pytest.raises(DataError, match=r"a\.zip"):
        list(source.frames())
