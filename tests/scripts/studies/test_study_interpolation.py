from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import onnx_models
import pytest
from studies import interpolation as study
from studies import interpolation_scenes as scenes
from studies.interpolation_report import report

from adv2e.events import make_events


def test_nearest_is_of_the_same_pixel_and_polarity():
    of = make_events([1000, 5000, 9000], [3, 3, 3], [1, 1, 1], [1, 1, 1])
    among = make_events(
        [1200, 1001, 4000, 5001, 9300], [3, 3, 3, 4, 3], [1, 1, 1, 1, 1], [1, 0, 1, 1, 1]
    )
    # 0.2, 1.0 and 0.3 ms away
    assert study.nearest_ms(of, among, 8) == pytest.approx(0.3)


def test_nearest_of_events_that_have_none_is_infinite():
    of = make_events([1000, 2000, 3000], [3, 5, 6], [1, 1, 1], [1, 1, 1])
    assert math.isinf(study.nearest_ms(of, of[:1], 8))


def test_distance_is_zero_to_itself_and_one_to_no_events():
    setup = study.Setup(8, 6, 0.1, 0)
    true = make_events([1000, 12_000, 41_000], [3, 5, 6], [1, 2, 4], [1, 0, 1])
    times_ns = study.frame_times_ns(0.1, 30.0)
    assert study.distance(true, true, times_ns, setup) == 0.0
    assert study.distance(true, true[:0], times_ns, setup) == pytest.approx(1.0)


def test_nothing_moves_far_between_true_pictures():
    for case in scenes.cases(0):
        assert case.true_hz(180) >= 2000.0
        assert case.speed(180) / case.true_hz(180) <= 0.25


def test_clips_are_whole_frames_at_every_rate():
    for case in scenes.cases(0):
        for longest_s in (0.5, 1 / 6):
            duration = min(longest_s, case.duration_s)
            for rate in study.RATES:
                times_ns = study.frame_times_ns(duration, rate)
                assert times_ns[-1] == pytest.approx(duration * 1e9, abs=1)


def test_light_of_every_case_is_smooth_in_time():
    for case in scenes.cases(0):
        step = 1.0 / case.true_hz(64)
        start = 0.05
        pictures = [case.light(start + k * step, 80, 64) for k in range(3)]
        change = np.abs(pictures[1] - pictures[0])
        again = np.abs(pictures[2] - 2 * pictures[1] + pictures[0])
        assert pictures[0].dtype == np.float32
        assert 0.0 < change.max() < 80.0
        assert again.mean() < 0.5 * change.mean()


def test_flow_is_nearer_than_linear_where_things_move():
    setup = study.Setup(64, 48, 1 / 15, 0)
    pan = scenes.cases(0)[1]
    row = study.study(replace(pan, duration_s=1 / 12), setup, study.methods_of(setup, [], 1.0))[1]
    assert row.rate == 30.0
    scores = row.scores
    assert scores["perfect"].distance < scores["flow"].distance < 0.6 * scores["linear"].distance
    assert scores["flow"].made_to_true_ms < 0.3 * scores["linear"].made_to_true_ms
    assert abs(math.log(scores["flow"].ratio)) < abs(math.log(scores["linear"].ratio))
    # as few frames as needed: half as many, and hardly worse
    assert row.frames["flow"] == 10
    assert 5 <= row.frames["flow, 1 px"] <= 8
    assert scores["flow, 1 px"].distance < 0.6 * scores["linear"].distance


def test_networks_stand_beside_under_the_names_of_their_files(tmp_path):
    blend = onnx_models.blend(tmp_path / "blends.onnx", encoding="linear")
    setup = study.Setup(32, 24, 1 / 15, 0)
    methods = study.methods_of(setup, [Path(blend)], None)
    assert list(methods) == ["linear", "flow", "blends", "perfect"]
    short = replace(scenes.cases(0)[1], duration_s=1 / 12)
    rows = study.study(short, setup, methods)
    scores = rows[1].scores
    # what blends light is linear interpolation
    assert scores["blends"].distance == pytest.approx(scores["linear"].distance, rel=1e-2)
    text = report(rows, study.costs(0, [(32, 24)], methods))
    assert "Each cell: linear / flow / blends / perfect." in text
    assert "| 32 x 24 | blends |" in text
