"""The exact update against the dense ODE: counts equal, every time within 1 us."""

import math

import numpy as np
import pytest
from harness import quiet, solve
from reference import stimuli
from reference.agreement import count_and_time_errors
from reference.circuit import Circuit
from reference.dense_ode import as_lists, dense_truth

from adv2e.config.model import Leak, LogResponse, LowPass, Refractory, SourceFollower

CIRCUITS = {
    "pure logarithm, no dark corner": (
        Circuit(linear_below=0.0, dark_cutoff_hz=0.0),
        {"log_response": LogResponse(linear_below=0), "low_pass": LowPass(dark_cutoff_hz=0)},
    ),
    "pure logarithm, dark corner": (
        Circuit(linear_below=0.0),
        {"log_response": LogResponse(linear_below=0)},
    ),
    "lin-log, no dark corner": (
        Circuit(dark_cutoff_hz=0.0),
        {"low_pass": LowPass(dark_cutoff_hz=0)},
    ),
    "lin-log, dark corner": (Circuit(), {}),
}
WITH_EFFECTS = (
    Circuit(
        follower_hz=1500.0, dead_time_us=800.0, leak_hz=3.0, photo_leak_hz=6.0, on=0.2, off=0.2
    ),
    {
        "source_follower": SourceFollower(cutoff_hz=1500.0),
        "refractory": Refractory(period_us=800.0),
        "leak": Leak(rate_hz=3.0, photo_rate_hz=6.0),
    },
)


def compare(stimulus, circuit, sections):
    """Return (agreement where the truth is defined, ties, events of the truth)."""
    truths = dense_truth(*stimulus, circuit)
    truth, until = as_lists(truths)
    found = []
    for K in (1, 100):
        events = solve(stimulus.light, stimulus.times, quiet(**sections), K=K)
        found.append(events)
    assert all(a.tobytes() == b.tobytes() for a, b in zip(*found, strict=True))
    ties = sum(math.isfinite(u) for u in until)
    return count_and_time_errors(found[0], truth, until), ties


@pytest.mark.parametrize("name", CIRCUITS)
@pytest.mark.parametrize(("fps", "L"), [(10, 10), (24, 10), (240, 1), (1000, 1)])
def test_edges_ramps_and_textures(name, fps, L):
    stimulus = stimuli.standard(fps, L=L, pixels=24, frames=7)
    agreement, ties = compare(stimulus, *CIRCUITS[name])
    assert agreement.count_b > 40
    assert not agreement.differing
    assert agreement.max_dt_us < 1.0
    assert ties <= 2


@pytest.mark.parametrize("fps", [24, 240])
def test_with_second_pole_dead_time_and_leak(fps):
    stimulus = stimuli.standard(fps, L=10, pixels=16, frames=5)
    agreement, _ = compare(stimulus, *WITH_EFFECTS)
    assert agreement.count_b > 40
    assert not agreement.differing
    assert agreement.max_dt_us < 1.0


def test_turning_points_and_returns():
    """Blinking pixels: every interval turns, and levels are approached without being reached."""
    stimulus = stimuli.blinking(pixels=30, frames=12, fps=200.0, L=1)
    agreement, _ = compare(stimulus, *CIRCUITS["lin-log, dark corner"])
    assert agreement.count_b > 40
    assert not agreement.differing
    assert agreement.max_dt_us < 1.0


def test_fast_and_slow_corners():
    stimulus = stimuli.texture(pixels=16, frames=5, fps=30.0, L=10)
    for cutoff, dark in ((20.0, 1.0), (3000.0, 200.0), (30_000.0, 0.0)):
        circuit = Circuit(cutoff_hz=cutoff, dark_cutoff_hz=dark)
        low_pass = LowPass(cutoff_hz=cutoff, dark_cutoff_hz=dark)
        agreement, _ = compare(stimulus, circuit, {"low_pass": low_pass})
        assert agreement.count_b > 8
        assert not agreement.differing
        assert agreement.max_dt_us < 1.0


def test_ties_are_rare():
    """Under one event in 10,000 hangs on a 1e-7 shift of the threshold, on float-valued light."""
    stimulus = stimuli.texture(pixels=60, frames=13, fps=24.0, L=10)
    truths = dense_truth(*stimulus, Circuit())
    events = sum(len(t.events) for t in truths)
    assert sum(len(t.ties) for t in truths) * 10_000 <= max(events, 10_000)
    assert np.isfinite(events)
