"""Trainings that are not done twice, nor mixed."""

from __future__ import annotations

import json
from dataclasses import dataclass

import pytest
from experiments import training
from experiments.training import anew

from adv2e.errors import DataError

pytest.importorskip("torch", reason="PyTorch (extra experiments) is too large for all")


@dataclass(frozen=True)
class Noted:
    """A training that only counts how often it was done."""

    seed: int
    steps: int = 3

    @property
    def settings(self):
        return {"simulator": "a", "nature": "none", "seed": self.seed, "steps": self.steps}

    def run(self, folder):
        folder.mkdir(exist_ok=True)
        count = folder / "count"
        count.write_text("x" + (count.read_text() if count.exists() else ""))
        return {"measures": {"MSE": 0.1 * self.seed}}


def test_what_was_done_is_not_done_again(tmp_path):
    trainings = [Noted(k) for k in range(3)]
    training.all_done(trainings[:2], tmp_path, 1)
    training.all_done(trainings, tmp_path, 1)
    assert [(tmp_path / f"a-seed{k}" / "count").read_text() for k in range(3)] == ["x"] * 3
    found = training.all_measured(tmp_path)
    assert training.values_of(found, "MSE") == {"a": [0.0, 0.1, 0.2]}


def test_other_settings_are_done_anew_and_not_mixed(tmp_path):
    training.all_done([Noted(0), Noted(1)], tmp_path, 1)
    training.all_done([Noted(1, steps=4)], tmp_path, 1)
    assert (
        json.loads((tmp_path / "a-seed1" / training.MEASURED).read_text())["settings"]["steps"] == 4
    )
    with pytest.raises(DataError, match="trainings with steps"):
        training.all_measured(tmp_path)


def test_a_simulator_is_known_by_all_it_is():
    plain, again, set_other = (
        training.identity(anew("ideal", sets, None)[0])
        for sets in ((), (), ("pixel.thresholds.on=0.3",))
    )
    assert plain == again
    assert plain["simulator"] == set_other["simulator"] == "ideal"
    assert plain["digest"] != set_other["digest"]


def test_an_empty_folder_is_one_line(tmp_path):
    with pytest.raises(DataError, match="small makes them"):
        training.all_measured(tmp_path)
