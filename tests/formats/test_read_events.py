import zipfile

import cv2
import h5py
import numpy as np
import pytest

from adv2e.errors import DataError
from adv2e.formats.reading import read_events

EVENTS = "0.1 0 0 1\n0.2 2 1 0\n"


def png(value, shape=(2, 3)):
    done, data = cv2.imencode(".png", np.full(shape, value, np.uint8))
    assert done
    return data.tobytes()


def recording_files():
    return {
        "events.txt": EVENTS.encode(),
        # out of order, as in some recordings
        "images.txt": b"0.2 images/b.png\n0.1 images/a.png\n",
        "images/a.png": png(1),
        "images/b.png": png(2),
        "calib.txt": b"1 2 3\n",
    }


def write_folder(path, files):
    for name, data in files.items():
        (path / name).parent.mkdir(parents=True, exist_ok=True)
        (path / name).write_bytes(data)
    return path


def write_zip(path, files, top=""):
    with zipfile.ZipFile(path, "w") as archive:
        for name, data in files.items():
            archive.writestr(top + name, data)
    return path


@pytest.fixture(params=["folder", "zip", "zip with a folder"])
def davis(request, tmp_path):
    """Write files as a recording; return its path."""

    def write(files):
        if request.param == "folder":
            return write_folder(tmp_path / "rec", files)
        top = "rec/" if request.param == "zip with a folder" else ""
        return write_zip(tmp_path / "rec.zip", files, top)

    return write


def error_of(path):
    with pytest.raises(DataError) as info:
        list(read_events(path).frames())
    assert str(info.value).startswith(str(path))
    assert "\n" not in str(info.value)
    return str(info.value)


def test_davis240c_recording(davis):
    recording = read_events(davis(recording_files()))

    assert recording.layout == "davis240c"
    assert recording.events.tolist() == [(100_000, 0, 0, 1), (200_000, 2, 1, 0)]
    assert recording.frame_times_ns.tolist() == [100_000_000, 200_000_000]
    assert [frame.image[0, 0] for frame in recording.frames()] == [1, 2]
    sorted_too = "images.txt: line 2 is earlier than one before it: sorted by time"
    assert recording.problems == [sorted_too]


def test_geometry_of_davis240c_is_that_of_its_images(davis):
    recording = read_events(davis({**recording_files(), "events.txt": b"0.1 0 0 1\n"}))

    assert (recording.width, recording.height) == (3, 2)


def test_davis240c_without_images(davis):
    recording = read_events(davis({"events.txt": EVENTS.encode()}))

    assert recording.frame_times_ns is None
    assert (recording.width, recording.height) == (3, 2)
    assert recording.problems == ["no geometry stated: 3x2 from the largest coordinates"]


def test_listed_image_that_is_missing_is_named_with_its_line(davis):
    files = recording_files()
    del files["images/a.png"]

    assert "images.txt line 2: no image images/a.png" in error_of(davis(files))


@pytest.mark.parametrize(
    ("late", "unit_ns", "told"), [(40_000, 1000, "us"), (40, 10**6, "ms"), (1, 10**9, "s")]
)
def test_whole_times_of_frames_are_told_with_their_unit(davis, late, unit_ns, told):
    listed = f"{late} images/b.png\n0 images/a.png\n".encode()
    recording = read_events(davis({**recording_files(), "images.txt": listed}))
    assert recording.frame_times_ns.tolist() == [0, late * unit_ns]
    problems = [one for one in recording.problems if one.startswith("images.txt")]
    assert f"are taken as {told} (" in problems[0]
    assert problems[1:] == ["images.txt: line 2 is earlier than one before it: sorted by time"]


def test_image_that_is_none_is_named(davis):
    assert "images/b.png" in error_of(davis({**recording_files(), "images/b.png": b"no png"}))


def test_line_of_the_list_without_a_name_is_refused(davis):
    assert "images.txt line 1" in error_of(davis({**recording_files(), "images.txt": b"0.1\n"}))


def test_malformed_event_is_named_with_its_line(davis):
    assert "events.txt line 2" in error_of(davis({"events.txt": b"0.1 0 0 1\n0.2 0 0\n"}))


def test_folder_without_events_is_refused(tmp_path):
    assert "no events.txt" in error_of(tmp_path)


def test_zip_without_events_is_refused(tmp_path):
    assert "must hold one events.txt" in error_of(write_zip(tmp_path / "a.zip", {"a.png": b""}))


def test_zip_of_one_text_file_is_text(tmp_path):
    path = write_zip(tmp_path / "a.zip", {"urban.txt": b"240 180\n" + EVENTS.encode()})

    recording = read_events(path)

    assert (recording.layout, recording.width, recording.height) == ("text", 240, 180)
    assert recording.events.size == 2


def test_zip_that_is_none_is_refused(tmp_path):
    (tmp_path / "a.zip").write_bytes(b"not a zip")

    assert "does not begin as a DAVIS240C recording as a zip does" in error_of(tmp_path / "a.zip")


def test_damaged_zip_is_refused(tmp_path):
    with zipfile.ZipFile(tmp_path / "a.zip", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("events.txt", EVENTS * 1000)
    data = bytearray((tmp_path / "a.zip").read_bytes())
    data[45:60] = b"\xff" * 15
    (tmp_path / "a.zip").write_bytes(data)

    assert "events.txt: cannot be read from the zip archive" in error_of(tmp_path / "a.zip")


def test_missing_file(tmp_path):
    assert "no such file" in error_of(tmp_path / "a.h5")


def test_unknown_suffix_lists_what_exists(tmp_path):
    (tmp_path / "a.xyz").write_bytes(b"")

    assert "unknown suffix '.xyz', must be one of .h5" in error_of(tmp_path / "a.xyz")


def test_a_video_is_to_be_converted_first(tmp_path):
    (tmp_path / "a.mp4").write_bytes(b"")

    told = error_of(tmp_path / "a.mp4")
    assert told.endswith(
        f"is a video and holds no events; make some: adv2e convert {tmp_path / 'a.mp4'}"
    )


# HDF5, written here with plain h5py


def write_monash(path, ts, xs, ys, ps, images=(), **attributes):
    with h5py.File(path, "w") as file:
        for name, column in {"xs": xs, "ys": ys, "ts": ts, "ps": ps}.items():
            file[f"events/{name}"] = column
        for number, (time, image) in enumerate(images):
            file[f"images/image{number:09d}"] = image
            file[f"images/image{number:09d}"].attrs["timestamp"] = time
        for name, value in attributes.items():
            file.attrs[name] = value
    return path


@pytest.mark.parametrize(
    "ps",
    [
        np.array([True, False]),
        np.array([1, 0], np.uint8),
        np.array([1, -1], np.int8),
        np.array([1, 2**32 - 1], np.uint32),  # -1 as some writers leave it
        np.array([1.0, -1.0]),
    ],
)
def test_monash_polarity(tmp_path, ps):
    path = write_monash(tmp_path / "a.h5", [0.1, 0.2], [0, 2], [0, 1], ps)

    recording = read_events(path)

    assert recording.layout == "monash"
    assert recording.events.tolist() == [(100_000, 0, 0, 1), (200_000, 2, 1, 0)]


def test_monash_times_are_rounded_to_microseconds(tmp_path):
    epoch = 1_468_941_032_229_165
    ts = [4.99999987e-05, 0.0038109999, (epoch - 1) / 1e6, epoch / 1e6]
    path = write_monash(tmp_path / "a.h5", ts, [0] * 4, [0] * 4, [1] * 4)

    assert read_events(path).events["t"].tolist() == [50, 3811, epoch - 1, epoch]


def test_monash_whole_numbers_are_microseconds(tmp_path):
    path = write_monash(tmp_path / "a.h5", np.array([7, 9]), [0, 0], [0, 0], [1, 1])

    recording = read_events(path)

    assert recording.events["t"].tolist() == [7, 9]
    assert recording.problems[0].startswith("no unit is stated: times are taken as us;")


def test_monash_geometry_is_height_then_width(tmp_path):
    path = write_monash(tmp_path / "a.h5", [0.1], [0], [0], [1], sensor_resolution=(180, 240))

    recording = read_events(path)

    assert (recording.width, recording.height, recording.problems) == (240, 180, [])


def test_monash_geometry_of_the_first_image(tmp_path):
    images = [(0.5, np.zeros((180, 240), np.uint8))]

    recording = read_events(write_monash(tmp_path / "a.h5", [0.1], [0], [0], [1], images))

    assert (recording.width, recording.height) == (240, 180)


def test_monash_images(tmp_path):
    bgr = np.zeros((2, 3, 3), np.uint8)
    bgr[0, 0] = (1, 2, 3)
    images = [(0.25, np.full((2, 3), 7, np.uint8)), (0.5, bgr), (0.75, bgr[..., :1])]

    recording = read_events(write_monash(tmp_path / "a.h5", [0.1], [0], [0], [1], images))

    first, second, third = recording.frames()
    assert recording.frame_times_ns.tolist() == [250_000_000, 500_000_000, 750_000_000]
    assert np.all(first.image == 7)
    assert second.image[0, 0].tolist() == [3, 2, 1]
    assert third.image.shape == (2, 3)


def test_monash_without_events(tmp_path):
    path = write_monash(tmp_path / "a.h5", np.zeros(0), np.zeros(0, int), np.zeros(0, int), [])

    assert read_events(path).problems == ["no events"]


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        (([0.1, 0.2], [0], [0], [1]), "one length"),
        (([np.nan], [0], [0], [1]), "NaN"),
        (([b"a"], [0], [0], [1]), "events/ts must hold numbers"),
        (([0.1], [0.5], [0], [1]), "events/xs must hold numbers"),
    ],
)
def test_monash_columns_that_are_wrong(tmp_path, columns, message):
    assert message in error_of(write_monash(tmp_path / "a.h5", *columns))


def test_monash_image_without_a_time_is_named(tmp_path):
    path = write_monash(tmp_path / "a.h5", [0.1], [0], [0], [1], [(0.0, np.zeros((2, 3)))])
    with h5py.File(path, "r+") as file:
        del file["images/image000000000"].attrs["timestamp"]

    assert "images/image000000000 has no attribute timestamp" in error_of(path)


def test_hdf5_of_another_layout_is_refused(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["frames"] = [1, 2]

    assert "unknown HDF5 layout" in error_of(tmp_path / "a.h5")


def test_what_is_no_hdf5_is_refused(tmp_path):
    (tmp_path / "a.h5").write_bytes(b"not HDF5")

    assert "not an HDF5 file" in error_of(tmp_path / "a.h5")


def test_truncated_hdf5_is_refused(tmp_path):
    n = 10_000
    path = write_monash(tmp_path / "a.h5", np.arange(n) / 1e6, *np.zeros((3, n), int))
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])

    assert "damaged" in error_of(path)


# NumPy archives


def write_npz(path, **arrays):
    np.savez(path, **arrays)
    return path


@pytest.mark.parametrize(
    ("name", "t"),
    [
        ("t_us", np.array([100, 200], np.uint32)),
        ("t_ns", np.array([99_500, 200_499])),
        ("t", np.array([100, 200])),
        ("t", np.array([0.0001, 0.0002])),
        ("timestamps", np.array([0.0001, 0.0002])),
    ],
)
def test_npz_times(tmp_path, name, t):
    path = write_npz(tmp_path / "a.npz", **{name: t}, x=[0, 1], y=[1, 0], p=[1, -1])

    recording = read_events(path)

    assert recording.layout == "npz"
    assert recording.events.tolist() == [(100, 0, 1, 1), (200, 1, 0, 0)]


def test_npz_of_a_structured_array(tmp_path):
    table = np.zeros(2, [("x", "<i2"), ("y", "<i2"), ("t", "<i8"), ("p", "?")])
    table["t"], table["x"] = [5, 6], [7, 8]

    recording = read_events(write_npz(tmp_path / "a.npz", events=table))

    assert recording.events["t"].tolist() == [5, 6]
    assert recording.events["x"].tolist() == [7, 8]


def test_npz_geometry(tmp_path):
    path = write_npz(tmp_path / "a.npz", t_us=[1], x=[0], y=[0], p=[1], width=304, height=240)

    recording = read_events(path)

    assert (recording.width, recording.height, recording.problems) == (304, 240, [])


def test_npz_column_that_is_missing_is_named(tmp_path):
    message = error_of(write_npz(tmp_path / "a.npz", t_us=[1], p=[1]))

    assert "no column for x (x, xs); it has t_us, p" in message


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        ({"t_us": [1, 2], "x": [0], "y": [0], "p": [1]}, "one length"),
        ({"t": [np.inf], "x": [0], "y": [0], "p": [1]}, "NaN or infinite"),
        ({"t": [1], "x": [0.5], "y": [0], "p": [1]}, "x must hold whole numbers"),
        ({"t": ["a"], "x": [0], "y": [0], "p": [1]}, "t must hold numbers"),
        ({"t": np.array([None]), "x": [0], "y": [0], "p": [1]}, "t: an array of Python obj"),
    ],
)
def test_npz_columns_that_are_wrong(tmp_path, columns, message):
    assert message in error_of(write_npz(tmp_path / "a.npz", **columns))


def test_what_is_no_npz_is_refused(tmp_path):
    (tmp_path / "a.npz").write_bytes(b"PK no archive")

    assert "not a NumPy archive" in error_of(tmp_path / "a.npz")
