"""Others in the place of effects that were added while more was missing."""

import dataclasses

import numpy as np
import pytest
from made_up_laboratory import (
    GONE,
    RECORDING,
    MadeUpLaboratory,
    candidates,
    fits_of,
    outside,
    refitted,
    searched,
)

from adv2e.config import Config, load_config
from adv2e.diagnosis.outcome.verdict import verdict_of
from adv2e.diagnosis.selection import joint_fits as attempts_module
from adv2e.diagnosis.selection.search import LEVEL, Search

PAIR = ["pixel.refractory.period_us=3000", "pixel.leak.rate_hz=4"]
"""Of effects which another is like; see `laboratory_with_a_mixture`."""


def laboratory_with_a_mixture():
    """Return one where loss moves the statistics much as dead time and leak together do."""
    laboratory = MadeUpLaboratory(strength=60.0)
    of_both = laboratory.mean(load_config([], PAIR))
    laboratory.patterns["readout.loss.fraction"] = 55.0 * of_both / np.linalg.norm(
        of_both
    ) + outside(25.0)
    laboratory._means.clear()
    return laboratory


def test_another_takes_the_place_of_what_stood_for_two():
    laboratory = laboratory_with_a_mixture()
    observed = laboratory.measure(load_config([], PAIR), RECORDING)
    told = []
    search = Search(laboratory, observed, Config(), candidates(), log=told.append)
    state = refitted(search, fits_of(("event_loss", 0.2), ("leak", 2.0)))
    alike = {"event_loss": frozenset({"dark_current"})}
    other = search._with_another(dataclasses.replace(state, alternatives=alike))
    assert other.names == ("leak", "refractory")
    assert other.config.pixel.refractory.period_us == pytest.approx(3000.0, rel=0.1)
    assert other.config.readout is None
    assert search.probability(other) > LEVEL
    assert other.alternatives == {}
    reason = search.bench.rejections.held["event_loss"].reason
    assert reason == "does less than refractory in its place"
    assert told[-1] == "replaced event_loss by refractory"


def test_nothing_takes_the_place_of_what_is_missing_beside_something_unknown():
    """Nor does the attempt change why other effects were not added."""
    laboratory = MadeUpLaboratory(strength=60.0)
    observed = laboratory.measure(load_config([], PAIR), RECORDING, outside(40.0))
    search = Search(laboratory, observed, Config(), candidates())
    state = refitted(search, fits_of(("refractory", 3000.0), ("leak", 4.0)))
    search.bench.rejections.add(fits_of(("event_loss", 0.1))[0], "said before", final=True)
    held = dict(search.bench.rejections.held)
    assert search._is_something_left(state)
    assert search._with_another(state) is None
    assert search.bench.rejections.held == held


def test_the_search_goes_on_from_what_was_replaced(monkeypatch):
    """Beside the mixture, only dead time is good enough to be added."""
    refused = ["something else stands out"]

    def objecting(fit, grown, ground, bench):
        if "event_loss" in grown.names:
            return [] if {"event_loss", "refractory"} >= set(grown.names) else refused
        return refused if len(grown.names) == 1 else []

    monkeypatch.setattr(attempts_module, "objections", objecting)
    truth, told = [*PAIR, "pixel.thresholds.off=0.22"], []
    _, outcome = searched(truth, laboratory_with_a_mixture(), log=told.append)
    steps = [line.partition(":")[0] for line in told if line.startswith(("added", "replaced"))]
    assert steps[:2] == ["added event_loss", "added event_loss, refractory"]
    assert steps[2].startswith("replaced event_loss by")
    assert len(steps) == 4
    assert set(outcome.state.names) == {"refractory", "leak", "thresholds"}
    assert outcome.rejected["event_loss"].reason
    assert verdict_of(outcome, GONE) == "explained"
