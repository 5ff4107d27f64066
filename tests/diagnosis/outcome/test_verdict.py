"""What is said at the end of a search: verdict, sentence, findings and their intervals."""

import dataclasses

import numpy as np
import pytest
from made_up.sampler import GONE, HINTS, candidates, error, searched
from made_up.streams import stream_of
from scipy.stats import chi2

from adv2e.config import Config, load_config
from adv2e.diagnosis.data.evidence import Evidence
from adv2e.diagnosis.fitting.candidates import Candidate, FitParameter
from adv2e.diagnosis.fitting.fitted import Fitted
from adv2e.diagnosis.fitting.library import library
from adv2e.diagnosis.hints.readouts import Burst, Pulse
from adv2e.diagnosis.outcome.findings import about_drifts, finding_of, rejected_of
from adv2e.diagnosis.outcome.verdict import sentence_of, verdict_of
from adv2e.reports.quantities import interval_text

DECLARED = Config()
SHIFT = tuple(
    FitParameter("frames.shift_px", -20.0, 20.0, False, 0.3, (part, 2)) for part in (0, 1)
)


def test_what_is_missing_in_the_last_part_alone_is_not_overlooked():
    leak = ["pixel.leak.rate_hz=4"]
    search, outcome = searched(last_truth=leak)
    verdict = verdict_of(outcome, GONE)
    assert verdict == "unexplained"
    assert "in the test data" in sentence_of(verdict, search.declared, outcome, DECLARED)
    _, outcome = searched(leak, last_truth=[*leak, "pixel.refractory.period_us=900"])
    assert outcome.state.names == ("leak",)
    verdict = verdict_of(outcome, GONE)
    assert verdict == "partly_explained"
    told = sentence_of(verdict, outcome.state, outcome, DECLARED)
    assert told.endswith("left in the test data.")


@pytest.mark.parametrize(
    ("sets", "wrong"),
    [
        (["pixel.leak.rate_hz=4"], "lacks leak"),
        (["pixel.thresholds.off=0.26"], "is wrong in thresholds"),
        (
            ["pixel.refractory.period_us=5000", "pixel.thresholds.off=0.26"],
            "lacks refractory and is wrong in thresholds",
        ),
    ],
)
def test_the_sentence_tells_what_is_lacking_from_what_is_otherwise(sets, wrong):
    _, outcome = searched(sets)
    bare = Config(pixel=dataclasses.replace(Config().pixel, leak=None, refractory=None))
    told = sentence_of("explained", outcome.state, outcome, bare)
    assert (
        told
        == f"The declared model {wrong}; with what was fitted, nothing is left that can be seen."
    )
    told = sentence_of("explained", outcome.state, outcome, outcome.state.config)
    assert "lacks" not in told


def test_what_frames_leave_of_the_error_is_not_asked_of_an_effect():
    _, outcome = searched(["pixel.leak.rate_hz=4"])
    stays = error(0.304, 0.304, 0.262, spread=0.01)
    assert verdict_of(outcome, stays) == "unexplained"
    # with so much made up between the frames, the error tells nothing of an effect
    assert verdict_of(outcome, stays, interpolated=0.135) == "explained"
    # but where there is more than that, it does
    larger = error(0.8, 0.7, 0.262, spread=0.01)
    assert verdict_of(outcome, larger, interpolated=0.135) == "unexplained"
    assert verdict_of(outcome, error(0.8, 0.35, 0.262), interpolated=0.135) == "explained"


@pytest.mark.parametrize("shift", ["[0, 2]", "[2, 0]"])
def test_any_key_of_an_effect_makes_it_one_that_is_there(shift):
    fit = Fitted(Candidate("misregistration", SHIFT, ()), DECLARED, np.zeros(2))
    _, outcome = searched(["pixel.leak.rate_hz=4"])
    state = dataclasses.replace(outcome.state, fits=(fit,))
    for sets, wrong in (([f"frames.shift_px={shift}"], "is wrong in"), ([], "lacks")):
        told = sentence_of("explained", state, outcome, load_config([], sets))
        assert f"The declared model {wrong} misregistration" in told


@pytest.mark.parametrize(("declared", "wrong"), [(0.0, "lacks"), (10.0, "is wrong in")])
def test_a_key_that_is_read_off_makes_an_effect_one_that_is_there(declared, wrong):
    one = Candidate("timestamp_tick", (), ((),), (("readout.tick_us", 100.0),))
    fit = Fitted(one, DECLARED, np.zeros(0))
    _, outcome = searched(["pixel.leak.rate_hz=4"])
    state = dataclasses.replace(outcome.state, fits=(fit,))
    config = load_config([], [f"readout.tick_us={declared}"])
    told = sentence_of("explained", state, outcome, config)
    assert f"The declared model {wrong} timestamp_tick" in told


@pytest.mark.parametrize(
    ("sets", "wrong"),
    [
        (["frames.clock_drift_ppm=100"], "lacks"),
        (["readout.frame_coupling={amplitude: 0.02, tau_us: 900}"], "is wrong in"),
    ],
)
def test_a_clock_that_drifts_is_no_frame_coupling(sets, wrong):
    bursts = (Burst(3000.0, 300.0, 0.1), Burst(4000.0, 300.0, 0.1))
    hints = dataclasses.replace(HINTS, pulse=Pulse(*bursts, 40_000.0, -6400.0))
    declared = load_config([], sets)
    one = next(one for one in library(declared, hints) if one.name == "frame_coupling")
    fit = Fitted(one, DECLARED, np.array(one.scaled(one.starts[0])))
    _, outcome = searched(["pixel.leak.rate_hz=4"])
    state = dataclasses.replace(outcome.state, fits=(fit,))
    told = sentence_of("explained", state, outcome, declared)
    assert f"The declared model {wrong} frame_coupling" in told


def test_statistics_alone_are_no_explanation():
    search, outcome = searched(["pixel.leak.rate_hz=4"])
    assert verdict_of(outcome, error(1.19, 0.75, 0.64)) == "explained"
    verdict = verdict_of(outcome, error(1.19, 0.88, 0.64))
    assert verdict == "unexplained"
    assert "leak would account" in sentence_of(verdict, search.declared, outcome, DECLARED)
    refused = {one.name: one for one in rejected_of(outcome, search.declared, candidates())}
    assert refused["leak"].reason.startswith("would account for every statistic")
    # but chance may have made it
    assert verdict_of(outcome, error(1.19, 0.80, 0.64, 0.04)) == "unexplained"
    assert verdict_of(outcome, error(1.19, 0.80, 0.64, 0.06)) == "explained"
    assert verdict_of(outcome, error(0.65, 0.66, 0.64)) == "explained"  # says nothing of leak
    assert verdict_of(outcome, error(0.45, 0.38, 0.42)) == "explained"


def test_intervals_of_a_list_are_lists():
    fit = Fitted(Candidate("misregistration", SHIFT, ()), Config(), np.array([1.0, -2.0]))
    fit.covariance = np.diag([0.01, 0.04])
    finding = finding_of(fit, 100, fit.config)
    assert finding.parameters == {"frames.shift_px": [pytest.approx(0.3), pytest.approx(-0.6)]}
    low, high = finding.interval["frames.shift_px"]
    assert low == pytest.approx((0.3 - 0.3 * 0.196, -0.6 - 0.3 * 0.392))
    assert high == pytest.approx((0.3 + 0.3 * 0.196, -0.6 + 0.3 * 0.392))
    assert interval_text((low, high)) == "[0.2412, -0.7176] to [0.3588, -0.4824]"


def test_of_a_share_of_pixels_no_more_is_known_than_its_number_tells():
    (dead,) = candidates("dead_pixels")
    fit = Fitted(dead, Config(), np.array(dead.scaled([0.01])), covariance=np.array([[0.001**2]]))
    for pixels, near in ((400, 0.5), (40_000, 0.01)):
        found = finding_of(fit, pixels, fit.config).interval["pixel.dead_pixels.fraction"]
        n = 0.01 * pixels
        counted = 0.5 * np.array([chi2.ppf(0.025, 2 * n), chi2.ppf(0.975, 2 * n + 2)])  # Garwood's
        assert list(found) == pytest.approx(counted / pixels, rel=near)


def test_from_when_on_drifts_count_in_a_piece_of_a_recording():
    frames, times_s = [np.zeros((2, 2), np.uint8)] * 26, 10.0 + 0.04 * np.arange(26)
    whole = Evidence("whole", frames, times_s, stream_of([], [], [], []), 2, 2)
    piece = whole.during(13, 25)
    drifting = load_config([], ["frames.clock_drift_ppm=300"])
    assert about_drifts(whole, drifting) == about_drifts(piece, DECLARED) == []
    (told,) = about_drifts(piece, drifting)
    counts = "clock_drift_ppm counts from the first frame simulated, at"
    assert told == f"in model.yaml {counts} {piece.run_in.times_s[0]:.3f} s"
    both = load_config([], ["frames.clock_drift_ppm=300", "pixel.thresholds.drift_per_s=0.1"])
    assert "clock_drift_ppm and drift_per_s" in about_drifts(piece, both)[0]
