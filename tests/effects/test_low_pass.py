"""Low-pass: each way to solve it beside the twin, and what the printed update does to an edge."""

from __future__ import annotations

import math

import numpy as np
import pytest
from harness import advance, check_against_twin, clock, moving_light, pure, quiet, solve, start
from reference import stimuli
from reference.circuit import Circuit
from reference.closed_forms import times_behind_a_pole

from adv2e.config.model import (
    Leak,
    LogResponse,
    LowPass,
    PhotoreceptorNoise,
    Refractory,
    SourceFollower,
)
from adv2e.kernel import per_pixel

# ratio of event counts to the exact circuit's (16 events), corner proportional to light, pure
# logarithm, 24 frames a second, L = 10; the paper's form starts at its own fixed point, Y = gain x
KS = (1, 2, 5, 10, 20, 50, 100)

PAPER = {
    "rising": (12.75, 6.12, 2.69, 1.75, 1.31, 1.12, 1.06),
    "falling": (12.75, 6.12, 2.69, 1.75, 1.31, 1.12, 1.06),
}

EDGES = {"rising": (10.0, 255.0), "falling": (255.0, 10.0)}


def count(stimulus, update, K, fixed_point=False):
    light = np.asarray(stimulus.light)
    times = [round(t * 1e9) for t in stimulus.times]
    pixel = quiet(
        log_response=LogResponse(linear_below=0), low_pass=LowPass(dark_cutoff_hz=0, update=update)
    )
    array = start(light, times, pixel, K=K)
    if fixed_point:
        a = 2 * np.pi * 300 * light[0] / 255 * (times[1] - times[0]) * 1e-9 / K
        above = (a / -np.expm1(-a) - 1) * array.state[per_pixel.X]
        array.state[per_pixel.FIRST] += above
        array.state[per_pixel.REFERENCE] += above
    return len(advance(array, light, times)[0])


@pytest.mark.parametrize("edge", EDGES)
def test_paper_makes_events_of_its_own(edge):
    stimulus = stimuli.edge(*EDGES[edge])
    for K, ratio in zip(KS, PAPER[edge], strict=True):
        assert count(stimulus, "paper", K, fixed_point=True) / 16 == pytest.approx(ratio, abs=0.01)


@pytest.mark.parametrize("edge", EDGES)
@pytest.mark.parametrize("update", ["exact", "first_order_hold", "zero_order_hold", "euler"])
def test_the_others_count_right(edge, update):
    stimulus = stimuli.edge(*EDGES[edge])
    assert [count(stimulus, update, K) for K in KS] == [16] * len(KS)


def test_paper_fires_at_the_start_of_a_white_picture():
    """Started at Y = x, it climbs to gain x: about a dozen false ON events."""
    white = stimuli.edge(255.0, 255.0)
    assert count(white, "paper", 10) == 12
    assert count(white, "exact", 10) == 0


def test_slow_ramp():
    stimulus = stimuli.slow_ramp()
    assert count(stimulus, "exact", 10) == 3
    for K, ratio in ((1, 29.7), (5, 5.0), (10, 2.67), (50, 1.33), (100, 1.0)):
        assert count(stimulus, "paper", K, fixed_point=True) / 3 == pytest.approx(ratio, abs=0.04)


@pytest.mark.parametrize("update", ["first_order_hold", "zero_order_hold", "euler", "paper"])
@pytest.mark.parametrize("printed", [False, True])
@pytest.mark.parametrize("follower_hz", [None, 300.0])
def test_stepped_forms_against_the_twin(update, printed, follower_hz):
    light = moving_light(31, 12, seed=3)
    pixel = quiet(
        low_pass=LowPass(update=update),
        refractory=Refractory(period_us=700),
        leak=Leak(rate_hz=10.0, jitter=0.0),
        source_follower=SourceFollower(cutoff_hz=follower_hz) if follower_hz else None,
    )
    circuit = Circuit(
        update=update,
        K=5,
        L=10,
        printed_last_interval=printed,
        dead_time_us=700.0,
        leak_hz=10.0,
        follower_hz=follower_hz,
    )
    options = {"K": 5, "L": 10, "printed": printed, "method": "stepped", "within_us": 0.01}
    check_against_twin(light, clock(31, 1 / 240), pixel, circuit, **options)


@pytest.mark.parametrize("update", ["first_order_hold", "zero_order_hold", "euler", "paper"])
def test_stepped_forms_behind_a_second_pole_from_rest(update):
    """The paper's form moves at rest, too: its weights do not sum to one."""
    light = np.repeat(moving_light(8, 12, seed=3), 4, axis=0)
    pixel = quiet(low_pass=LowPass(update=update), source_follower=SourceFollower(cutoff_hz=100))
    circuit = Circuit(update=update, K=3, follower_hz=100.0)
    check_against_twin(light, clock(32, 1 / 240), pixel, circuit, K=3, within_us=0.01)


def test_full_darkness_without_a_dark_corner_is_defined():
    pixel = quiet(
        low_pass=LowPass(dark_cutoff_hz=0.0), photoreceptor_noise=PhotoreceptorNoise(rms=0.01)
    )
    light = np.zeros((3, 1, 8), np.float32)
    light[2] = 200.0
    times = [0, 4_000_000, 8_000_000]
    assert len(advance(start(light, times, pixel), light, times)[0]) > 0


@pytest.mark.parametrize("corner_hz", [15.0, 300.0])
def test_exact_follows_a_ramp_as_a_pole_does_in_closed_form(corner_hz):
    low_pass = LowPass(cutoff_hz=corner_hz, dark_cutoff_hz=corner_hz)
    light, times = np.array([[4.0], [200.0], [200.0]]), [0.0, 0.02, 0.12]
    (events,) = solve(light, times, pure(low_pass=low_pass))
    expected = times_behind_a_pole(math.log(50.0), 0.02, corner_hz, 0.2, 0.12)
    assert len(expected) == 19
    np.testing.assert_allclose(events[:, 0], expected, atol=1e-6)
    assert (events[:, 1] == 1).all()
