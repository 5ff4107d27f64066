"""The brute-force camera and the package agree where nothing is hidden."""

from __future__ import annotations

import numpy as np
import pytest
import yaml
from camera import Camera, patchwork
from camera.settings import BENCH, merged

from adv2e import load_config, simulate
from adv2e.comparison.distances import smoothed_errors
from adv2e.events import EVENT_DTYPE
from adv2e.formats.reading import read_events

pytestmark = pytest.mark.thorough

SIZE, DURATION_S, FAST_HZ = (24, 18), 0.3, 4000.0
SCENE = patchwork(SIZE, seed=6, speed=1.5)

STILL = {
    "pixel": {
        "thresholds": {"mismatch": 0.0},
        "leak": {"rate_hz": 2.0, "photo_rate_hz": 5.0},
        "shot_noise": None,
    }
}
"""Without anything random."""

CIRCUITS = {
    "as declared": {},
    "no dead time": {"pixel": {"refractory": None}},
    "no low-pass": {"pixel": {"low_pass": None}},
    "second pole": {"pixel": {"source_follower": {"cutoff_hz": 80.0}}},
    "linear foot": {"pixel": {"log_response": {"linear_below": 20.0}}},
}


def measured(camera):
    """Return the camera's events as the package holds them."""
    stream = camera.events()
    events = np.zeros(len(stream.time), EVENT_DTYPE)
    events["t"] = np.rint(stream.time * 1e6)
    events["y"], events["x"] = np.divmod(stream.pixel, SIZE[0])
    events["p"] = stream.polarity > 0
    return events[np.lexsort((events["p"], events["x"], events["y"], events["t"]))]


def simulated(settings, path, seed=1):
    """Return the package's events for very fast frames of the scene, as light."""
    path.write_text(yaml.safe_dump(merged(settings, {"frames": {"full_scale": 255}})), "utf-8")
    view = SCENE.view(np.arange(SIZE[0]) + 0.0, np.arange(SIZE[1]) + 0.0)
    times = np.arange(round(DURATION_S * FAST_HZ) + 1) / FAST_HZ
    frames = view.light(times).reshape(-1, SIZE[1], SIZE[0])
    config = load_config([str(path)], [], seed=seed)
    return np.concatenate(list(simulate(frames, times, config, threads=1)))


def by_pixel(events):
    """Return (times, polarities) of each pixel."""
    order = np.lexsort((events["t"], events["x"], events["y"]))
    index = events["y"][order].astype(int) * SIZE[0] + events["x"][order]
    cuts = np.searchsorted(index, np.arange(1, SIZE[0] * SIZE[1]))
    return list(
        zip(np.split(events["t"][order], cuts), np.split(events["p"][order], cuts), strict=True)
    )


@pytest.mark.parametrize("circuit", CIRCUITS)
def test_camera_and_package_give_the_same_events_of_one_scene(circuit, tmp_path):
    settings = merged(BENCH, STILL, CIRCUITS[circuit])
    camera = measured(Camera(SCENE, settings, size=SIZE, duration_s=DURATION_S, step_us=25.0))
    package = simulated(settings, tmp_path / "circuit.yaml")
    assert len(camera) > 3000
    assert len(camera) == pytest.approx(len(package), rel=0.01)
    assert max(smoothed_errors(camera, package, SIZE[0])) < 0.05
    pairs = zip(by_pixel(camera), by_pixel(package), strict=True)
    apart = [np.abs(a[0] - b[0]) for a, b in pairs if np.array_equal(a[1], b[1])]
    assert len(apart) > 0.95 * SIZE[0] * SIZE[1]
    assert np.median(np.concatenate(apart)) <= 3


def test_noise_and_mismatch_leave_as_many_events(tmp_path):
    hot = {"hot_pixels": {"fraction": 0.02, "rate_hz": 40.0}}
    noisy = {"shot_noise": {"rate_hz": 10.0}, "photoreceptor_noise": {"rms": 0.03}, **hot}
    settings = merged(BENCH, {"pixel": noisy})
    counts = {"camera": [], "package": []}
    for seed in range(2):
        camera = Camera(SCENE, settings, size=SIZE, duration_s=DURATION_S, seed=seed, step_us=50.0)
        package = simulated(settings, tmp_path / "noise.yaml", seed)
        for name, events in (("camera", measured(camera)), ("package", package)):
            counts[name].append([np.sum(events["p"] == 1), np.sum(events["p"] == 0)])
    a, b = (np.sum(counts[name], axis=0) for name in ("camera", "package"))
    np.testing.assert_allclose(a, b, rtol=0.02)


def test_the_package_reads_what_the_camera_writes(tmp_path):
    camera = Camera(SCENE, size=SIZE, duration_s=0.05, fps=500.0, seed=3)
    camera.record(tmp_path / "one.zip")
    recording = read_events(tmp_path / "one.zip")
    assert (recording.width, recording.height) == SIZE
    assert not recording.problems
    assert np.array_equal(np.sort(recording.events["t"]), np.sort(measured(camera)["t"]))
    config = load_config([str(tmp_path / "one.declared.yaml")], [])
    assert config.pixel.low_pass.dark_cutoff_hz == 20.0
    assert config.frames.full_scale == 65535


@pytest.mark.parametrize("noise", [{}, {"photoreceptor_noise": {"rms": 0.02}}])
def test_leak_goes_on_in_both_from_the_first_moment(noise, tmp_path):
    given = {"leak": {"rate_hz": 15.0, "jitter": 0.2}, "shot_noise": {"rate_hz": 5.0}, **noise}
    settings = merged(BENCH, {"pixel": {"initial_reference": "running", **given}})
    camera = measured(Camera(SCENE, settings, size=SIZE, duration_s=DURATION_S, step_us=50.0))
    package = simulated(settings, tmp_path / "running.yaml")
    edges = np.array([0.0, 0.01, 0.02, 0.04, 0.08, DURATION_S]) * 1e6
    a, b = (np.histogram(e["t"][e["p"] == 1], edges)[0] for e in (camera, package))
    assert a.min() > 50
    assert np.all(np.abs(a - b) < 4 * np.sqrt(a + b) + 0.03 * a)
