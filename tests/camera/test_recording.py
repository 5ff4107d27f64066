"""Files, settings, scenes and the catalogue."""

import ast
import zipfile
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml

from camera import SCENES, Camera, patchwork
from camera.catalogue import LIBRARY, NOTHING, OUTSIDE, SIZES, cases
from camera.recording import png
from camera.settings import BENCH, check, find, merged

pytestmark = pytest.mark.thorough

HIDDEN = {"pixel": {"refractory": {"period_us": 4000.0}}, "outside": {"echo": {"share": 0.1}}}
HIDDEN["outside"]["echo"]["delay_us"] = 7000.0


def small(**options):
    given = {"size": (12, 9), "duration_s": 0.06, "fps": 200.0, "seed": 3, "step_us": 50.0}
    return Camera(patchwork((12, 9), seed=3, speed=2.0), **{**given, **options})


@pytest.mark.parametrize("depth", [np.uint8, np.uint16])
def test_png_reads_back(depth):
    image = np.random.default_rng(1).integers(0, np.iinfo(depth).max, (7, 11)).astype(depth)
    read = cv2.imdecode(np.frombuffer(png(image), np.uint8), cv2.IMREAD_UNCHANGED)
    assert read.dtype == depth
    assert np.array_equal(read, image)


def test_folder_and_archive_hold_the_same_recording(tmp_path):
    camera = small(hidden=HIDDEN)
    camera.record(tmp_path / "one")
    camera.record(tmp_path / "two.zip")
    with zipfile.ZipFile(tmp_path / "two.zip") as archive:
        names = sorted(archive.namelist())
        for name in names:
            assert archive.read(name) == (tmp_path / "one" / name).read_bytes()
    images = [f"images/frame_{n:08d}.png" for n in range(13)]
    assert names == ["events.txt", "images.txt", *images]
    lines = (tmp_path / "one" / "images.txt").read_text("ascii").splitlines()
    assert lines[1] == "0.005000000 images/frame_00000001.png"


def test_lines_of_events_are_those_of_the_camera(tmp_path):
    camera = small()
    camera.record(tmp_path / "one")
    lines = (tmp_path / "one" / "events.txt").read_text("ascii").splitlines()
    stream = camera.events()
    assert len(lines) == len(stream.time) > 50
    for line, time, pixel, polarity in zip(lines, *stream, strict=True):
        t, x, y, p = line.split(" ")
        assert len(t.partition(".")[2]) == 9
        assert abs(float(t) - time) <= 0.5001e-6
        assert (int(x), int(y), int(p)) == (pixel % 12, pixel // 12, int(polarity > 0))


def test_what_is_hidden_is_in_the_truth_alone(tmp_path):
    small(hidden=HIDDEN).record(tmp_path / "one.zip")
    declared = yaml.safe_load((tmp_path / "one.declared.yaml").read_text("utf-8"))
    truth = yaml.safe_load((tmp_path / "one.truth.yaml").read_text("utf-8"))
    assert declared == BENCH
    assert truth == merged(BENCH, HIDDEN)


def test_an_unknown_key_is_named():
    with pytest.raises(KeyError, match=r"pixel\.leek: unknown key|pixel\.leek\.rate_hz"):
        small(hidden={"pixel": {"leek": {"rate_hz": 1.0}}})
    with pytest.raises(KeyError, match=r"did you mean 'pixel\.leak\.rate_hz'"):
        check({"pixel": {"leak": {"rate": 1.0}}})


def test_null_switches_off_and_a_key_inside_switches_on():
    off = merged(BENCH, {"pixel": {"refractory": None}})
    assert find(off, "pixel.refractory.period_us", 0.0) == 0.0
    on = merged(off, {"pixel": {"refractory": {"period_us": 5.0}}})
    assert find(on, "pixel.refractory.period_us", 0.0) == 5.0


@pytest.mark.parametrize("size", [(64, 48), (48, 36)])
def test_scene_has_dark_and_bright_parts_motion_and_rest(size):
    for seed in range(4):
        view = patchwork(size, seed).view(np.arange(size[0]) + 0.0, np.arange(size[1]) + 0.0)
        light = view.light(np.linspace(0.0, 1.5, 121))
        assert 3.0 < light.min() < 6.0
        assert 150.0 < light.max() < 240.0
        changes = np.ptp(np.log(light), axis=0).reshape(size[::-1])
        still = changes[size[1] * 3 // 4 :, size[0] * 3 // 4 :]
        assert np.median(changes) > 0.8
        assert (still < 0.05).mean() > 0.3


@pytest.mark.parametrize("name", SCENES)
def test_scenes_follow_their_seed_and_stay_within_white(name):
    size = (24, 18)
    pictures = []
    for seed in (0, 0, 1):
        view = SCENES[name](size, seed).view(np.arange(24.0), np.arange(18.0))
        light = view.light(np.linspace(-0.02, 1.5, 60))
        assert 2.9 < light.min() < light.max() < 240.0
        assert np.ptp(light, axis=0).max() > 50.0
        pictures.append(light)
    assert np.array_equal(pictures[0], pictures[1])
    assert not np.allclose(pictures[0], pictures[2])


def test_scene_is_the_same_wherever_the_grid_lies():
    scene = patchwork((16, 12), seed=2)
    times = np.array([0.0, 0.4, 0.9])
    whole = scene.view(np.arange(16.0), np.arange(12.0)).light(times).reshape(3, 12, 16)
    part = scene.view(np.arange(4.0, 9.0), np.arange(3.0, 10.0)).light(times).reshape(3, 7, 5)
    np.testing.assert_allclose(part, whole[:, 3:10, 4:9], rtol=1e-12)


def test_catalogue_has_three_sizes_of_every_effect_of_known_keys():
    found = list(cases())
    assert len(found) == 3 * (len(LIBRARY) + len(OUTSIDE))
    for case in found:
        check(merged(BENCH, case.hidden))
        assert case.in_library == ("outside" not in case.hidden)
    assert len(OUTSIDE) >= 4
    assert [case.size for case in cases("leak")] == list(SIZES)


@pytest.mark.parametrize("case", list(cases(size="large")), ids=lambda case: case.name)
def test_every_effect_does_something(case, plain):
    camera = small(hidden=case.hidden, duration_s=0.12, fps=100.0)
    events, images = plain
    found = camera.events()
    pictures = [(f.stamp, f.image.tobytes()) for f in camera.frames()]
    same_events = all(
        len(a) == len(b) and np.array_equal(a, b) for a, b in zip(found, events, strict=True)
    )
    of_frames = "frames" in case.hidden and case.name != "flicker"
    assert same_events == of_frames or (case.name == "dead_pixels" and same_events)
    assert (pictures != images) == of_frames


@pytest.fixture(scope="module")
def plain():
    camera = small(hidden=NOTHING.hidden, duration_s=0.12, fps=100.0)
    return camera.events(), [(f.stamp, f.image.tobytes()) for f in camera.frames()]


def test_the_camera_shares_no_code_with_what_it_tests():
    for path in Path(__file__).parent.glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            names = []
            if isinstance(node, ast.Import):
                names = [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom):
                names = [node.module or ""]
            for name in names:
                assert name.partition(".")[0] not in ("adv2e", "reference", "harness"), path.name
