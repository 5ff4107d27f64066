"""Circuits without a filter: the same events as the stepped solver finds, in fewer looks."""

import numpy as np
import pytest
from harness import effect

from adv2e import simulate
from adv2e.kernel import unfiltered
from adv2e.light import intervals

ROWS, COLUMNS = 40, 70
NOISE = {
    "refractory": {"period_us": 700.0},
    "reset_overshoot": {"fraction": 0.2},
    "shot_noise": {"rate_hz": 40.0},
    "hot_pixels": {"fraction": 0.05, "rate_hz": 80.0},
    "thresholds": {"on": 0.1, "off": 0.15, "mismatch": 0.03},
    "initial_reference": "random",
}
CASES = {
    "ideal": {},
    "noise and dead time": {"pixel": NOISE},
    "dark, without a knee": {"pixel": {"log_response": {"linear_below": 0, "floor": 0.5}}},
    "as frames come": {"pixel": NOISE, "sampling": {"L": 1}},
}


@pytest.fixture(scope="module")
def frames():
    draw = np.random.default_rng(1)
    y, x = np.mgrid[:ROWS, :COLUMNS]
    phases = 0.35 * x - 0.4 * np.arange(24)[:, None, None]
    stack = 100 + 95 * np.sin(phases) * np.cos(0.2 * y) + draw.normal(0, 3, phases.shape)
    stack[6:12, :, COLUMNS // 2 :] = stack[6, :, COLUMNS // 2 :]  # rests for a while
    stack[15, :4] = 0.0
    stack[18:] = stack[17]  # returns to where it was, a whole number of thresholds away
    stack[[19, 22]] = stack[2]
    return np.clip(np.rint(stack), 0, 255).astype(np.uint8)


@pytest.fixture
def circuits(monkeypatch):
    """Return the answers of whether a circuit was without a filter, as they are given."""
    given = []

    def covers(circuit):
        given.append(unfiltered_covers(circuit))
        return given[-1]

    unfiltered_covers = unfiltered.covers
    monkeypatch.setattr(unfiltered, "covers", covers)
    return given


def events_of(frames, case, **options):
    config = ["ideal", {"frames": {"encoding": "srgb"}, **CASES[case]}]
    return np.concatenate(list(simulate(frames, fps=240, config=config, **options)))


@pytest.mark.parametrize("causes", [False, True])
@pytest.mark.parametrize("case", CASES)
def test_events_are_those_of_the_stepped_solver(circuits, frames, case, causes):
    nothing = effect((ROWS, COLUMNS), signal=lambda t: 0.0 * t)
    found = events_of(frames, case, causes=causes)
    assert circuits == [True]
    stepped = events_of(frames, case, causes=causes, effects=[nothing])
    assert circuits == [True]  # with an effect inside the pixel nobody asks
    assert found.size > 20_000
    np.testing.assert_array_equal(found, stepped)


@pytest.mark.parametrize("most", [1, 7])  # within the instants between two frames
@pytest.mark.parametrize("case", CASES)
def test_events_do_not_depend_on_threads_or_on_where_parts_end(monkeypatch, frames, case, most):
    found = events_of(frames, case, threads=1)
    monkeypatch.setattr(intervals, "_MOST", most)
    np.testing.assert_array_equal(events_of(frames, case, threads=3), found)


def test_a_filter_is_none_of_it(circuits, frames):
    config = ["ideal", {"frames": {"encoding": "srgb"}, "pixel": {"leak": {"rate_hz": 5.0}}}]
    assert sum(map(len, simulate(frames[:4], fps=240, config=config))) > 100
    assert circuits == [False]
