"""The distance between recording and simulations, and its floor."""

import itertools

import numpy as np
import pytest
from made_up.streams import HEIGHT, WIDTH, random_stream, stream_of

from adv2e.comparison.distances import SIGMAS_US, smoothed_errors, smoothed_norms
from adv2e.diagnosis.data import splits
from adv2e.diagnosis.data.splits import Split
from adv2e.diagnosis.outcome.verdict import (
    NAME,
    OF_MEAN,
    PAIRS,
    Errors,
    _pairs,
    error_rows,
    of_interpolation,
)

MEASURED = random_stream(600, 1)
BEFORE = [random_stream(600, seed) for seed in range(10, 16)]
AFTER = [random_stream(500, seed) for seed in range(20, 28)]


def rows_of(measured, before, after):
    return error_rows(Errors.of(measured, before), Errors.of(measured, after))


def distance(measured, simulated, whole=None):
    whole = None if whole is None else whole.events()
    return smoothed_errors(measured.events(), simulated.events(), WIDTH, whole=whole)


def test_errors_are_those_of_the_comparison():
    rows = rows_of(MEASURED, BEFORE, AFTER)
    for column, streams in (("before", BEFORE), ("after", AFTER)):
        table = np.array([distance(MEASURED, stream) for stream in streams])
        assert getattr(rows[0], column).value == pytest.approx(table.mean())
        for k in range(len(SIGMAS_US)):
            estimate = getattr(rows[1 + k], column)
            assert estimate.value == pytest.approx(table[:, k].mean())
            low, high = np.quantile(table[:, k], [0.025, 0.975])
            assert estimate.interval == pytest.approx((low, high))


def test_the_floor_is_between_draws_in_units_of_the_measured():
    rows = rows_of(MEASURED, BEFORE, AFTER)
    table = np.array([distance(a, b, MEASURED) for a, b in _pairs(AFTER)])
    assert rows[0].floor.value == pytest.approx(table.mean())
    assert rows[3].floor.value == pytest.approx(table[:, 2].mean())


def test_what_interpolation_adds_is_half_of_what_leaving_frames_out_does():
    draws = [random_stream(600, seed) for seed in range(30, 42)]
    others = [random_stream(600, seed) for seed in range(50, 62)]
    between = np.mean([distance(a, b, MEASURED) for a, b in _pairs(draws)])
    assert of_interpolation(MEASURED, draws, others, between) < 0.3  # chance alone
    fewer = [random_stream(100, seed) for seed in range(70, 82)]
    apart = np.mean([distance(a, b, MEASURED) for a, b in zip(draws, fewer, strict=True)])
    assert apart < between
    assert of_interpolation(MEASURED, draws, fewer, between) == 0.0
    more = [random_stream(3000, seed) for seed in range(70, 82)]
    apart = np.mean([distance(a, b, MEASURED) for a, b in zip(draws, more, strict=True)])
    found = of_interpolation(MEASURED, draws, more, between)
    assert found == pytest.approx(0.5 * np.sqrt(apart**2 - between**2))
    assert found > 0.5


def test_rows_are_the_mean_and_every_scale():
    names = [row.name for row in rows_of(MEASURED, BEFORE, AFTER)]
    assert (names[0], names[-1]) == (NAME, OF_MEAN)
    scales = [name.rpartition(" over ")[2] for name in names[1:-1]]
    assert scales == ["2 ms", "10 ms", "50 ms", "100 ms"]


def test_the_last_row_is_of_the_mean_of_simulations():
    """Beside the mean of so many as there are, whose own chance is left in it."""
    rows = rows_of(MEASURED, BEFORE, AFTER)
    (row,) = (row for row in rows if row.without_chance)
    n, unit = len(BEFORE), smoothed_norms([(MEASURED.events(), 1.0)], WIDTH, SIGMAS_US)
    mean = [(one.events(), -1.0 / n) for one in BEFORE]
    apart = smoothed_norms([(MEASURED.events(), 1.0), *mean], WIDTH, SIGMAS_US) / unit
    pairs = itertools.combinations(BEFORE, 2)
    chance = 0.5 * np.mean([np.square(distance(a, b, MEASURED)) for a, b in pairs], axis=0)
    assert row.before.value == pytest.approx(np.sqrt(apart**2 - chance / n).mean())
    between = np.array([distance(a, b, MEASURED) for a, b in _pairs(AFTER)])
    assert row.floor.value == pytest.approx(np.sqrt(0.5 * np.mean(between**2, axis=0)).mean())


def test_random_events_as_the_camera_has_them_cost_nothing_from_the_mean():
    """Though each simulation with them is farther off than one without."""
    with_noise = [random_stream(900, seed) for seed in range(30, 42)]
    silent = [random_stream(0) for _ in range(12)]
    rows = rows_of(MEASURED, silent, with_noise)
    assert rows[0].after.value > 1.3 * rows[0].before.value
    assert rows[-1].after.value == pytest.approx(rows[-1].before.value, rel=0.05)


def test_a_model_like_the_recording_is_at_the_floor():
    draws = [random_stream(600, seed) for seed in range(30, 42)]
    row = rows_of(MEASURED, BEFORE, draws)[0]
    assert row.after.value == pytest.approx(row.floor.value, rel=0.1)


def test_no_distance_to_itself():
    row = rows_of(MEASURED, [MEASURED], [MEASURED, MEASURED])[0]
    assert (row.before.value, row.after.value, row.floor.value) == (0.0, 0.0, 0.0)


def test_no_events_at_all_are_at_the_distance_one():
    nothing = random_stream(0)
    row = rows_of(MEASURED, [nothing], [nothing, nothing])[0]
    assert row.before.value == pytest.approx(1.0)
    assert row.floor.value == 0.0


def test_without_a_measured_event_there_is_no_distance():
    for row in rows_of(random_stream(0), BEFORE, AFTER):
        for estimate in (row.before, row.after, row.floor):
            assert np.isnan(estimate.value)


@pytest.mark.parametrize("count", [2, 3, 7, 8, 12, 30])
def test_pairs_are_of_different_streams_and_use_all_of_them(count):
    streams = [stream_of([k], [0], [0], [1]) for k in range(count)]
    found = [tuple(sorted((int(a.t[0]), int(b.t[0])))) for a, b in _pairs(streams)]
    assert len(set(found)) == len(found)
    assert all(a != b for a, b in found)
    assert len(found) == min(count * (count - 1) // 2, max(PAIRS, count))
    assert set(np.ravel(found)) == set(range(count))


def test_the_parts_of_a_stream():
    division = Split.of(WIDTH, HEIGHT, 0.0, 200_000.0)
    pieces = [division.chosen(MEASURED, part) for part in range(splits.COUNT)]
    assert sum(map(len, pieces)) == len(MEASURED)
    for part, piece in enumerate(pieces):
        for t, pixel in zip(piece.t.tolist(), piece.pixel.tolist(), strict=True):
            assert division.label[t // 50_000, pixel] == part
        assert np.all(np.diff(piece.t) >= 0)
    assert len(division.chosen(random_stream(0), splits.TEST)) == 0
