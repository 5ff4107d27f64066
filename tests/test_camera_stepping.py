"""Effects of the stepping path as the brute-force camera has them, alone and together."""

import numpy as np
import pytest
from camera import Camera
from camera.settings import BENCH, merged
from test_camera import DURATION_S, SCENE, SIZE, STILL, by_pixel, measured, simulated

pytestmark = pytest.mark.thorough

HIDDEN = {
    "slew limit": {"slew_limit": {"per_s": 15.0}},
    "high-pass": {"high_pass": {"cutoff_hz": 8.0}},
    "overshoot": {"reset_overshoot": {"fraction": 0.3}},
    "undershoot, no dead time": {"reset_overshoot": {"fraction": -0.3}, "refractory": None},
    "drift": {"thresholds": {"drift_per_s": 2.0}},
    "all": {
        "slew_limit": {"per_s": 20.0},
        "reset_overshoot": {"fraction": 0.2},
        "thresholds": {"drift_per_s": -1.0},
        "source_follower": {"cutoff_hz": 80.0},
    },
}


def camera(settings, seed=1):
    return Camera(SCENE, settings, size=SIZE, duration_s=DURATION_S, step_us=25.0, seed=seed)


@pytest.mark.parametrize("name", HIDDEN)
def test_without_anything_random_the_events_are_the_same(name, tmp_path):
    settings = merged(BENCH, STILL, {"pixel": HIDDEN[name]})
    ours = by_pixel(simulated(settings, tmp_path / "camera.yaml"))
    theirs = by_pixel(measured(camera(settings)))
    plain = by_pixel(simulated(merged(BENCH, STILL), tmp_path / "plain.yaml"))
    counts, expected = ([len(times) for times, _ in events] for events in (ours, theirs))
    assert sum(expected) > 1000
    assert abs(sum(len(times) for times, _ in plain) - sum(expected)) > 0.02 * sum(expected)
    same = np.array(counts) == np.array(expected)
    assert same.mean() > 0.95
    apart = np.concatenate(
        [a - b for (a, _), (b, _), equal in zip(ours, theirs, same, strict=True) if equal]
    )
    assert np.median(abs(apart)) <= 3


def test_with_noise_and_mismatch_the_totals_agree(tmp_path):
    noisy = {
        "shot_noise": {"rate_hz": 5.0},
        "photoreceptor_noise": {"rms": 0.05},
        "thresholds": {"mismatch": 0.03},
        "hot_pixels": {"fraction": 0.02, "rate_hz": 80.0},
    }
    settings = merged(BENCH, {"pixel": HIDDEN["all"]}, {"pixel": noisy})
    ours = [len(simulated(settings, tmp_path / "camera.yaml", seed=seed)) for seed in range(4)]
    theirs = [len(measured(camera(settings, seed=seed))) for seed in range(2)]
    spread = np.std(ours, ddof=1) * np.sqrt(1 / len(ours) + 1 / len(theirs))
    assert abs(np.mean(ours) - np.mean(theirs)) < 4.0 * max(spread, 0.003 * np.mean(ours))
