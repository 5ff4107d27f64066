"""The script that makes recordings of scenes of BS-ERGB."""

from __future__ import annotations

from itertools import pairwise

import cv2
import numpy as np
import pytest
from click.testing import CliRunner
from experiments import bs_ergb
from experiments.recordings import read

from adv2e import read_events
from adv2e.sources import open_source

ROWS, COLUMNS = 200, 300
GAINS = (1.0, 1.17, 1.3)
FIRST_US, STEP_US = 7_000_000, 40_000
DRAW = np.random.default_rng(8)


def written(path, x, y, t, p):
    """Write events as the data set has them: 1/32 of a pixel, the sign lost."""
    x, y = (np.rint(32 * where).astype(np.int16).view(np.uint16) for where in (x, y))
    np.savez(path, x=x, y=y, timestamp=t.astype(np.uint32), polarity=p.astype(np.uint8))


def codes():
    """Return what the camera sees at its first exposure, dark to bright from left to right."""
    ramp = np.broadcast_to(np.linspace(5, 140, COLUMNS)[None, :, None], (ROWS, COLUMNS, 3))
    return ramp.copy()


@pytest.fixture
def scene(tmp_path):
    folder = tmp_path / "scene"
    (folder / "images").mkdir(parents=True)
    (folder / "events").mkdir()
    for k, gain in enumerate(GAINS):
        image = gain * codes()
        image[:40, 250:] = (30, 200, 90)[k]  # what moves there fires, and tells no exposure
        assert cv2.imwrite(str(folder / f"images/{7 + k:06d}.png"), np.rint(image).astype(np.uint8))
    for k in range(len(GAINS) - 1):
        # the moving corner is full of events; some lie outside
        count = 60_000
        x, y = DRAW.uniform(247, 303, count), DRAW.uniform(-2, 43, count)
        keep = (x < 299.4) | (np.arange(count) < 300)
        keep &= (y > -0.4) | (np.arange(count) < 300)
        x, y = x[keep], y[keep]
        t = FIRST_US + k * STEP_US + np.linspace(0, STEP_US - 1, x.size).astype(np.int64)
        written(folder / f"events/{7 + k:06d}.npz", x, y, t, DRAW.integers(0, 2, x.size))
    return folder


def run(*words):
    return CliRunner().invoke(bs_ergb.main, [*map(str, words)])


def test_the_events_are_those_of_the_files_in_whole_pixels(scene, tmp_path):
    done = run(scene, "-o", tmp_path / "out")
    assert done.exit_code == 0, done.output
    made = read_events(tmp_path / "out")
    assert (made.width, made.height) == (COLUMNS, ROWS)
    wanted = []
    for k in (7, 8):
        held = np.load(scene / f"events/{k:06d}.npz")
        for row in zip(
            *(held[name].tolist() for name in ("timestamp", "x", "y", "polarity")), strict=True
        ):
            t, x, y, p = row
            x, y = ((v - 65536 if v >= 32768 else v) / 32 for v in (x, y))
            x, y = round(x), round(y)  # to the even one, as elsewhere
            if 0 <= x < COLUMNS and 0 <= y < ROWS:
                wanted.append((t, x, y, p))
    assert made.events[["t", "x", "y", "p"]].tolist() == wanted
    assert len(wanted) < sum(np.load(scene / f"events/{k:06d}.npz")["x"].size for k in (7, 8))


def test_images_stand_at_the_first_events_of_their_files_and_the_last_event(scene, tmp_path):
    run(scene, "-o", tmp_path / "out")
    times = [frame.t_ns // 1000 for frame in open_source(str(tmp_path / "out")).frames()]
    events = read_events(tmp_path / "out").events["t"]
    border = events[events >= FIRST_US + STEP_US][0]
    assert times == [events[0], border, events[-1]]


def test_exposure_is_evened_out_where_nothing_fires(scene, tmp_path):
    done = run(scene, "-o", tmp_path / "out")
    told = [line for line in done.output.splitlines() if "change by" in line]
    found = [[float(one) for one in line.partition("by ")[2].split(", ")] for line in told]
    for row, (before, after) in zip(found, pairwise(GAINS), strict=True):
        assert row == pytest.approx([after / before] * 5, rel=0.01)
    images = [
        cv2.imread(str(tmp_path / f"out/images/frame_{k:08d}.png"), cv2.IMREAD_UNCHANGED) / 257
        for k in range(3)
    ]
    most = 160 / GAINS[-1]
    for image in images:
        assert image[60:] == pytest.approx(np.minimum(codes()[60:], most), abs=1.5)
        assert image.max() == pytest.approx(most, rel=0.01)
    source = open_source(str(tmp_path / "out"))
    assert (source.encoding, source.full_scale) == ("gamma:2.2", 65535)
    read(str(tmp_path / "out"))  # which refuses events of another size than the frames


def test_images_can_stay_as_they_were_exposed(scene, tmp_path):
    done = run(scene, "-o", tmp_path / "out", "--as-exposed", "--encoding", "srgb")
    assert "change by" not in done.output
    for k in range(3):
        made = cv2.imread(str(tmp_path / f"out/images/frame_{k:08d}.png"), cv2.IMREAD_UNCHANGED)
        np.testing.assert_array_equal(made, cv2.imread(str(scene / f"images/{7 + k:06d}.png")))
    assert open_source(str(tmp_path / "out")).encoding == "srgb"


def test_scenes_that_cannot_be_read_are_one_line(scene, tmp_path):
    def refused(message, *options):
        done = run(scene, "-o", tmp_path / "out", *options)
        assert done.exit_code == 1
        assert message in done.output
        assert done.output.count("\n") == 1
        assert not (tmp_path / "out").exists()

    refused("encoding: must be auto, linear, srgb", "--encoding", "srgbb")
    refused("encoding: nothing tells it", "--encoding", "auto")
    held = dict(np.load(scene / "events/000008.npz"))
    whole = {name: held[name] // 32 if name in "xy" else held[name] for name in held}
    np.savez(scene / "events/000008.npz", **whole)
    refused("000008.npz: its coordinates are not in 1/32 of a pixel")
    np.savez(scene / "events/000008.npz", **(held | {"timestamp": held["timestamp"] - 30_000}))
    refused("000008.npz: begins before the events of the file before end")
    (scene / "events/000008.npz").rename(scene / "events/000009.npz")
    refused("no events/000008.npz, but some after it")
    (scene / "events/000009.npz").unlink()
    (scene / "images/000008.png").unlink()
    refused("no images/000008.png")
    (scene / "images").rename(scene / "pictures")
    refused("images: no numbered .png in it")
