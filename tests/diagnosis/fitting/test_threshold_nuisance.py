from __future__ import annotations

import pytest

from adv2e.config import load_config
from adv2e.diagnosis.fitting.fitter import TOLERANCE, fit_thresholds, thresholds_of


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


def test_a_total_that_no_threshold_gives_is_told():
    def counts(config):
        return int(50 / config.pixel.thresholds.on), 400

    _, miss = fit_thresholds(counts, load_config([]), (100, 200))
    assert miss == pytest.approx(1.0)


def test_totals_that_depend_on_both_thresholds_are_matched():
    def counts(config):
        on, off = config.pixel.thresholds.on, config.pixel.thresholds.off
        return int(90_000 * on**-2.2 * off**0.4), int(70_000 * off**-1.1 * on**0.3)

    truth = load_config([], ["pixel.thresholds={on: 0.63, off: 0.34}"])
    fitted, miss = fit_thresholds(counts, load_config([]), counts(truth))
    assert miss <= TOLERANCE
    assert fitted.pixel.thresholds.on == pytest.approx(0.63, rel=0.02)
    assert fitted.pixel.thresholds.off == pytest.approx(0.34, rel=0.02)
