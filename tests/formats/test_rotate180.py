"""Events and frames turned by half a turn, wherever they come from and go to."""

import numpy as np
import pytest

from adv2e import convert, write_events
from adv2e.errors import DataError
from adv2e.events import make_events, sort_events
from adv2e.formats.frames import open_frames
from adv2e.formats.reading import read_events
from adv2e.formats.writing import open_sink

EVENTS = make_events([0, 10, 10, 30_000], [0, 3, 1, 2], [0, 2, 1, 0], [1, 0, 0, 1])
TURNED = sort_events(make_events([0, 10, 10, 30_000], [3, 0, 2, 1], [2, 0, 1, 2], [1, 0, 0, 1]))
FRAMES = np.arange(36, dtype=np.uint8).reshape(3, 3, 4) * 7


def written(path):
    with open_sink(path, width=4, height=3, metadata={}, with_frames=True) as sink:
        for number, frame in enumerate(FRAMES):
            sink.write_frame(number * 10_000_000, frame)
        sink.write_events(EVENTS)
    return path


@pytest.mark.parametrize("name", ["a.h5", "a.zip", "a"])
def test_events_and_frames_are_turned(tmp_path, name):
    recording = read_events(written(tmp_path / name), rotate180=True)
    assert np.array_equal(recording.events, TURNED)
    for _ in range(2):
        for frame, stored in zip(recording.frames(), FRAMES, strict=True):
            assert np.array_equal(frame.image, np.rot90(stored, 2))


@pytest.mark.parametrize("name", ["a.h5", "a.zip", "a"])
def test_frames_to_be_simulated_are_turned(tmp_path, name):
    source = open_frames(written(tmp_path / name), rotate180=True)
    for frame, stored in zip(source.frames(), FRAMES, strict=True):
        assert np.array_equal(frame.image, np.rot90(stored, 2))


def test_frames_are_turned_before_they_are_cut(tmp_path):
    from adv2e.geometry import Rectangle

    np.save(tmp_path / "a.npy", FRAMES)
    source = open_frames(tmp_path / "a.npy", fps=10, rotate180=True, crop=Rectangle(1, 0, 2, 2))
    images = [frame.image for frame in source.frames()]
    assert np.array_equal(images, FRAMES[:, ::-1, ::-1][:, 0:2, 1:3])


def test_events_to_events(tmp_path):
    convert(written(tmp_path / "a.h5"), tmp_path / "b.txt", rotate180=True)
    assert np.array_equal(read_events(tmp_path / "b.txt").events, TURNED)


@pytest.mark.thorough
def test_without_a_size_nothing_can_be_turned(tmp_path):
    write_events(tmp_path / "a.txt", EVENTS, (4, 3))
    (tmp_path / "a.txt.json").unlink()
    with pytest.raises(DataError, match=r"a\.txt: states no size of its sensor, which --rotate180"):
        read_events(tmp_path / "a.txt", rotate180=True)
    recording = read_events(tmp_path / "a.txt", size=(4, 3), rotate180=True)
    assert recording.events["x"].tolist() == [3, 0, 2, 1]


def test_commands_turn_too(tmp_path, adv2e):
    path = written(tmp_path / "a.h5")
    turned = tmp_path / "b.h5"
    assert adv2e("convert", path, "-o", turned, "--rotate180").status == 0
    assert np.array_equal(read_events(turned).events, TURNED)
    found = adv2e("compare", path, turned, "--rotate180", "--window", "0.01", "--json")
    assert found.status == 0, found.err
    assert found.out != adv2e("compare", path, turned, "--window", "0.01", "--json").out
    assert adv2e("info", path, "--rotate180").status == 0
    assert adv2e("render", path, "--rotate180", "-o", tmp_path / "a.png").status == 0
