"""What the printed update and its relatives do to an edge, as numbers anyone can look up.

Ratio of event counts to the exact circuit's (16 events), corner proportional to light, pure
logarithm, 24 frames a second, L = 10.  The paper's form starts at its own fixed point, Y = gain x.
"""

import numpy as np
import pytest
from harness import advance, quiet, start
from reference import stimuli

from adv2e.config.model import LogResponse, LowPass
from adv2e.kernel import per_pixel

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
