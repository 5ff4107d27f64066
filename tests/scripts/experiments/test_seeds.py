"""Which differences the spread over seeds carries, and trainings that are not done twice."""

from __future__ import annotations

import json
from dataclasses import dataclass
from itertools import permutations

import numpy as np
import pytest
from experiments import seeds

from adv2e.errors import DataError

pytest.importorskip("torch", reason="PyTorch (extra experiments) is too large for all")


def test_five_seeds_apart_have_the_least_chance_there_is():
    assert seeds.p_value([1, 2, 3, 4, 5], [6, 7, 8, 9, 10]) == pytest.approx(2 / 252)
    assert seeds.p_value([1, 2, 3], [3, 2, 1]) == 1


def test_the_chance_is_that_of_all_ways_to_deal():
    a, b = [0.3, 0.9, 0.4], [0.5, 1.1]
    apart = abs(np.mean(a) - np.mean(b))
    ways = [abs(np.mean(way[:3]) - np.mean(way[3:])) for way in permutations(a + b)]
    assert seeds.p_value(a, b) == pytest.approx(np.mean(np.array(ways) >= apart - 1e-12))


FAR = {"a": [1, 2, 3, 4, 5], "b": [11, 12, 13, 14, 15], "c": [1.5, 2.5, 3.5, 4.5, 0.5]}


def test_what_is_apart_is_told_the_better_one_first():
    assert {*seeds.parted(FAR)} == {("b", "a"), ("b", "c")}
    assert "b is better than a; b is better than c. The other pairs (1)" in seeds.sentence(
        "SSIM", FAR, larger_is_better=True
    )
    assert "a is better than b" in seeds.sentence("MSE", FAR, larger_is_better=False)


def test_no_ranking_where_the_seeds_carry_none():
    near = {"a": FAR["a"], "c": FAR["c"]}
    assert seeds.parted(near) == []
    assert "no ranking" in seeds.sentence("MSE", near, larger_is_better=False)


def test_chance_alone_rarely_makes_a_ranking():
    rng = np.random.default_rng(0)
    tries = [
        bool(seeds.parted({name: list(rng.normal(size=5)) for name in "abcd"})) for _ in range(200)
    ]
    assert np.mean(tries) < 0.08


@dataclass(frozen=True)
class Noted:
    """A training that only counts how often it was done."""

    folder: object
    seed: int
    steps: int = 3

    @property
    def settings(self):
        return {"simulator": "a", "nature": "none", "seed": self.seed, "steps": self.steps}

    def run(self):
        self.folder.mkdir(exist_ok=True)
        count = self.folder / "count"
        count.write_text("x" + (count.read_text() if count.exists() else ""))
        return {"measures": {"MSE": 0.1 * self.seed}}


def test_what_was_done_is_not_done_again(tmp_path):
    jobs = [Noted(tmp_path / f"a-seed{k}", k) for k in range(3)]
    seeds.all_done(jobs[:2], 1)
    seeds.all_done(jobs, 1)
    assert [(job.folder / "count").read_text() for job in jobs] == ["x"] * 3
    found = seeds.measured(tmp_path)
    assert seeds.values_of(found, "MSE") == {"a": [0.0, 0.1, 0.2]}
    text = seeds.report(found, {"MSE": False, "LPIPS": False})
    assert "| a | MSE | 0.1000 | 0.1000 | 0.0000 0.1000 0.2000 |" in text
    assert "LPIPS" not in text
    assert "- a: none" in text


def test_other_settings_are_done_anew_and_not_mixed(tmp_path):
    seeds.all_done([Noted(tmp_path / "a-seed0", 0), Noted(tmp_path / "a-seed1", 1)], 1)
    seeds.all_done([Noted(tmp_path / "a-seed1", 1, steps=4)], 1)
    assert json.loads((tmp_path / "a-seed1" / seeds.MEASURED).read_text())["settings"]["steps"] == 4
    with pytest.raises(DataError, match="trainings with steps"):
        seeds.measured(tmp_path)


def test_a_simulator_is_known_by_all_it_is():
    plain, again, set_other = (
        seeds.about(seeds.anew("ideal", sets, None)[0])
        for sets in ((), (), ("pixel.thresholds.on=0.3",))
    )
    assert plain == again
    assert plain["simulator"] == set_other["simulator"] == "ideal"
    assert plain["digest"] != set_other["digest"]


def test_an_empty_folder_is_one_line(tmp_path):
    with pytest.raises(DataError, match="small makes them"):
        seeds.measured(tmp_path)
