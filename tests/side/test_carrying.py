"""Side data of whole sequences, through convert, export and batch, and what is told of the rest."""

import json
import shutil
import zipfile
from contextlib import nullcontext

import cv2
import numpy as np
import pytest
from sequences import BEGIN_NS, LINEAR, STEP_NS, WIDTH, plain, write_frames

from adv2e import batch, convert, export
from adv2e.errors import DataError, OutputError, UsageError

CONFIG = ["ideal", LINEAR]
IMU = "# timestamp [ns], w_x, w_y, w_z, a_x, a_y, a_z\n" + "".join(
    f"{BEGIN_NS + n * 1_000_000},1,2,3,4,5,{n}\n" for n in range(-3, 60)
)
POSES = "# t[ns] tx ty tz qx qy qz qw\n" + f"{BEGIN_NS + STEP_NS} 1 2 3 0 0 0 1\n"
SENSOR = "resolution: [96, 64]\nintrinsics: [80, 81, 47.5, 31.5]\n"


@pytest.fixture
def euroc(tmp_path):
    """A sequence as EuRoC has it, in ``mav0``."""
    mav0 = tmp_path / "V1" / "mav0"
    write_frames(mav0)
    (mav0 / "cam0" / "sensor.yaml").write_text(SENSOR)
    for name, text in (("imu0", IMU), ("state_groundtruth_estimate0", POSES)):
        (mav0 / name).mkdir()
        (mav0 / name / "data.csv").write_text(text)
    return mav0.parent


def converted(source, output, config=(*CONFIG,), **options):
    """Convert, and return what is told, doubts first; tests fail for doubts that they do not ask.

    Doubts are warnings.
    """
    asked = pytest.warns() if options.pop("doubts", False) else nullcontext(())
    with asked as doubts:
        notes = convert(source, output, config or None, overwrite=True, **options).notes
    return [*(str(one.message) for one in doubts), *notes]


def carried(lines):
    return [line for line in lines if line.startswith("side data carried")]


FILES = {"groundtruth.txt", "imu.txt", "calib.txt", "sensor.yaml"}


@pytest.mark.parametrize("inside", ["", "mav0", "mav0/cam0", "mav0/cam0/data"])
def test_a_sequence_is_found_from_any_of_its_folders(euroc, inside, tmp_path):
    told_of = carried(converted(euroc / inside, tmp_path / "out.h5"))
    assert len(told_of) == 1
    assert all(kind in told_of[0] for kind in ("poses", "imu", "calibration"))
    made = {file.name for file in (tmp_path / "out.h5.side").iterdir()}
    assert made == FILES | {"side.json"}
    times, values = plain((tmp_path / "out.h5.side" / "imu.txt").read_text())
    known = np.array([line.split(",") for line in IMU.splitlines()[1:]])
    assert times.tolist() == known[:, 0].astype(np.int64).tolist()
    assert values.tolist() == known[:, [4, 5, 6, 1, 2, 3]].tolist()


def test_a_zip_of_a_sequence_is_as_its_folder(euroc, tmp_path):
    archive = shutil.make_archive(str(tmp_path / "V1"), "zip", tmp_path, "V1")
    converted(archive, tmp_path / "a.zip")
    converted(euroc, tmp_path / "b.zip")
    with zipfile.ZipFile(tmp_path / "a.zip") as a, zipfile.ZipFile(tmp_path / "b.zip") as b:
        assert set(a.namelist()) >= FILES
        assert all(a.read(name) == b.read(name) for name in FILES)


def test_a_recording_keeps_its_side_data_when_it_is_copied_and_exported(euroc, tmp_path):
    converted(euroc, tmp_path / "out.zip")
    converted(tmp_path / "out.zip", tmp_path / "b.npz", (), take="events", crop=(8, 4, 60, 40))
    converted(tmp_path / "b.npz", tmp_path / "c", (), start_s=0.005, t0="zero", rotate180=True)
    export(tmp_path / "c", tmp_path / "exported", "voxel", window_us=10_000)
    intrinsics = np.loadtxt(tmp_path / "exported/side/c/calib.txt")
    assert intrinsics[:4] == pytest.approx([80, 81, 59 - 39.5, 39 - 27.5])
    first, _ = plain((tmp_path / "b.npz.side" / "imu.txt").read_text())
    assert first[0] == BEGIN_NS - 3_000_000
    times, values = plain((tmp_path / "exported/side/c/imu.txt").read_text())
    stamps, _ = plain((tmp_path / "c" / "events.txt").read_text())
    assert stamps[0] >= 0
    assert 0 <= times[0] < 1_000_000
    assert values[0, 5] == "3"
    assert np.all(np.diff(times) == 1_000_000)
    told_of = json.loads((tmp_path / "exported" / "export.json").read_text())
    assert "side" in told_of["entries"]


def test_a_batch_carries_them_and_sees_that_they_changed(euroc, tmp_path):
    dest = tmp_path / "events"
    source = euroc.parent
    how = {"sets": ["frames.encoding=linear"], "export": "voxel", "window_us": 10_000}
    done = batch(source, dest, "ideal", jobs=1, **how)
    assert (done.made, done.failed) == (1, {})
    (side,) = dest.rglob("*.side")
    assert {file.name for file in side.iterdir()} == FILES | {"side.json"}
    assert len(list(dest.rglob("*.voxel/side/*/imu.txt"))) == 1
    assert batch(source, dest, "ideal", jobs=1, **how).kept == 1
    (side / "imu.txt").write_text("")
    assert batch(source, dest, "ideal", jobs=1, **how).tasks[0].why.startswith("a file beside")
    imu = euroc / "mav0" / "imu0" / "data.csv"
    imu.write_text(IMU.replace(",1,2,3,", ",7,2,3,"))
    assert batch(source, dest, "ideal", jobs=1, **how).tasks[0].why == "its side data changed"
    assert " 7 2 3" in (side / "imu.txt").read_text()


def test_none_are_carried_if_none_are_wanted(euroc, tmp_path):
    assert carried(converted(euroc, tmp_path / "out", side="none")) == []
    assert not FILES & {file.name for file in (tmp_path / "out").iterdir()}
    batch(euroc.parent, tmp_path / "dest", "ideal", side="none", sets=["frames.encoding=linear"])
    assert not list((tmp_path / "dest").rglob("*.side"))


def test_a_folder_that_is_named_counts(euroc, tmp_path):
    given = tmp_path / "mine"
    given.mkdir()
    (given / "imu.txt").write_text("0.5 1 2 3 4 5 6\n")
    clip = tmp_path / "clip.npy"
    np.save(clip, np.zeros((3, 8, 8), np.uint8) + np.arange(3, dtype=np.uint8)[:, None, None] * 90)
    for output, how in (("a.h5", {"side": given}), ("b.h5", {})):
        if not how:
            given.rename(tmp_path / "clip.npy.side")
        converted(clip, tmp_path / output, fps=10, **how)
        made = tmp_path / f"{output}.side" / "imu.txt"
        assert made.read_text() == "0.500000000 1 2 3 4 5 6\n"


def test_what_cannot_be_carried_is_named_and_the_rest_is(euroc, tmp_path):
    mav0 = euroc / "mav0"
    (mav0 / "leica0").mkdir()
    (mav0 / "body.yaml").write_text("comment: a\n")
    (mav0 / "imu0" / "data.csv").write_text("1 2\n")
    (euroc / "masks").mkdir()
    cv2.imwrite(str(euroc / "masks" / "a.png"), np.zeros((64, WIDTH), np.uint8))
    lines = converted(euroc, tmp_path / "out.h5", doubts=True)
    assert f"{euroc}: not carried: mav0/body.yaml, mav0/imu0, mav0/leica0" in lines
    assert any("imu0/data.csv: 2 columns that no heading tells" in line for line in lines)
    assert any("masks: 1 files for 6 frames, and " in line for line in lines)
    (line,) = carried(lines)
    assert "masks" not in line
    side = tmp_path / "out.h5.side"
    assert (side / "groundtruth.txt").is_file()
    assert not (side / "imu.txt").exists()


def test_what_was_named_and_is_wrong_is_an_error(euroc, tmp_path):
    given = tmp_path / "mine"
    with pytest.raises(DataError, match="no such folder or zip"):
        converted(euroc, tmp_path / "a.h5", side=given)
    given.mkdir()
    with pytest.raises(DataError, match="no side data in it that is known, such as groundtruth"):
        converted(euroc, tmp_path / "a.h5", side=given)
    (given / "imu.txt").write_text("1 2\n")
    with pytest.raises(DataError, match=r"imu\.txt: 2 columns"):
        converted(euroc, tmp_path / "a.h5", side=given)
    with pytest.raises(UsageError, match="of one recording"):
        export(["a.h5", "b.h5"], tmp_path / "c", "voxel", count=2, side=given)
    assert not list(tmp_path.glob("a.h5*"))


def test_side_data_of_others_are_neither_lost_nor_taken_for_these(euroc, tmp_path):
    side = tmp_path / "out.h5.side"
    side.mkdir()
    (side / "mine.txt").write_text("a")
    with pytest.raises(OutputError, match=r"holds mine\.txt, which would be lost"):
        converted(euroc, tmp_path / "out.h5")
    with pytest.raises(OutputError, match="would be taken for the side data of these events"):
        converted(euroc, tmp_path / "out.h5", side="none")
    shutil.rmtree(side)
    converted(euroc, tmp_path / "out")
    converted(euroc, tmp_path / "out")  # it may be replaced, as all in it is ours
    (tmp_path / "out" / "notes.txt").write_text("a")
    with pytest.raises(OutputError, match=r"holds notes\.txt"):
        converted(euroc, tmp_path / "out")
