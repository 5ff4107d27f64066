"""Which differences the spread over seeds carries."""

from __future__ import annotations

from itertools import permutations

import numpy as np
import pytest
from experiments import training


def test_five_seeds_apart_have_the_least_chance_there_is():
    assert training.p_value([1, 2, 3, 4, 5], [6, 7, 8, 9, 10]) == pytest.approx(2 / 252)
    assert training.p_value([1, 2, 3], [3, 2, 1]) == 1


def test_the_chance_is_that_of_all_ways_to_deal():
    a, b = [0.3, 0.9, 0.4], [0.5, 1.1]
    apart = abs(np.mean(a) - np.mean(b))
    ways = [abs(np.mean(way[:3]) - np.mean(way[3:])) for way in permutations(a + b)]
    assert training.p_value(a, b) == pytest.approx(np.mean(np.array(ways) >= apart - 1e-12))


FAR = {"a": [1, 2, 3, 4, 5], "b": [11, 12, 13, 14, 15], "c": [1.5, 2.5, 3.5, 4.5, 0.5]}


def test_what_is_apart_is_told_the_better_one_first():
    assert {*training.parted(FAR)} == {("b", "a"), ("b", "c")}
    assert "b is better than a; b is better than c. The other pairs (1)" in training.sentence(
        "SSIM", FAR, larger_is_better=True
    )
    assert "a is better than b" in training.sentence("MSE", FAR, larger_is_better=False)


def test_no_ranking_where_the_seeds_carry_none():
    near = {"a": FAR["a"], "c": FAR["c"]}
    assert training.parted(near) == []
    assert "no ranking" in training.sentence("MSE", near, larger_is_better=False)


def test_chance_alone_rarely_makes_a_ranking():
    rng = np.random.default_rng(0)
    tries = [
        bool(training.parted({name: list(rng.normal(size=5)) for name in "abcd"}))
        for _ in range(200)
    ]
    assert np.mean(tries) < 0.08


def test_a_report_has_each_seed_and_only_what_was_measured():
    found = [
        {"settings": {"simulator": "a", "nature": "none", "seed": k}, "measures": {"MSE": 0.1 * k}}
        for k in range(3)
    ]
    text = training.report(found, {"MSE": False, "LPIPS": False}, {"grey": {"MSE": 0.25}})
    assert "| a | MSE | 0.1000 | 0.1000 | 0.0000 0.1000 0.2000 |" in text
    assert "LPIPS" not in text
    assert "- a: none" in text
    assert text.endswith("| beside | MSE |\n| --- | ---: |\n| grey | 0.2500 |")
    assert "beside" not in training.report(found, {"MSE": False}, {})
