from __future__ import annotations

import pytest

from adv2e.config import load_config
from adv2e.diagnosis.fitting.nuisances import fit_thresholds, thresholds_of


def counts_of(config):
    """Counts that fall with the threshold of their sign and, less, of the other."""
    levels = config.pixel.thresholds
    return (
        round(2000 / levels.on**1.2 / levels.off**0.3),
        round(3000 / levels.off**1.1 / levels.on**0.2),
    )


def test_thresholds_that_made_the_totals_come_back_by_key():
    truth = load_config([], ["pixel.thresholds={on: 0.31, off: 0.17}"])
    declared = load_config(["paper"])
    fitted, miss = fit_thresholds(counts_of, declared, counts_of(truth))
    assert miss < 0.01
    assert thresholds_of(fitted) == {
        "pixel.thresholds.on": pytest.approx(0.31, rel=0.02),
        "pixel.thresholds.off": pytest.approx(0.17, rel=0.02),
    }
    assert fitted.pixel.thresholds.mismatch == declared.pixel.thresholds.mismatch
    assert fitted.frames == declared.frames


def test_totals_out_of_reach_are_told():
    on, off = counts_of(load_config([], ["pixel.thresholds={on: 5, off: 5}"]))
    _, miss = fit_thresholds(counts_of, load_config(["paper"]), (on // 4, off // 4))
    assert miss > 1.0
