"""What published measurements say; they are not part of the project."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from real import latency
from real.iebcs import read_levels

FOLDER = os.environ.get("ADV2E_REAL_DATA")

pytestmark = pytest.mark.skipif(
    not FOLDER, reason="ADV2E_REAL_DATA does not name a folder of recordings"
)


def test_latencies_depart_from_one_over_light_by_a_floor():
    measured = latency.read(Path(FOLDER) / "latency-nist" / "latency_summary.csv")
    found = latency.one(measured, "CAM2", "CAM1", 1.0, seed=0)
    assert [effect.name for effect in found.effects] == ["source_follower"]
    assert found.errors[0].before.value > 0.3
    assert found.errors[0].after.value < 0.1


def test_noise_rates_fall_as_the_light_rises():
    dark, room, bright = read_levels(Path(FOLDER) / "noise-iebcs")
    assert dark.mean_hz("off") > 1000 * room.mean_hz("off")
    assert bright.mean_hz("off") == 0.0
    assert bright.median_hz("on") > room.median_hz("on")
