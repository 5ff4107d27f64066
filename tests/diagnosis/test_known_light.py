"""Diagnoses of known light before the brute-force camera, which shares no code with adv2e.

The library holds what is tried here, and simulations are few; how often diagnoses of all of it are
right is measured by ``scripts/studies/diagnosis.py --known-light``.
"""

import json

import pytest
from camera import Camera
from camera.catalogue import cases
from camera.stimulus import bench, scene, write_table

from adv2e.diagnosis import prepare
from adv2e.diagnosis.fitting.library import names
from adv2e.diagnosis.outcome import verdict
from adv2e.diagnosis.selection import reference, shortlist

SIZE, SECONDS = (12, 10), 0.5


@pytest.fixture(autouse=True)
def _short(monkeypatch):
    """Simulate less often than a diagnosis that is to be believed."""
    monkeypatch.setattr(reference, "MANY", 40)
    for module in (reference, shortlist):
        monkeypatch.setattr(module, "SOME", 16)
    monkeypatch.setattr(prepare, "PILOT_SEEDS", range(10_000, 10_004))
    monkeypatch.setattr(verdict, "DRAWS", 4)


@pytest.fixture
def diagnosed(adv2e, tmp_path):
    """Return what records and diagnoses a camera with something hidden; gives its report."""

    def run(hidden, seed, *tried):
        without = [part for name in names() if name not in tried for part in ("--without", name)]
        rows, path = bench(SECONDS, seed), tmp_path / "led.zip"
        Camera(
            scene(rows), hidden=hidden, size=SIZE, duration_s=SECONDS, fps=10.0, seed=seed
        ).record(path)
        write_table(tmp_path / "stimulus.csv", rows)
        outcome = adv2e(
            "diagnose", path, "--light", tmp_path / "stimulus.csv",
            "-c", tmp_path / "led.declared.yaml", "-o", tmp_path / "out", *without,
        )  # fmt: skip
        assert outcome.status == 0, outcome.err
        return json.loads((tmp_path / "out" / "report.json").read_text("utf-8"))

    return run


@pytest.mark.thorough
def test_nothing_is_missing_of_a_camera_as_declared(diagnosed):
    found = diagnosed({}, 2, "refractory", "low_pass")
    assert (found["verdict"], found["effects"]) == ("consistent", [])
    assert found["facts"]["light"].endswith("stimulus.csv")
    assert not any("frames" in note for note in found["notes"])


@pytest.mark.parametrize(
    ("name", "size", "rival", "key", "truth", "within"),
    [
        ("refractory", "middle", "leak", "pixel.refractory.period_us", 4000.0, 0.02),
        ("leak", "large", "refractory", "pixel.leak.rate_hz", 6.0, 0.12),
    ],
)
@pytest.mark.thorough
def test_an_effect_is_named_and_fitted(diagnosed, name, size, rival, key, truth, within):
    found = diagnosed(next(cases(name, size=size)).hidden, 2, name, rival)
    assert [effect["name"] for effect in found["effects"]] == [name]
    assert found["alternatives"] == []
    assert found["effects"][0]["parameters"][key] == pytest.approx(truth, rel=within)
    low, high = found["effects"][0]["interval"][key]
    assert low < truth < high
    assert high - low < 2.5 * within * truth
