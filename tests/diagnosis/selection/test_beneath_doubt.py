"""Effects that change less, in all, than what is made up between the frames may."""

import numpy as np
import pytest
from made_up.sampler import GONE, RECORDING, STATISTICS, MadeUpSampler, candidates, search_of

from adv2e.config import Config, load_config
from adv2e.diagnosis.data import splits
from adv2e.diagnosis.outcome.verdict import verdict_of
from adv2e.diagnosis.selection import search as search_module
from adv2e.diagnosis.selection.search import PER_LOOK
from adv2e.diagnosis.statistics.summary import VIEWS
from adv2e.diagnosis.statistics.uncertainty import FrameError

SAMPLER = MadeUpSampler(strength=40.0)
HIDDEN = ["pixel.leak.rate_hz=4"]


def outcome_of(truth, bias=0.0, sd=6.0, of_view=None, made_up=0.0):
    """Return the search and its outcome; `of_view`: what another recording has in one view.

    Every statistic is off by `made_up` deviations, by chance one way or the other in each view.
    """
    observed = SAMPLER.measure(load_config([], truth), RECORDING)
    for view, other in (of_view or {}).items():
        observed[view] = SAMPLER.measure(load_config([], other), RECORDING)[view]
    observed += made_up * np.random.default_rng(4).choice([-1.0, 1.0], observed.shape)
    error = FrameError(
        np.broadcast_to(bias, (VIEWS, STATISTICS)), np.full((VIEWS, STATISTICS), float(sd))
    )
    search = search_of(SAMPLER, observed, Config(), candidates(), error=error)
    return search, search.run()


def test_an_effect_that_frames_may_hide_is_named_where_it_alone_does_what_is_left():
    search, outcome = outcome_of(HIDDEN)
    declared = search.declared
    assert search.probability(declared) > PER_LOOK  # nothing seems to be missing
    assert outcome.state.names == ("leak",)
    assert verdict_of(outcome, GONE) == "explained"
    assert outcome.state.config.pixel.leak.rate_hz == pytest.approx(4.0, rel=0.15)


@pytest.mark.parametrize("part", [splits.VALIDATION, splits.TEST])
def test_it_has_to_be_in_both_parts_that_it_was_not_fitted_to(part):
    _, outcome = outcome_of(HIDDEN, of_view={part: []})
    assert outcome.state.names == ()
    assert verdict_of(outcome, GONE) == "consistent"
    assert outcome.rejected == {}


def test_what_leaving_out_frames_changes_alike_is_no_effect():
    pattern = SAMPLER.mean(load_config([], HIDDEN)) - SAMPLER.mean(Config())
    _, outcome = outcome_of(HIDDEN, bias=0.4 * pattern)
    assert outcome.state.names == ()
    _, outcome = outcome_of(HIDDEN, bias=0.4 * np.roll(pattern, 1))
    assert outcome.state.names == ("leak",)


def test_frames_that_tell_too_little_are_no_effect():
    _, outcome = outcome_of([], made_up=6.0)
    assert outcome.state.names == ()
    assert verdict_of(outcome, GONE) == "consistent"


def test_where_frames_tell_enough_nothing_more_is_tried(monkeypatch):
    monkeypatch.setattr(search_module, "with_one_more", None)
    _, outcome = outcome_of([], sd=0.3)
    assert outcome.state.names == ()
