"""Scores of the study of the diagnosis."""

import pytest
from studies import scoring
from study_lines import found, line_of


def outcome_of(effects, verdict, added, alternatives=(), kind="library"):
    line = line_of(kind, effects, verdict=verdict, alternatives=list(alternatives))
    return scoring.outcome({**line, "found": [found(name) for name in added]})


@pytest.mark.parametrize(
    ("verdict", "added", "alternatives", "outcome"),
    [
        ("explained", ["leak"], [], "named alone"),
        ("not_identifiable", ["leak"], ["photo_leak"], "among look-alikes"),
        ("not_identifiable", ["photo_leak"], ["leak"], "among look-alikes"),
        ("explained", ["photo_leak"], [], "wrong name"),
        ("not_identifiable", ["photo_leak"], ["shot_noise"], "wrong name"),
        ("explained", ["leak", "flicker"], [], "named beside a wrong name"),
        ("explained", ["flicker", "photo_leak"], ["leak"], "named beside a wrong name"),
        ("partly_explained", ["leak"], [], "named, something left"),
        ("partly_explained", ["flicker"], [], "wrong name, something left"),
        ("unexplained", [], [], "unexplained"),
        ("consistent", [], [], "missed"),
    ],
)
def test_outcomes_of_one_effect(verdict, added, alternatives, outcome):
    assert outcome_of(("leak",), verdict, added, alternatives) == outcome


@pytest.mark.parametrize(
    ("verdict", "added", "alternatives", "outcome"),
    [
        ("explained", ["leak", "flicker"], [], "both named"),
        ("partly_explained", ["flicker", "leak"], [], "both named"),
        ("not_identifiable", ["flicker", "photo_leak"], ["leak"], "both named"),
        ("explained", ["leak"], [], "one named"),
        ("explained", ["leak", "event_loss"], [], "named beside a wrong name"),
        ("explained", ["event_loss"], [], "wrong name"),
        ("consistent", [], [], "missed"),
    ],
)
def test_outcomes_of_two_effects(verdict, added, alternatives, outcome):
    effects = ("leak", "flicker")
    assert outcome_of(effects, verdict, added, alternatives, "pairs") == outcome


@pytest.mark.parametrize("kind", ["leave-one-out", "outside"])
@pytest.mark.parametrize(
    ("verdict", "added", "outcome"),
    [
        ("explained", ["shot_noise"], "wrong name"),
        ("partly_explained", ["shot_noise"], "wrong name, something left"),
        ("unexplained", [], "unexplained"),
        ("consistent", [], "missed"),
    ],
)
def test_no_name_is_right_where_the_library_lacks_it(kind, verdict, added, outcome):
    assert outcome_of(("leak",), verdict, added, kind=kind) == outcome


def test_any_verdict_but_consistent_is_a_false_alarm():
    verdicts = ("consistent", "unexplained", "partly_explained", "explained")
    seen = [outcome_of((), verdict, [], kind="nothing") for verdict in verdicts]
    assert seen == ["consistent", *["false alarm"] * 3]


def fitted(**values):
    interval = {"pixel.leak.rate_hz": [1.8, 1.9], "frames.shift_px": [[0.1, -0.7], [0.3, -0.5]]}
    truth = {"pixel.leak.rate_hz": 2.0, "frames.shift_px": [0.8, -0.6], "readout.tick_us": None}
    parameters = {"pixel.leak.rate_hz": 1.85, "readout.tick_us": 5.0, **values}
    line = line_of(effects=("leak",), truth=truth)
    return {**line, "found": [found("leak", parameters, interval), found("flicker", {"a": 9.0})]}


def test_parameters_are_compared_with_what_the_camera_did():
    line = fitted(**{"frames.shift_px": [0.8, -0.4]})
    errors = scoring.parameter_errors(line)
    assert errors == pytest.approx({"pixel.leak.rate_hz": 0.075, "frames.shift_px": 0.2})
    assert scoring.is_near(line) is False
    assert scoring.is_near(fitted()) is True
    assert scoring.is_near(line_of()) is None
    assert scoring.covered(line) == [False, False, True]


def test_gammas_are_compared_as_numbers():
    assert scoring.relative_error("gamma:1.2", "gamma:1.6") == pytest.approx(0.25)
    assert scoring.relative_error("gamma:1.2", "linear") is None


def test_intervals_of_shares():
    # Wilson's interval, by R: prop.test(3, 100, correct=FALSE)
    assert scoring.interval(3, 100) == pytest.approx((0.01025, 0.08452), abs=2e-5)
    assert scoring.interval(0, 0) == (0.0, 1.0)
    low, high = scoring.interval(50, 50)
    assert high == 1.0
    assert low == pytest.approx(50 / (50 + 1.96**2), abs=1e-3)
