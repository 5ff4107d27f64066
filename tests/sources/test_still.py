"""A picture before which a sensor moves: where it is, how near frames are, what it sees."""

from __future__ import annotations

import json
import math
from itertools import pairwise

import cv2
import numpy as np
import pytest

import adv2e
from adv2e.config.model import Sensor
from adv2e.errors import DataError, UsageError
from adv2e.light.sensor import fitting_of
from adv2e.sources import open_source
from adv2e.sources.paths import PARTS, PATHS, STEP_PX, SensorPath


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def photo(width=40, height=30, name="photo.png"):
    image = np.random.default_rng(1).integers(0, 256, (height, width), dtype=np.uint8)
    cv2.imwrite(name, image)
    return image


def test_saccades_visit_the_corners_of_a_triangle_and_rest_there():
    path = SensorPath("saccade")
    assert (path.extent, path.duration) == (6.0, 0.3)
    assert [path.at(k / 3) for k in range(4)] == [(-3, -3), (0, 3), (3, -3), (-3, -3)]
    # at rest at each corner, fastest half way
    near = math.dist(path.at(1 / 3), path.at(1 / 3 + 0.002))
    assert near < 0.05 < math.dist(path.at(0.5), path.at(0.502))
    # half of a leg is half of the way
    assert path.at(1 / 6) == (-1.5, 0.0)


@pytest.mark.parametrize("kind", PATHS)
@pytest.mark.parametrize("extent", [0.7, 6.0, 30.0])
def test_no_frame_moves_farther_than_half_a_pixel_and_none_beyond_the_extent(kind, extent):
    path = SensorPath(kind, extent)
    count = path.intervals
    places = np.array([path.at(k / count) for k in range(count + 1)])
    steps = [math.dist(here, there) for here, there in pairwise(places)]
    assert max(steps) <= STEP_PX + 2 / PARTS
    assert max(steps) > STEP_PX / 3 or count == 1
    assert np.abs(places).max() <= extent / 2 + 1 / PARTS


def test_frames_are_the_picture_at_times_along_the_path():
    image = photo()
    source = open_source("photo.png", motion="pan", extent_px=4.0, duration_s=0.1)
    frames = list(source.frames())
    assert (source.kind, source.count, len(frames)) == ("still", 9, 9)
    assert [frame.t_ns for frame in frames] == [12_500_000 * k for k in range(9)]
    assert [frame.offset for frame in frames] == [(0.5 * k - 2, 0.0) for k in range(9)]
    assert all(frame.image is frames[0].image for frame in frames)
    assert np.array_equal(frames[0].image, image)


def test_a_rate_that_is_given_holds():
    photo()
    source = open_source("photo.png", fps=100, motion="shake")
    assert [frame.t_ns for frame in source.frames()] == [10_000_000 * k for k in range(101)]
    with pytest.raises(UsageError, match="--motion makes the frames"):
        open_source("photo.png", timestamps="times.txt", motion="shake")


def seen(image, x, y, width, height, fine):
    """Mean over squares of a picture repeated `fine` times, from column x and row y [1/fine]."""
    dense = np.kron(image, np.ones((fine, fine)))
    part = dense[y : y + height * fine, x : x + width * fine]
    return part.reshape(height, fine, width, fine).mean(axis=(1, 3))


@pytest.mark.parametrize("offset", [(0.0, 0.0), (1.0, -2.0), (0.25, 0.5), (-2.75, 2.5)])
def test_the_sensor_sees_the_mean_of_the_light_from_where_it_is(offset):
    image = np.random.default_rng(2).uniform(0, 255, (30, 40)).astype(np.float32)
    fitting = fitting_of(40, 30, None, "photo.png", SensorPath("saccade"))
    assert fitting.size == (34, 24)
    x, y = (round(4 * (3 + part)) for part in offset)
    expected = seen(image, x, y, 34, 24, 4)
    np.testing.assert_allclose(fitting.moved(offset).plane(image), expected, atol=1e-4)


def test_a_smaller_sensor_sees_a_larger_picture_whole_on_its_way():
    image = np.random.default_rng(3).uniform(0, 255, (120, 160)).astype(np.float32)
    path = SensorPath("saccade", 8.0)
    fitting = fitting_of(160, 120, Sensor(width=32, height=22), "photo.png", path)
    # 40 by 30 of its pixels are the picture: each is 4 by 4 of the picture's
    expected = image.reshape(30, 4, 40, 4).mean(axis=(1, 3))
    for offset in ((-4, -4), (0, 4), (4, -4), (0, 0)):
        x, y = 4 + offset[0], 4 + offset[1]
        np.testing.assert_allclose(
            fitting.moved(offset).plane(image), expected[y : y + 22, x : x + 32], atol=1e-4
        )


def test_a_picture_becomes_events(adv2e, tmp_path):
    image = np.full((30, 40), 40, np.uint8)
    image[:, 20:] = 160  # an edge: only its columns fire
    cv2.imwrite("photo.png", image)
    told = adv2e("convert", "photo.png", "--motion", "pan", "--extent", "6", "-c", "ideal",
                 "-o", "a.zip")  # fmt: skip
    assert told.status == 0, told.err
    assert "the sensor moves: pan of 6 pixels in 1 s, in 13 frames" in told.err
    found = package().read_events("a.zip")
    assert (found.width, found.height) == (34, 24)
    # it looks right: dark becomes bright where the edge comes by, from column 20 on to the left
    assert set(found.events["p"].tolist()) == {1}
    assert set(found.events["x"].tolist()) == set(range(14, 20))
    first = [found.events["t"][found.events["x"] == x].min() for x in range(14, 20)]
    assert first == sorted(first, reverse=True)
    assert found.frame_times_ns.size == 13
    described = json.loads(json.dumps(found.metadata))
    assert described["source"]["motion"] == {"kind": "pan", "extent_px": 6.0, "duration_s": None}


def package():
    return adv2e


def test_python_does_what_the_command_does(adv2e, tmp_path):
    photo()
    light = ("--set", "frames.encoding=srgb")
    assert adv2e("convert", "photo.png", "--motion", "saccade", "-o", "a.txt", *light).status == 0
    stated = {"frames": {"encoding": "srgb"}}
    package().convert("photo.png", "b.txt", stated, motion="saccade")
    assert (tmp_path / "a.txt").read_bytes() == (tmp_path / "b.txt").read_bytes()
    assert (tmp_path / "a.txt").stat().st_size > 1000


@pytest.mark.parametrize(
    ("given", "status", "told"),
    [
        (("photo.png",), 1, "a single picture makes no events: --motion saccade moves a sensor"),
        (("photo.png", "--extent", "3"), 2, "--extent and --duration are of the path"),
        (("photo.png", "--motion", "pan", "--extent", "40"), 1, "too few for a path of 40 pixels"),
        (("clip.mp4", "--motion", "pan"), 1, "--motion moves before one picture"),
        (("-", "--motion", "pan"), 2, "--motion moves before one picture: INPUT must be its file"),
        (("photo.png", "--motion", "pan", "--time-unit", "ms"), 2, "leave --time-unit out"),
        (("photo.png", "--motion", "pan", "--bayer", "rggb"), 2, "leave --bayer out"),
        (("photo.png", "--motion", "pan", "--allow-damaged"), 2, "leave --allow-damaged out"),
        (("photo.png", "--motion", "pan", "--extent", "1", "--duration", "1e5", "--fps", "1000"),
         1, "100,000,001 frames along the path"),
    ],
)  # fmt: skip
def test_what_cannot_be(given, status, told, adv2e, tmp_path):
    photo()
    (tmp_path / "clip.mp4").write_bytes(b"")
    found = adv2e("convert", *given, "-o", "a.txt")
    assert (found.status, told in found.err) == (status, True), found.err
    assert not (tmp_path / "a.txt").exists()


def test_in_python_a_path_has_its_measures_and_they_a_path():
    photo()
    for given in ({"extent_px": 3}, {"duration_s": 1}):
        with pytest.raises(
            UsageError, match="extent_px and duration_s are of the path that motion"
        ):
            package().convert("photo.png", "a.txt", **given)


def test_paths_that_cannot_be():
    with pytest.raises(UsageError, match="motion: must be saccade, shake or pan"):
        open_source("photo.png", motion="hop")
    for value in (-1.0, 0, float("inf"), "9"):
        with pytest.raises(UsageError, match="extent_px: must be a number above 0"):
            open_source("photo.png", motion="pan", extent_px=value)
    with pytest.raises(UsageError, match="duration_s: must be at most 1000000"):
        open_source("photo.png", motion="pan", duration_s=1e7)
    with pytest.raises(DataError, match="too few for a path"):
        fitting_of(6, 30, None, "photo.png", SensorPath("saccade"))
