"""What is said at the end of a search: verdict, remark, findings and their intervals."""

from dataclasses import replace
from typing import get_args

import numpy as np
import pytest
from made_up.sampler import GONE, candidates, error, outside, searched
from made_up.streams import stream_of
from scipy.stats import chi2

from adv2e.config import Config, load_config
from adv2e.diagnosis.data.evidence import Evidence
from adv2e.diagnosis.fitting.candidates import Candidate, FitParameter
from adv2e.diagnosis.fitting.fitted import Fitted
from adv2e.diagnosis.outcome.findings import about_drifts, finding_of, rejected_of
from adv2e.diagnosis.outcome.verdict import remark_of, verdict_of
from adv2e.reports.quantities import interval_text
from adv2e.reports.result import Verdict

DECLARED = Config()
SHIFT = tuple(
    FitParameter("frames.shift_px", -20.0, 20.0, False, 0.3, (part, 2)) for part in (0, 1)
)


def test_what_is_missing_in_the_last_part_alone_is_not_overlooked():
    leak = ["pixel.leak.rate_hz=4"]
    _, outcome = searched(last_truth=leak)
    verdict = verdict_of(outcome, GONE)
    assert verdict == "unexplained"
    assert "in the test data" in remark_of(verdict, outcome)
    _, outcome = searched(leak, last_truth=[*leak, "pixel.refractory.period_us=900"])
    assert outcome.state.names == ("leak",)
    verdict = verdict_of(outcome, GONE)
    assert verdict == "partly_explained"
    assert "; something is left in the test data: use the model found" in remark_of(
        verdict, outcome
    )


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


@pytest.mark.parametrize(
    ("explained", "verdict"), [(0.6, "partly_explained"), (0.4, "unexplained")]
)
def test_an_effect_that_bursts_show_is_named_if_it_explains_most(explained, verdict):
    _, outcome = searched(["pixel.leak.rate_hz=4"])
    (fit,) = outcome.state.fits

    def left(is_seen):
        candidate = replace(fit.candidate, is_seen=is_seen)
        state = replace(outcome.state, fits=(replace(fit, candidate=candidate),))
        return replace(outcome, state=state, explained=explained, complete=False)

    error_falls = error(0.9, 0.6, 0.5, spread=0.01)
    assert verdict_of(left(True), error_falls) == verdict
    assert verdict_of(left(False), error_falls) == "unexplained"


@pytest.mark.parametrize("verdict", get_args(Verdict))
def test_every_verdict_has_a_remark(verdict):
    _, outcome = searched(["pixel.leak.rate_hz=4"])
    told = remark_of(verdict, outcome)
    assert told[0].isupper()
    advice = {
        "consistent": "keep that model as it is",
        "explained": "use the model found",
        "partly_explained": "use the model found, but know what still differs",
        "not_identifiable": "only another recording tells which is right",
        "unexplained": "Do not add it",
    }
    assert told.endswith(f"{advice[verdict]}.")
    # what was found is told by the sentence, with its numbers
    assert ("leak" in told) == (verdict == "unexplained")


def test_statistics_alone_are_no_explanation():
    search, outcome = searched(["pixel.leak.rate_hz=4"])
    assert verdict_of(outcome, error(1.19, 0.75, 0.64)) == "explained"
    verdict = verdict_of(outcome, error(1.19, 0.88, 0.64))
    assert verdict == "unexplained"
    assert remark_of(verdict, outcome).startswith("The nearest is leak: numbers of events are")
    refused = {
        one.name: one
        for one in rejected_of(search.reference, outcome, search.declared, candidates())
    }
    assert refused["leak"].reason.startswith("would account for every statistic")
    # but chance may have made it
    assert verdict_of(outcome, error(1.19, 0.80, 0.64, 0.04)) == "unexplained"
    assert verdict_of(outcome, error(1.19, 0.80, 0.64, 0.06)) == "explained"
    assert verdict_of(outcome, error(0.65, 0.66, 0.64)) == "explained"  # says nothing of leak
    assert verdict_of(outcome, error(0.45, 0.38, 0.42)) == "explained"


@pytest.mark.thorough
def test_what_was_not_added_is_told_with_the_share_that_it_explains():
    search, outcome = searched(["pixel.leak.rate_hz=4"], beyond=outside(8.0))
    given = rejected_of(search.reference, outcome, search.declared, candidates())
    assert {"leak", "refractory"} <= {one.name for one in given}
    left = [one.held_out for one in given]
    assert left == sorted(left)
    assert given[0].name == "leak"
    # of squares: those of the leak are gone, those of nothing else
    assert 0.0 < given[0].held_out < 0.6
    assert all(0.6 < share < 1.2 for share in left[1:])


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
    assert told.startswith(f"in model.yaml {counts} {piece.run_in.times_s[0]:.3f} s: for another")
    both = load_config([], ["frames.clock_drift_ppm=300", "pixel.thresholds.drift_per_s=0.1"])
    assert "clock_drift_ppm and drift_per_s" in about_drifts(piece, both)[0]
