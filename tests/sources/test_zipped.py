"""Zips of plain images, and those whose members would lie outside."""

from __future__ import annotations

import io
import json
import stat
import zipfile

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from adv2e.errors import DataError
from adv2e.sources import open_source


def png(value, shape=(5, 7)):
    return cv2.imencode(".png", np.full(shape, value, np.uint8))[1].tobytes()


def pack(path, members):
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in members.items():
            archive.writestr(name, data)
    return path


FRAMES = {f"f{n}.png": png(10 * n) for n in (1, 2, 9, 10)}


@pytest.fixture
def path(tmp_path):
    return tmp_path / "a.zip"


def values(source):
    return [int(frame.image[0, 0]) for frame in source.frames()]


@pytest.mark.parametrize("folder", ["", "frames/", "a/b c/d/"])
def test_images_in_natural_order_of_their_names(path, folder):
    hidden = {"__MACOSX/._f1.png": b"", f"{folder}._f2.png": b"", f"{folder}readme.md": "x"}
    members = {folder + name: FRAMES[name] for name in reversed(FRAMES)}
    source = open_source(pack(path, members | hidden), fps=100)
    assert values(source) == [10, 20, 90, 100]
    assert [frame.t_ns for frame in source.frames()] == [0, 10**7, 2 * 10**7, 3 * 10**7]
    assert (source.kind, source.count, source.has_clock) == ("images", 4, False)
    frames_missing = "frames are missing between f2.png and f9.png"
    assert any(frames_missing in doubt for doubt in source.doubts)


def test_without_times_the_message_says_what_to_give(path):
    with pytest.raises(DataError, match=r"a\.zip: no times .*--fps F.*one of images\.txt"):
        open_source(pack(path, FRAMES))


@pytest.mark.parametrize("place", ["frames/", ""])
@pytest.mark.parametrize("name", ["timestamps.txt", "info.txt"])
def test_a_list_in_the_folder_or_beside_it(path, place, name):
    lines = {
        "timestamps.txt": "0.1\n0.2\n0.3\n",
        "info.txt": "f1.png 100000\nf9.png 200000\nf2.png 300000\n",
    }
    frames = {"frames/" + n: FRAMES[n] for n in ("f1.png", "f2.png", "f9.png")}
    source = open_source(pack(path, frames | {place + name: lines[name]}))
    assert values(source) == ([10, 20, 90] if name == "timestamps.txt" else [10, 90, 20])
    assert [frame.t_ns for frame in source.frames()] == [10**8, 2 * 10**8, 3 * 10**8]
    assert source.notes[0].startswith(f"times from {path}: {place}{name}: ")


@pytest.mark.parametrize("top", ["", "MH_01_easy/"])
def test_the_list_of_a_data_set(path, top):
    lines = ["#timestamp [ns],filename", *(f"{n}00000000,{n}.png" for n in (1, 2, 3))]
    members = {f"{top}mav0/cam0/data/{n}.png": png(n) for n in (1, 2, 3)}
    members |= {f"{top}mav0/cam1/data/{n}.png": png(n) for n in (1, 2, 3)}
    members[f"{top}mav0/cam0/data.csv"] = "\n".join(lines)
    source = open_source(pack(path, members))
    assert (source.kind, values(source)) == ("euroc", [1, 2, 3])
    assert [frame.t_ns for frame in source.frames()] == [10**8, 2 * 10**8, 3 * 10**8]


@pytest.mark.parametrize("top", ["", "clip/"])
@pytest.mark.parametrize(
    ("below", "more", "kind", "encoding"),
    [
        ("", {}, "images", "srgb"),
        ("", {"events.txt": "0.001 1 1 1\n"}, "davis240c", "linear"),
        ("images/", {}, "davis240c", "linear"),
    ],
)
def test_a_folder_and_its_zip_have_the_same_light(tmp_path, top, below, more, kind, encoding):
    lines = "".join(f"{0.01 * n:.2f} {below}{name}\n" for n, name in enumerate(FRAMES))
    members = {below + name: data for name, data in FRAMES.items()}
    files = {"images.txt": lines, **members, **more}
    for name, data in files.items():
        file = tmp_path / "clip" / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(data if isinstance(data, bytes) else data.encode())
    packed = pack(tmp_path / "a.zip", {top + name: data for name, data in files.items()})
    for source in (open_source(tmp_path / "clip"), open_source(packed)):
        assert (source.kind, source.light.encoding) == (kind, encoding)
        assert values(source) == [10, 20, 90, 100]


def test_images_in_several_folders_are_named(path):
    with pytest.raises(DataError, match=r"a\.zip: images in more than one folder of it, a and b/c"):
        open_source(pack(path, {"a/1.png": png(1), "b/c/1.png": png(2)}), fps=10)


def test_no_images(path):
    with pytest.raises(DataError, match=r"a\.zip: no images\.txt in it, and no images \(png"):
        open_source(pack(path, {"readme.md": "x"}), fps=10)


@pytest.mark.parametrize(
    ("name", "wrong"),
    [
        ("../f3.png", "leads out of the archive by '..'"),
        ("a/../../f3.png", "leads out of the archive by '..'"),
        ("a\\..\\f3.png", "leads out of the archive by '..'"),
        ("/f3.png", "is absolute"),
        ("\\f3.png", "is absolute"),
        ("C:\\f3.png", "is absolute"),
    ],
)
def test_members_outside_are_refused(path, name, wrong):
    pack(path, FRAMES | {name: png(30)})
    with pytest.raises(DataError) as error:
        open_source(path, fps=10)
    assert str(error.value) == f"{path}: its member {name!r} {wrong}, must be a file below its root"


def test_links_are_refused(path):
    pack(path, FRAMES)
    link = zipfile.ZipInfo("f3.png")
    link.external_attr = (stat.S_IFLNK | 0o777) << 16
    with zipfile.ZipFile(path, "a") as archive:
        archive.writestr(link, "/etc/passwd")
    with pytest.raises(DataError, match=r"a\.zip: its member 'f3\.png' is a link"):
        open_source(path, fps=10)


def test_it_is_converted_and_told_of(adv2e, path, tmp_path):
    pack(path, FRAMES)
    assert adv2e("convert", path, "--fps", "10", "-o", tmp_path / "a.h5").status == 0
    report = json.loads(adv2e("info", path, "--fps", "10", "--json").out)
    assert (report["layout"], report["frames"]["count"]) == ("images", 4)
    status, _, told = adv2e("info", path)
    assert status == 1
    assert "no times of its frames are known" in told


def _whole():
    data = io.BytesIO()
    pack(data, FRAMES | {"timestamps.txt": "0.1\n0.2\n0.3\n0.4\n"})
    return data.getvalue()


WHOLE = _whole()


@settings(max_examples=200, deadline=None)
@given(
    st.lists(st.tuples(st.integers(0, len(WHOLE) - 1), st.integers(0, 255)), max_size=8),
    st.integers(len(WHOLE) // 2, len(WHOLE)),
)
def test_any_damage_gives_frames_or_an_error(tmp_path_factory, changes, end):
    data = bytearray(WHOLE)
    for at, value in changes:
        data[at] = value
    path = tmp_path_factory.getbasetemp() / "damaged.zip"
    path.write_bytes(data[: end if end % 2 else len(data)])
    try:
        frames = list(open_source(path, fps=10).frames())
    except DataError as error:
        assert "\n" not in str(error)
        return
    assert all(frame.image.nbytes <= 1 << 20 for frame in frames)
