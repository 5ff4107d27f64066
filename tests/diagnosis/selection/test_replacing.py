"""Others in the place of effects that were added while more was missing."""

import dataclasses

import numpy as np
import pytest
from made_up.sampler import (
    GONE,
    RECORDING,
    MadeUpSampler,
    candidates,
    fits_of,
    outside,
    refitted,
    search_of,
    searched,
)

from adv2e.config import Config, load_config
from adv2e.diagnosis.outcome.verdict import verdict_of
from adv2e.diagnosis.selection import joint_fits as joint_fits_module
from adv2e.diagnosis.selection.search import LEVEL

PAIR = ["pixel.refractory.period_us=3000", "pixel.leak.rate_hz=4"]
"""Of effects which another is like; see `sampler_with_a_mixture`."""


def sampler_with_a_mixture():
    """Return one where loss moves the statistics much as dead time and leak together do."""
    sampler = MadeUpSampler(strength=60.0)
    of_both = sampler.mean(load_config([], PAIR))
    sampler.patterns["readout.loss.fraction"] = 55.0 * of_both / np.linalg.norm(of_both) + outside(
        25.0
    )
    sampler._means.clear()
    return sampler


@pytest.mark.thorough
def test_another_takes_the_place_of_what_stood_for_two():
    sampler = sampler_with_a_mixture()
    observed = sampler.measure(load_config([], PAIR), RECORDING)
    told = []
    search = search_of(sampler, observed, Config(), candidates(), log=told.append)
    state = refitted(search, fits_of(("event_loss", 0.2), ("leak", 2.0)))
    alike = {"event_loss": frozenset({"dark_current"})}
    other = search._with_another(dataclasses.replace(state, alternatives=alike))
    assert other.names == ("leak", "refractory")
    assert other.config.pixel.refractory.period_us == pytest.approx(3000.0, rel=0.1)
    assert other.config.readout is None
    assert search.probability(other) > LEVEL
    assert other.alternatives == {}
    reason = search.reference.rejections.held["event_loss"].reason
    assert reason == "does less than refractory in its place"
    assert told[-1] == "replaced event_loss by refractory"


@pytest.mark.thorough
def test_nothing_takes_the_place_of_what_is_missing_beside_something_unknown():
    """Nor does the attempt change why other effects were not added."""
    sampler = MadeUpSampler(strength=60.0)
    observed = sampler.measure(load_config([], PAIR), RECORDING, outside(40.0))
    search = search_of(sampler, observed, Config(), candidates())
    state = refitted(search, fits_of(("refractory", 3000.0), ("leak", 4.0)))
    search.reference.rejections.add(fits_of(("event_loss", 0.1))[0], "said before", final=True)
    held = dict(search.reference.rejections.held)
    assert search._is_something_left(state)
    assert search._with_another(state) is None
    assert search.reference.rejections.held == held


@pytest.mark.thorough
def test_the_search_goes_on_from_what_was_replaced(monkeypatch):
    """Beside the mixture, only dead time is good enough to be added."""
    refused = ["something else stands out"]

    def objecting(fit, grown, ground, reference):
        if "event_loss" in grown.names:
            return [] if {"event_loss", "refractory"} >= set(grown.names) else refused
        return refused if len(grown.names) == 1 else []

    monkeypatch.setattr(joint_fits_module, "objections", objecting)
    truth, told = [*PAIR, "pixel.thresholds.off=0.22"], []
    _, outcome = searched(truth, sampler_with_a_mixture(), log=told.append)
    steps = [line.partition(":")[0] for line in told if line.startswith(("added", "replaced"))]
    assert steps[:2] == ["added event_loss", "added event_loss, refractory"]
    assert steps[2].startswith("replaced event_loss by")
    assert len(steps) == 4
    assert set(outcome.state.names) == {"refractory", "leak", "thresholds"}
    assert outcome.rejected["event_loss"].reason
    assert verdict_of(outcome, GONE) == "explained"
