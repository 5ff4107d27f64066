"""With the same effect, the brute-force camera and the package give the same events."""

from __future__ import annotations

import numpy as np
import pytest
import yaml
from camera import Camera, patchwork
from camera.settings import BENCH, merged
from test_camera import SIZE, STILL, measured

from adv2e import load_config, simulate
from adv2e.comparison.distances import smoothed_errors

pytestmark = pytest.mark.thorough

DURATION_S = 0.3
SCENE = patchwork(SIZE, seed=6)
DECLARED = merged(BENCH, STILL, {"frames": {"full_scale": 65535}})


def camera_with(hidden, seed=0):
    return Camera(
        SCENE, DECLARED, hidden=hidden, size=SIZE, duration_s=DURATION_S, seed=seed, step_us=50.0
    )


def package(camera, added, path, seed=0):
    """Return the package's events for the camera's frames, the effects in `added` declared."""
    path.write_text(yaml.safe_dump(merged(DECLARED, added)), "utf-8")
    config = load_config(path, "frames.encoding=linear", seed=seed)
    frames = list(camera.frames())
    images, stamps = [f.image for f in frames], [f.stamp for f in frames]
    return np.concatenate(list(simulate(images, stamps, config, threads=1)))


def errors(camera, simulated):
    """Return the distances to the camera's events, less what follows the last frame."""
    recorded = measured(camera)
    start, end = 0.01e6, (DURATION_S - 0.012) * 1e6

    def cut(events):
        return events[(events["t"] >= start) & (events["t"] <= end)]

    return np.array(smoothed_errors(cut(recorded), cut(simulated), SIZE[0]))


# effect: (hidden in the camera, share of the declared model's error that may be left)
SAME = {
    "black_level": ({"frames": {"black_level_dn": 2.5}}, 0.1),
    "exposure_blur": ({"frames": {"exposure_us": 8000.0}}, 0.6),
    "clock_offset": ({"frames": {"clock_offset_us": -6000.0}}, 0.1),
    "clock_drift": ({"frames": {"clock_drift_ppm": 30000.0}}, 0.1),
    "misregistration": ({"frames": {"shift_px": [0.6, -0.4]}}, 0.4),
    "dark_current": ({"pixel": {"dark_current": {"dn": 6.0}}}, 0.1),
    "flicker": ({"frames": {"flicker": {"frequency_hz": 100.0, "depth": 0.3}}}, 0.1),
    "readout": ({"readout": {"arbiter": {"event_ns": 20000.0, "row_ns": 200000.0}}}, 0.5),
    "timestamp_tick": ({"readout": {"tick_us": 4000.0}}, 0.3),
}


@pytest.mark.parametrize("name", SAME)
def test_adding_the_effect_brings_the_events_of_the_camera(name, tmp_path):
    hidden, left = SAME[name]
    camera = camera_with(hidden)
    added = hidden
    if name == "flicker":
        phase = float(camera.random("lamp").uniform(0, 2 * np.pi))
        added = merged(hidden, {"frames": {"flicker": {"phase_rad": phase}}})
    without = errors(camera, package(camera, {}, tmp_path / "without.yaml"))
    found = errors(camera, package(camera, added, tmp_path / "with.yaml"))
    assert np.mean(found) < left * np.mean(without)
    assert np.mean(found) < 0.2


@pytest.mark.parametrize(
    ("hidden", "share"),
    [
        ({"pixel": {"dead_pixels": {"fraction": 0.3}}}, 0.7),
        ({"readout": {"loss": {"fraction": 0.3}}}, 0.7),
    ],
)
def test_what_is_drawn_leaves_as_many_events_as_in_the_camera(hidden, share, tmp_path):
    whole = len(measured(camera_with({})))
    cameras = [camera_with(hidden, seed) for seed in range(4)]
    recorded = [len(measured(camera)) / whole for camera in cameras]
    found = [
        len(package(camera, hidden, tmp_path / "one.yaml", seed)) / whole
        for seed, camera in enumerate(cameras)
    ]
    # a pixel of 432 more or less, by chance
    assert np.mean(found) == pytest.approx(share, abs=0.04)
    assert np.mean(recorded) == pytest.approx(share, abs=0.04)


@pytest.mark.parametrize(
    "coupling",
    [
        {"amplitude": 0.15, "tau_us": 700.0},
        {"amplitude": 0.08, "tau_us": 4000.0, "delay_us": -500.0, "width_us": 750.0},
        {"amplitude": -0.08, "tau_us": 2500.0, "delay_us": 250.0, "width_us": 1000.0},
    ],
    ids=["leap", "pulse before the frame", "pulse downwards"],
)
@pytest.mark.parametrize("period_us", [2000, 6650])
def test_readout_of_frames_makes_as_many_events_as_long_after_it_as_in_the_camera(
    coupling, period_us, tmp_path
):
    if period_us != 2000:  # other frames than those recorded
        coupling = {**coupling, "amplitude": 2.0 * coupling["amplitude"], "period_us": period_us}
    # which of them a pixel makes hangs on details: each one decides where the next ones fall
    hidden = {"readout": {"frame_coupling": coupling}}
    camera = camera_with(hidden)
    edges = np.array([0, 250, 750, 1250, 1750, 2000])

    def after_readouts(events):
        # a leap has the width of a step: what comes just before the next frame belongs to it
        leap = 0.0 if period_us == 2000 else coupling.get("delay_us", 0.0)
        since = (events["t"] - leap + 100) % period_us
        both = [np.histogram(since[events["p"] == p], edges)[0] for p in (0, 1)]
        return np.concatenate(both) / camera.size[0] / camera.size[1]

    recorded = after_readouts(measured(camera))
    without = after_readouts(package(camera, {}, tmp_path / "without.yaml"))
    found = after_readouts(package(camera, hidden, tmp_path / "with.yaml"))
    assert np.abs(found - recorded).sum() < 0.25 * np.abs(without - recorded).sum()
