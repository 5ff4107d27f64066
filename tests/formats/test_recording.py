"""Recordings in Python: length, parts by time, saving, and how they are shown."""

import re
from base64 import b64decode

import cv2
import numpy as np
import pytest

import adv2e
from adv2e.errors import Adv2eWarning, DataError
from adv2e.events import make_events
from adv2e.formats.recording import Recording

EVENTS = make_events(
    t=[1_000_000, 1_200_000, 1_200_000, 1_500_000, 2_000_000],
    x=[0, 3, 1, 2, 3],
    y=[0, 2, 1, 1, 0],
    p=[1, 0, 1, 1, 0],
)


def recording(frame_times_s=None, **more):
    if frame_times_s is not None:
        images = [np.full((3, 4), k, np.uint8) for k in range(len(frame_times_s))]
        more["frame_times_ns"] = np.array([round(t * 1e9) for t in frame_times_s], np.int64)
        more["images"] = lambda: iter(images)
    return Recording("drive.h5", "array", 4, 3, EVENTS, **more)


def test_length_and_duration():
    assert len(recording()) == 5
    assert recording().duration_s == 1.0
    assert recording([0.5, 3.0]).duration_s == 2.5
    nothing = Recording("none.h5", "array", 4, 3, EVENTS[:0])
    assert (len(nothing), nothing.duration_s, bool(nothing)) == (0, 0.0, True)


@pytest.mark.parametrize(
    ("part", "count"),
    [
        (slice(None), 5),
        (slice(0.2, 0.5), 2),
        (slice(0.2, None), 4),
        (slice(None, 0.2), 1),
        (slice(0.6, 0.3), 0),
        (slice(9, None), 0),
    ],
)
def test_a_part_by_time_begins_with_its_start_and_ends_before_its_stop(part, count):
    assert len(recording()[part]) == count


def test_frames_of_a_part_go_with_it():
    whole = recording([0.8, 1.0, 1.2, 1.8])  # its time begins with the first frame
    part = whole[0.2:0.5]
    assert part.frame_times_ns.tolist() == [1_000_000_000, 1_200_000_000]
    assert [int(frame.image[0, 0]) for frame in part.frames()] == [1, 2]
    assert part.events["t"].tolist() == [1_000_000, 1_200_000, 1_200_000]
    assert len(list(part.frames())) == 2  # as often as asked


@pytest.mark.parametrize("wrong", [3, slice(0, 1, 2), "t"])
def test_other_parts_are_refused(wrong):
    with pytest.raises(TypeError, match="a slice of seconds"):
        recording()[wrong]


@pytest.mark.parametrize("name", ["a.h5", "a.txt"])
def test_saved_and_read_again(tmp_path, name):
    recording(metadata={"of": "a test"}).save(tmp_path / name)
    again = adv2e.read_events(tmp_path / name)
    assert again.events.tobytes() == EVENTS.tobytes()
    assert (again.width, again.height, again.metadata["of"]) == (4, 3, "a test")
    again[0.2:0.5].save(tmp_path / name, overwrite=True)
    assert len(adv2e.read_events(tmp_path / name)) == 2


def test_frames_that_are_not_saved_are_told(tmp_path):
    with pytest.warns(Adv2eWarning, match="frames of the recording are not written") as told:
        adv2e.write_events(tmp_path / "a.h5", recording([1.0, 1.5], metadata={"frames": {}}))
    assert told[0].filename == __file__
    assert "frames" not in adv2e.read_events(tmp_path / "a.h5").metadata


def test_an_array_needs_a_size(tmp_path):
    with pytest.raises(DataError, match="events: size is missing"):
        adv2e.write_events(tmp_path / "a.h5", EVENTS)
    assert adv2e.voxel_grid(recording(), 5).shape == (5, 3, 4)


def test_it_is_shown_in_a_line():
    assert repr(recording()) == "<Recording drive.h5: 5 events, 4x3 pixels, 1.000 s>"
    shown = repr(recording([1.0, 1.5]))
    assert shown == "<Recording drive.h5: 5 events, 2 frames, 4x3 pixels, 1.000 s>"


def test_notebooks_show_a_picture():
    html = recording()._repr_html_()
    assert "&lt;Recording drive.h5: 5 events" in html
    pictures = re.findall('src="data:image/png;base64,([^"]+)"', html)
    sizes = [cv2.imdecode(np.frombuffer(b64decode(one), np.uint8), 1).shape for one in pictures]
    assert [size[1] > size[0] for size in sizes] == [True, True]  # events, and their rate below
    assert sizes[1][:2] == (340, 960)
    assert "<script" not in html
    nothing = Recording("<b>.h5", "array", 4, 3, EVENTS[:0])._repr_html_()
    assert "<img" not in nothing
    assert "<b>" not in nothing


def test_render_gives_a_picture_where_no_file_is_named(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    picture = adv2e.render(recording(), count=2)
    assert picture.dtype == np.uint8
    assert picture.ndim == 3
    assert len(np.unique(picture.reshape(-1, 3), axis=0)) > 1
    red = adv2e.render(recording(), at_s=[0.01], count=1, on_color="red", off_color="blue")
    assert ((red[..., 0] > 200) & (red[..., 2] < 60)).any()  # RGB, not BGR
    assert not list(tmp_path.iterdir())
