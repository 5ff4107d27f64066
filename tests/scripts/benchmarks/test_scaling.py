"""The points and the figure of benchmarks/scaling.py, and of benchmarks/limits.py."""

from __future__ import annotations

import numpy as np
import pytest
from benchmarks import limits, processes, settings
from benchmarks import scaling as script


@pytest.fixture
def scaling(monkeypatch):
    monkeypatch.setattr(settings, "stored", lambda clip, folder: folder / f"{clip.name}.npy")
    return script


@pytest.mark.parametrize("quick", [False, True])
def test_points_have_names_of_their_own_and_reach_the_ends(scaling, tmp_path, quick):
    points = list(scaling.samples(settings.Plan(tmp_path, quick, None)))
    assert len({point.job.name for point in points}) == len(points)
    ends = {"frames a second": 960, "K": 100, "share that moves": 1, "contrast [ln]": 1.5}
    for axis, most in ends.items():
        assert max(point.value for point in points if point.axis == axis) == most
    assert any(point.label == "3840x2160" for point in points)


def test_one_quantity_is_varied_at_a_time(scaling, tmp_path):
    plan = settings.Plan(tmp_path, False, None)
    for axis, _, _, clip in scaling.varied_clips(plan):
        changed = {
            key for key, value in vars(clip).items() if value != vars(scaling.base_of(plan))[key]
        }
        assert changed <= {"width", "height", "frames"} if axis == "megapixels" else {axis}
        assert len(changed) <= (3 if axis == "megapixels" else 1)


def test_figure_and_table_hold_every_point(scaling, tmp_path):
    pytest.importorskip("matplotlib")
    points = list(scaling.samples(settings.Plan(tmp_path, True, None)))
    report = {"wall_s": 1.0, "cpu_s": 2.0, "events": 50, "pixels": 10, "frames": 10, "versions": {}}
    measured = {
        point.job.name: processes.Measured(point.job, [processes.Round(report, 1.0, None)])
        for point in points
    }
    text = scaling.report(points, measured)
    assert text.count("\n| ") == len(points) + 2
    assert "10,000,000" in text  # 1 s for 100 pixel-frames
    out = tmp_path / "scaling.md"
    scaling.write(out, points, measured)
    assert out.with_suffix(".png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(("kind", "error"), [(np.float32, 3e-7), (np.float64, 5e-8)])
def test_polynomial_of_the_limits_is_the_exponential(kind, error):
    x = np.linspace(-1, 0, 1001).astype(kind)
    y = np.empty_like(x)
    name = "exp_polynomial32" if kind is np.float32 else "exp_polynomial64"
    getattr(limits, name).py_func(x, y)
    assert np.max(np.abs(y / np.exp(x.astype(float)) - 1)) < error


def test_limits_are_rates():
    effort = limits.Effort(megabytes=1, events=100, repeats=3, threads=1)
    ran = []
    limit = limits.rate("sums", 5.0, "M/s", effort, [lambda: ran.append(sum(range(1000)))])
    assert len(ran) == 4
    assert 0 < limit.median <= limit.best
    assert "| sums | 1 |" in limits.report([limit])
