"""How far off statistics are for what is made up between frames, and what is expected of it."""

import numpy as np
import pytest
from click.testing import CliRunner
from studies import interpolation_error as study

from adv2e.diagnosis.statistics.summary import BOTH
from adv2e.diagnosis.statistics.uncertainty import FrameError


def simulations(mean, seed, count=400):
    """Return simulations of 200 statistics, with a deviation of 2."""
    return mean + 2.0 * np.random.default_rng(seed).normal(size=(count, 200))


def expected(bias, sd):
    """Return an error that is the same for all statistics of one view, and for no other view."""
    shape = (BOTH + 1, 200)
    error = FrameError(np.full(shape, np.nan), np.full(shape, np.nan))
    error.bias[BOTH], error.sd[BOTH] = bias, sd
    return error


def test_the_error_is_in_deviations_of_chance_and_loses_what_is_taken_off():
    few, many = simulations(11.0, 1), simulations(10.0, 2)
    row = study.compared("linear", 60.0, few, many, expected(0.6, 0.8), np.full(200, 0.1))
    assert row.error == pytest.approx(0.5, abs=0.05)
    assert row.left == pytest.approx(0.2, abs=0.05)
    assert row.doubt == pytest.approx(0.4, abs=0.02)


def test_chance_is_no_error():
    few, many = simulations(10.0, 1), simulations(10.0, 2)
    row = study.compared("linear", 60.0, few, many, expected(0.0, 0.1), np.full(200, 0.1))
    assert row.error < 0.05


def test_the_table_has_medians_and_the_range_of_what_was_expected():
    rows = [study.Row("flow", 62.5, error, error / 2, 1.0) for error in (1.0, 2.0, 4.0)]
    rows.append(study.Row("linear", 500.0, 0.1, 0.1, 0.2))
    *_, flow, linear = study.rates_table(rows).splitlines()
    assert flow == "| flow | 62.5 | 2.00 | 1.00 | 1.00 | 1.00 (0.50 to 2.00) |"
    assert linear.startswith("| linear | 500 | 0.10 |")


def test_a_scene_is_studied_from_its_recording_on():
    rows = list(study.rows_of("edges", 3, 0.2, [16], 1))
    assert [(row.kind, row.fps) for row in rows] == [("linear", 125.0), ("flow", 125.0)]
    assert all(row.error > 0.1 and row.doubt > 0.1 for row in rows)


def test_an_unknown_scene_is_named():
    result = CliRunner().invoke(study.main, ["--scenes", "edges,nowhere"])
    assert result.exit_code == 2
    assert "'nowhere': none of" in result.output


def test_too_few_frames_are_an_error_and_not_a_row():
    result = CliRunner().invoke(
        study.main, ["--scenes", "edges", "--seeds", "1", "--seconds", "0.1", "--every", "64"]
    )
    assert result.exit_code == 2
    assert "too few frames in so short a scene at 31.25 a second" in result.output
