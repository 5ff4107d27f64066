"""The whole diagnosis of small recordings by the brute-force camera, which shares no code with it.

Effects are so large that only one verdict is right; how often smaller ones are found is measured by
``scripts/studies/diagnosis.py``.
"""

import pytest
from camera import Camera, patchwork
from camera.catalogue import cases

from adv2e.config import load_config
from adv2e.diagnosis.data.evidence import read_evidence
from adv2e.diagnosis.diagnose import diagnose
from adv2e.diagnosis.fitting.library import names

SIZE, SECONDS, FPS = (32, 24), 0.25, 400.0

RIVALS = {"event_loss", "high_pass", "leak", "low_pass", "refractory", "thresholds"}
"""The effects that compete where there is one: with all, it takes five times as long."""


def diagnosis_of(hidden, seed, folder, without=()):
    path = folder / "recording.zip"
    Camera(
        patchwork(SIZE, seed=seed), hidden=hidden, size=SIZE, duration_s=SECONDS, fps=FPS,
        seed=seed, step_us=50.0,
    ).record(path)  # fmt: skip
    declared = load_config([path.with_name("recording.declared.yaml")])
    return diagnose(read_evidence(path), declared, without=without)


def large(name):
    return next(cases(name, size="large")).hidden


@pytest.mark.thorough
def test_nothing_is_found_where_nothing_is_missing(tmp_path):
    found = diagnosis_of({}, 1, tmp_path)
    assert found.verdict == "consistent"
    assert found.effects == []
    assert found.errors[0].after.value == found.errors[0].before.value


@pytest.mark.parametrize(
    ("name", "key", "truth", "seed"),
    [
        ("leak", "pixel.leak.rate_hz", 6.0, 3),
        pytest.param("event_loss", "readout.loss.fraction", 0.45, 4, marks=pytest.mark.thorough),
        pytest.param("high_pass", "pixel.high_pass.cutoff_hz", 4.0, 2, marks=pytest.mark.thorough),
    ],
)
def test_a_large_effect_is_named_and_fitted(name, key, truth, seed, tmp_path):
    found = diagnosis_of(large(name), seed, tmp_path, without={*names()} - RIVALS)
    assert [effect.name for effect in found.effects] == [name]
    assert found.alternatives == []
    assert found.effects[0].parameters[key] == pytest.approx(truth, rel=0.1)
    error = found.errors[0]
    assert error.before.value > 1.1 * error.floor.value > error.after.value
    assert found.global_p_before < 1e-6


@pytest.mark.thorough
def test_no_name_explains_an_effect_that_the_library_lacks(tmp_path):
    found = diagnosis_of(large("sign_flips"), 4, tmp_path, without={*names()} - RIVALS)
    assert found.verdict in ("unexplained", "partly_explained")
    assert found.global_p_before < 1e-6
