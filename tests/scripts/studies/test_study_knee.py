"""The study of the knee runs on a miniature, and chooses by the rule that it states."""

import sys

import numpy as np
import pytest
from studies import knee as study
from studies import knee_report as report
from writing import load_pyplot

from adv2e.effects.pixel.log_response import LogResponse
from adv2e.errors import MissingExtraError


def scores_of(distance, rest):
    maps = tuple(str(k) for k in range(len(distance)))
    scores = report.Scores.empty(("only",), (0.0,), 2, maps)
    for seed in range(2):
        for k in range(len(maps)):
            score = report.Score(distance[k], distance[k], rest[k], np.ones(4))
            scores.put((0, 0, seed, k), score)
    return scores


def test_a_miniature_of_the_study_finds_the_old_knee_worse(monkeypatch):
    monkeypatch.setattr(
        study, "MAPS", {"log": LogResponse(linear_below=0.0), "20": LogResponse(linear_below=20.0)}
    )
    monkeypatch.setattr(study, "NOISES", (0.0,))
    setup = study.Setup(24, 18, seeds=2, fps=20.0, encoding="srgb", threads=1)
    scores, lights = study.run(setup, lambda text: None)
    log, knee = scores.distance.mean(axis=(0, 1, 2))
    assert log < knee
    assert np.all(scores.rest == 0)
    assert lights["half in 1/40 shadow"].min() < lights["as rendered"].min() / 20
    assert "Least distance at log." in study.report(scores, lights)


@pytest.mark.parametrize("encoding", ["srgb", "linear"])
def test_video_without_noise_is_off_by_half_a_code_at_most(encoding):
    light = np.linspace(0, 255, 4001, dtype=np.float32).reshape(1, 1, -1)
    codes = study.codes_of(study.filmed(light, 0.0, 0, encoding), encoding)
    assert np.abs(codes - study.codes_of(light, encoding)).max() <= 0.5 + 1e-3


def test_fewest_false_events_decide_between_nearly_equal_distances():
    scores = scores_of(distance=[0.50, 0.505, 0.60], rest=[2.0, 1.0, 0.0])
    assert report.least(scores) == 0
    assert report.recommended(scores) == 1


def test_missing_matplotlib_names_the_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(MissingExtraError, match=r"adv2e\[studies\]"):
        load_pyplot()
