"""The brute-force camera with an effect and the package with the same effect give the same events."""

from __future__ import annotations

import numpy as np
import pytest
import yaml
from camera import Camera, patchwork
from camera.settings import BENCH, merged
from test_camera import SIZE, STILL, measured

from adv2e import load_config, simulate
from adv2e.comparison.smoothed_error import smoothed_errors

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
    config = load_config([str(path)], seed=seed)
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
    "black_level": ({"frames": {"black_level_dn": 2.5}}, 0.5),
    "exposure_blur": ({"frames": {"exposure_us": 5000.0}}, 0.8),
    "clock_offset": ({"frames": {"clock_offset_us": 6000.0}}, 0.2),
    "clock_drift": ({"frames": {"clock_drift_ppm": 30000.0}}, 0.2),
    "misregistration": ({"frames": {"shift_px": [0.6, -0.4]}}, 0.3),
    "dark_current": ({"pixel": {"dark_current": {"dn": 6.0}}}, 0.2),
    "readout": ({"readout": {"arbiter": {"event_ns": 9000.0, "row_ns": 60000.0}}}, 0.5),
    "timestamp_tick": ({"readout": {"tick_us": 4000.0}}, 0.3),
}


@pytest.mark.parametrize("name", SAME)
def test_adding_the_effect_brings_the_events_of_the_camera(name, tmp_path):
    hidden, left = SAME[name]
    camera = camera_with(hidden)
    without = errors(camera, package(camera, {}, tmp_path / "without.yaml"))
    found = errors(camera, package(camera, hidden, tmp_path / "with.yaml"))
    print(name, without, found, found / without)
    assert np.mean(found) < left * np.mean(without)
    assert np.mean(found) < 0.15
