"""Folders of data sets that have a list of their frames: TUM, EuRoC, UZH-FPV."""

from __future__ import annotations

import json

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from adv2e.errors import DataError, OutputError
from adv2e.files.states import check_distinct
from adv2e.sources import open_source
from adv2e.sources.times.lists import parse_list

TUM = ["1305031102.175304", "1305031102.211214", "1305031102.243211"]
EUROC = ["1403636579763555584", "1403636579813555456", "1403636579863555584"]
FPV = ["1540821839.8624", "1540821839.8957", "1540821839.9291"]


def write(path, number, colour=False):
    path.parent.mkdir(parents=True, exist_ok=True)
    image = np.full((6, 8, 3) if colour else (6, 8), 30 + 10 * number, np.uint8)
    assert cv2.imwrite(str(path), image)


def tum(root):
    for number, stamp in enumerate(TUM):
        write(root / "rgb" / f"{stamp}.png", number, colour=True)
        write(root / "depth" / f"{stamp}.png", number)
    for kind in ("rgb", "depth"):
        lines = ["# color images", "# file: 'rgbd_dataset_freiburg1_xyz.bag'"]
        lines += ["# timestamp filename", *(f"{t} {kind}/{t}.png" for t in TUM)]
        (root / f"{kind}.txt").write_text("\n".join(lines) + "\n")
    (root / "groundtruth.txt").write_text("# timestamp tx ty tz qx qy qz qw\n")
    return root


def euroc(root):
    lines = ["#timestamp [ns],filename", *(f"{t},{t}.png" for t in EUROC)]
    for camera in ("cam0", "cam1"):
        folder = root / "mav0" / camera
        for number, stamp in enumerate(EUROC):
            write(folder / "data" / f"{stamp}.png", number + (camera == "cam1"))
        (folder / "data.csv").write_text("\r\n".join(lines) + "\r\n")
        (folder / "sensor.yaml").write_text("sensor_type: camera\n")
    imu = root / "mav0" / "imu0"
    imu.mkdir()
    (imu / "data.csv").write_text("#timestamp [ns],w_x [rad s^-1]\n1403636579758555392,-0.09\n")
    return root


def fpv(root):
    for camera, side in enumerate(("left", "right")):
        lines = ["# id timestamp image_name"]
        for number, stamp in enumerate(FPV):
            write(root / "img" / f"image_{camera}_{number}.png", number)
            lines.append(f"{number} {stamp} img/image_{camera}_{number}.png")
        (root / f"{side}_images.txt").write_text("\n".join(lines) + "\n")
    return root


TUM_NS = [int(t.replace(".", "")) * 1000 for t in TUM]
EUROC_NS = [*map(int, EUROC)]
FPV_NS = [int(t.replace(".", "")) * 100_000 for t in FPV]

PLACES = {
    "TUM": (tum, "", "tum", TUM_NS),
    "TUM rgb": (tum, "rgb", "images", TUM_NS),
    "TUM depth": (tum, "depth", "images", TUM_NS),
    "EuRoC": (euroc, "", "euroc", EUROC_NS),
    "EuRoC mav0": (euroc, "mav0", "euroc", EUROC_NS),
    "EuRoC cam0": (euroc, "mav0/cam0", "euroc", EUROC_NS),
    "EuRoC cam1": (euroc, "mav0/cam1", "euroc", EUROC_NS),
    "EuRoC data": (euroc, "mav0/cam0/data", "images", EUROC_NS),
    "UZH-FPV": (fpv, "", "uzh-fpv", FPV_NS),
    "UZH-FPV img": (fpv, "img", "images", FPV_NS),
}


@pytest.mark.parametrize("place", PLACES)
def test_the_folder_alone_is_enough(tmp_path, place):
    make, below, kind, times_ns = PLACES[place]
    source = open_source(make(tmp_path / "set") / below)
    frames = list(source.frames())
    assert [frame.t_ns for frame in frames] == times_ns
    first = 30 + 10 * ("cam1" in place)
    assert [frame.image.ravel()[0] for frame in frames] == [first, first + 10, first + 20]
    assert (source.kind, source.has_clock, source.doubts) == (kind, True, [])
    coloured = place in ("TUM", "TUM rgb")
    assert (source.colour, source.encoding) == (coloured, "srgb")


def test_the_second_camera_is_named(tmp_path, adv2e):
    root = euroc(tmp_path / "set")
    other = root / "mav0" / "cam1"
    note = f"{root}: its first camera is taken; the second is {other}"
    assert note in open_source(root).notes
    report = json.loads(adv2e("info", root, "--json").out)
    assert report["layout"] == "euroc"
    assert note in report["notes"]
    assert open_source(other).notes == [f"times from {other / 'data.csv'}: time [ns], name"]


def test_the_right_camera_alone(tmp_path):
    root = fpv(tmp_path / "set")
    (root / "left_images.txt").unlink()
    (frame, *_) = open_source(root).frames()
    assert frame.label.endswith("image_1_0.png")


def test_given_times_win_and_a_note_says_so(tmp_path):
    root = tum(tmp_path / "set")
    source = open_source(root, fps=10)
    assert [frame.t_ns for frame in source.frames()] == [0, 100_000_000, 200_000_000]
    assert source.notes == [f"--fps 10 replaces the times in {root / 'rgb.txt'}"]


def test_a_listed_image_that_is_missing_is_named_by_line(tmp_path):
    root = euroc(tmp_path / "set")
    (root / "mav0" / "cam0" / "data" / f"{EUROC[2]}.png").unlink()
    with pytest.raises(DataError, match=rf"data\.csv line 4: no image {EUROC[2]}\.png"):
        open_source(root)


def test_one_picture_for_two_names(tmp_path):
    root = euroc(tmp_path / "set") / "mav0" / "cam0"
    lines = [f"{EUROC[0]},{EUROC[0]}.png", f"{EUROC[1]},data/{EUROC[0]}.png"]
    (root / "data.csv").write_text("\n".join(lines) + "\n")
    with pytest.raises(DataError, match=r"data\.csv line 2: .*is the same picture as"):
        open_source(root)


def test_a_table_of_another_kind_is_left_alone(tmp_path, write_images, picture):
    folder = write_images([picture(0), picture(1)])
    for text in ("a,b,c\n1,2,3\n4,5,6\n", "", "\0", "1,x.png\n2,y.png\n"):
        (folder / "data.csv").write_text(text)
        source = open_source(folder, fps=10)
        assert (source.kind, source.count) == ("images", 2)


@pytest.mark.parametrize(
    ("make", "name", "image"),
    [
        (tum, "rgb.txt", f"rgb/{TUM[1]}.png"),
        (euroc, "mav0/cam0/data.csv", f"mav0/cam0/data/{EUROC[1]}.png"),
        (fpv, "left_images.txt", "img/image_0_1.png"),
    ],
)
def test_what_is_read_is_not_written_over_and_all_else_may_be(tmp_path, make, name, image):
    inputs = open_source(make(tmp_path)).inputs
    for read in (name, image):
        with pytest.raises(OutputError, match=r"is read and would be lost"):
            check_distinct(tmp_path / read, inputs)
    for other in ("groundtruth.txt", "preview.png", "depth.txt"):
        (tmp_path / other).touch()
        check_distinct(tmp_path / other, inputs)


PIECES = st.sampled_from(
    [
        *(
            "#",
            "%",
            ",",
            ";",
            "\t",
            " ",
            "\n",
            "\r",
            "'",
            '"',
            "timestamp",
            "filename",
            "[ns]",
            "id",
        ),
        *("0.1", "-3", "1e9", "1e999", "1403636579763555584", "nan", "a.png", "../b/c.png", "\\"),
    ]
)


@settings(max_examples=200, deadline=None)
@given(st.one_of(st.text(), st.lists(PIECES, max_size=60).map("".join)))
@pytest.mark.thorough
def test_any_text_is_a_list_or_an_error(text):
    try:
        found = parse_list(text, "t.txt")
    except DataError as error:
        assert "\n" not in str(error)
        return
    assert found.stamps
    assert [stamp.t_ns for stamp in found.stamps] == sorted(stamp.t_ns for stamp in found.stamps)
