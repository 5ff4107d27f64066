import csv
import json
import zipfile

import cv2
import numpy as np
import pytest

from adv2e.errors import OutputError
from adv2e.events import empty_events, make_events
from adv2e.formats.writing import open_sink

EPOCH_NS = 1_468_941_032_229_165_635
EVENTS = make_events([0, 1_500_000], [0, 239], [179, 0], [1, 0])
LINES = b"0.000000000 0 179 1\n1.500000000 239 0 0\n"


def grey(dtype=np.uint8):
    scale = 1 if dtype == np.uint8 else 257
    return (np.arange(180 * 240).reshape(180, 240) % 256 * scale).astype(dtype)


def colour():
    image = np.zeros((180, 240, 3), np.uint8)
    image[0, 0] = (10, 20, 30)
    return image


def write(path, frames=(), events=EVENTS, **options):
    with open_sink(path, width=240, height=180, metadata={"adv2e": "9", "seed": 3}, **options) as s:
        for t_ns, image in frames:
            s.write_frame(t_ns, image)
        s.write_events(events)


@pytest.fixture(params=["folder", "zip"])
def written(request, tmp_path):
    """Write, and return the files by name."""

    def files(frames=(), **options):
        if request.param == "folder":
            write(tmp_path / "out", frames, **options)
            found = [file for file in (tmp_path / "out").rglob("*") if file.is_file()]
            return {str(f.relative_to(tmp_path / "out")): f.read_bytes() for f in found}
        write(tmp_path / "out.zip", frames, **options)
        with zipfile.ZipFile(tmp_path / "out.zip") as archive:
            assert archive.testzip() is None
            return {name: archive.read(name) for name in archive.namelist()}

    return files


def decode(data):
    return cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)


def test_events_alone(written):
    files = written()

    assert sorted(files) == ["adv2e.json", "events.txt", "images.txt"]
    assert files["events.txt"] == LINES
    assert files["images.txt"] == b""
    assert json.loads(files["adv2e.json"]) == {"adv2e": "9", "width": 240, "height": 180, "seed": 3}


def test_frames_are_counted_from_zero_and_listed_with_their_times(written):
    files = written([(0, grey()), (38_766_001, grey())], with_frames=True)

    assert files["images.txt"] == (
        b"0.000000000 images/frame_00000000.png\n0.038766001 images/frame_00000001.png\n"
    )
    assert {name for name in files if name.startswith("images/")} == {
        "images/frame_00000000.png",
        "images/frame_00000001.png",
    }


def test_epoch_and_negative_times_of_frames_keep_every_digit(written):
    files = written([(-1, grey()), (EPOCH_NS, grey())], with_frames=True, events=empty_events())

    lines = list(csv.reader(files["images.txt"].decode().splitlines(), delimiter=" "))
    assert [line[0] for line in lines] == ["-0.000000001", "1468941032.229165635"]


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_grey_frames_keep_their_bits(written, dtype):
    files = written([(0, grey(dtype))], with_frames=True)

    image = decode(files["images/frame_00000000.png"])
    assert image.dtype == dtype
    assert np.array_equal(image, grey(dtype))


def test_colour_frames_keep_their_channels(written):
    files = written([(0, colour())], with_frames=True)

    assert decode(files["images/frame_00000000.png"])[0, 0].tolist() == [30, 20, 10]  # BGR


def test_frame_may_be_reused_by_its_owner(written):
    class Changing:
        def __iter__(self):
            image = grey()
            for k in range(20):
                image[...] = k
                yield k, image

    files = written(Changing(), with_frames=True)

    for k in range(20):
        assert np.all(decode(files[f"images/frame_{k:08d}.png"]) == k)


def test_archive_says_nothing_of_the_day_and_is_readable_by_all(tmp_path):
    write(tmp_path / "out.zip", [(0, grey())], with_frames=True)

    with zipfile.ZipFile(tmp_path / "out.zip") as archive:
        for member in archive.infolist():
            assert member.date_time == (1980, 1, 1, 0, 0, 0)
            assert member.external_attr >> 16 == 0o644
        assert archive.getinfo("events.txt").compress_type == zipfile.ZIP_DEFLATED


def test_archive_holds_more_text_than_a_block(tmp_path):
    events = make_events(
        np.arange(120_000), np.full(120_000, 7), np.full(120_000, 8), np.ones(120_000)
    )
    write(tmp_path / "out.zip", events=events)
    write(tmp_path / "out", events=events)

    with zipfile.ZipFile(tmp_path / "out.zip") as archive:
        assert archive.read("events.txt") == (tmp_path / "out" / "events.txt").read_bytes()


@pytest.mark.parametrize("name", ["calib.txt", "images/cat.png", "thesis/draft.tex"])
def test_folder_with_files_of_others_is_not_replaced(tmp_path, name):
    write(tmp_path / "out", [(0, grey())], with_frames=True)
    (tmp_path / "out" / name).parent.mkdir(exist_ok=True)
    (tmp_path / "out" / name).write_text("precious")

    with pytest.raises(
        OutputError, match=f"out: holds {name.split('/dr')[0]}, which would be lost"
    ):
        write(tmp_path / "out", overwrite=True)
    assert (tmp_path / "out" / name).read_text() == "precious"
