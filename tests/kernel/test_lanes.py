"""What the lanes decide, against the dense truth: adversarial stimuli of a few intervals."""

import math
from dataclasses import replace

import numpy as np
import pytest
from lane_checks import check, clock, fire, tangent_level, turns
from lane_light import single, walks
from reference.circuit import PURE, Circuit
from reference.dense_ode import find_events
from reference.dense_signal import solve_signal

FAR = 50.0
"""A threshold that nothing reaches [ln units]."""


# --- tangents and ties ---------------------------------------------------------------------------


def there_and_back(seed, pixels, polarity):
    """Light that goes one way and then back, the signal turning in the last interval."""
    draw = np.random.default_rng(seed)
    low, high = math.log(21.0), math.log(255.0)
    x0 = draw.uniform(low + 0.2, high - 0.2, pixels)
    x1 = np.clip(x0 + polarity * draw.uniform(0.05, 0.9, pixels), low, high)
    x2 = np.clip(x1 - polarity * draw.uniform(0.05, 0.9, pixels), low, high)
    return single(np.exp([x0, x1, x2]))


@pytest.mark.parametrize("polarity", [1, -1])
@pytest.mark.parametrize("leak_hz", [0.0, 3.0, 30.0])
@pytest.mark.parametrize("lengths", [(2.0, 8.0), (0.3, 33.0)])
@pytest.mark.quick_cases(1)
def test_thresholds_next_to_the_turning_point(polarity, leak_hz, lengths):
    """What is just reached fires once, what is just missed does not: both times to 1 us."""
    pixels = 24
    light, times = there_and_back(5, pixels, polarity), clock(lengths)
    circuit = Circuit(on=0.3, off=FAR, leak_hz=leak_hz)
    paths = solve_signal(light, times, circuit)
    level = np.array([tangent_level(path, polarity, circuit.on) for path in paths])
    # a leak that makes up a whole threshold by itself has no tangent
    clear = (level > 0.02) & (level < 1.0)
    assert np.count_nonzero(clear) >= pixels // 3
    light, level = light[:, clear], level[clear]
    paths = [path for path, used in zip(paths, clear, strict=True) if used]
    for short in (1e-4, 1e-5, 1e-6, 3e-7):
        for side in (1, -1):
            moved = level - side * short
            near = replace(circuit, **{"on" if polarity > 0 else "off": moved})
            reached = level.size if side > 0 else 0
            truth = check(light, times, near, paths=paths, at_least=reached)
            first = sum(np.any(events[:, 1] == polarity) for events in truth)
            assert first == reached


def test_levels_that_are_approached_and_never_reached():
    """A grey value that lies a threshold away, as the logarithms have it, fires nothing at rest."""
    grey = np.array([[21.0, 40.0, 100.0, 3.0, 200.0], [26.0, 64.0, 250.0, 17.0, 90.0]])
    light, times = single(np.vstack([grey, np.repeat(grey[1:], 30, 0)])), clock([2.0] * 31)
    step = np.abs(np.diff(np.where(grey < 20, grey * math.log(20) / 20, np.log(grey)), axis=0)[0])
    for circuit in (Circuit(), Circuit(cutoff_hz=3000.0, dark_cutoff_hz=3000.0)):
        level = replace(circuit, on=step, off=step)
        assert all(len(events) == 0 for events in fire(light, times, level))
        below = replace(circuit, on=step - 1e-4, off=step - 1e-4)
        check(light, times, below, at_least=5)


@pytest.mark.parametrize("dead_time_us", [None, 600.0])
@pytest.mark.quick_cases(1)
def test_returns_to_earlier_grey_values(dead_time_us):
    """Back and forth between whole grey values: the last threshold of each way is never reached."""
    draw = np.random.default_rng(2)
    levels = draw.integers(1, 256, (3, 40)).astype(float)
    light = np.repeat(levels[[0, 1, 0, 2, 1, 0]], 4, axis=0)
    circuit = Circuit(linear_below=2.72, dead_time_us=dead_time_us)
    truth = check(light, clock([8.0] * (len(light) - 1)), circuit, at_least=300)
    if dead_time_us is None:
        # every way is gone back, but for one step at most
        assert all(abs(events[:, 1].sum()) <= 1 for events in truth)


@pytest.mark.parametrize("leak_hz", [60.0, 100.0])
@pytest.mark.quick_cases(1)
def test_leak_overtakes_a_slow_signal_while_the_light_rises(leak_hz):
    """The distance falls with the signal first, and then rises with the leak: OFF lies between."""
    pixels, draw = 200, np.random.default_rng(8)
    before, low = draw.uniform(1.0, 2.0, pixels), np.log(draw.uniform(0.2, 0.5, pixels))
    light = np.exp([before, low, low, low + draw.uniform(0.1, 0.9, pixels)])
    circuit = Circuit(
        linear_below=0.0,
        dark_cutoff_hz=5.0,
        leak_hz=leak_hz,
        on=0.4,
        off=draw.uniform(0.02, 0.1, pixels),
    )
    check(light, clock((2.0, 10.0, 4.0)), circuit, at_least=pixels)


# --- many events in one interval -----------------------------------------------------------------


@pytest.mark.parametrize("leak_hz", [0.0, 50.0])
@pytest.mark.quick_cases(1)
def test_hundreds_of_crossings_in_one_interval(leak_hz):
    x = np.log([[6.0, 30.0, 250.0, 21.0]])
    moved = np.log([[250.0, 250.0, 6.0, 22.0]])
    last = np.log([[240.0, 255.0, 9.0, 55.0]])
    light, times = single(np.exp(np.vstack([x, moved, last]))), clock([0.5, 80.0])
    circuit = Circuit(linear_below=2.72, on=0.01, off=0.011, leak_hz=leak_hz)
    truth = check(light, times, circuit, at_least=600)
    inside = [np.count_nonzero(events[:, 0] > times[1]) for events in truth]
    assert sum(count > 100 for count in inside) >= 3


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.quick_cases(1)
def test_crossings_both_ways_at_small_thresholds(seed):
    light = walks(seed, 5, 16)
    circuit = Circuit(on=0.01, off=0.013, dead_time_us=[None, 50.0, 700.0][seed])
    check(light, clock([1.0, 12.0, 4.0, 40.0]), circuit, at_least=200)


# --- dead time -----------------------------------------------------------------------------------


def first_event(path, circuit):
    return find_events([path], circuit)[0].events[0, 0]


@pytest.mark.parametrize("where", ["inside", "end", "beyond", "several", "turn"])
@pytest.mark.parametrize("leak_hz", [0.0, 20.0])
@pytest.mark.quick_cases(1)
def test_dead_times_that_end(where, leak_hz):
    """Inside the interval, at its end, beyond it, after several, and where the signal turns."""
    lengths = [3.0, 10.0, 10.0, 2.0, 2.0, 2.0, 20.0]
    times = clock(lengths)
    light = single([[60, 140, 70, 160, 160, 110, 75, 66], [180, 60, 150, 45, 45, 90, 95, 200]]).T
    circuit = Circuit(linear_below=2.72, leak_hz=leak_hz, on=0.15, off=0.15)
    for k, path in enumerate(solve_signal(light, times, circuit)):
        begin = first_event(path, circuit)
        assert begin < times[2]
        turn = min(t for t in turns(path) if t > begin + 1e-4)
        end = {
            "inside": begin + 4e-3,
            "end": times[2],
            "beyond": times[2] + 2e-3,
            "several": times[-2] + 1e-3,
            "turn": turn,
        }[where]
        for shift_us in (-1.0, -1e-3, 0.0, 1e-3, 1.0):
            dead = replace(circuit, dead_time_us=(end - begin) * 1e6 + shift_us)
            check(light[:, [k]], times, dead, paths=[path], at_least=2)


@pytest.mark.parametrize("dead_time_us", [30.0, 400.0, 4_000.0, 15_000.0, 50_000.0])
@pytest.mark.quick_cases(1)
def test_dead_times_from_short_to_longer_than_the_intervals(dead_time_us):
    light = walks(11, 25, 24)
    circuit = Circuit(dead_time_us=dead_time_us, on=0.05, off=0.06, leak_hz=5.0)
    truth = check(light, clock([4.0] * 24), circuit, at_least=40)
    for events in truth:
        assert np.all(np.diff(events[:, 0]) * 1e6 > dead_time_us - 1e-3)


# --- leak ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("drive", ["falls", "rests", "rises"])
@pytest.mark.parametrize("leaks", [(5.0, 0.0), (0.0, 30.0), (40.0, 60.0)])
@pytest.mark.quick_cases(1)
def test_a_falling_signal_that_leak_brings_back(drive, leaks):
    """It dips to the lower level, and returns: fires where it is reached, not where it is missed.

    In the last interval the signal falls behind a light that falls on, rests or rises slowly.
    """
    draw = np.random.default_rng(8)
    pixels = 24
    x0 = draw.uniform(math.log(70.0), math.log(250.0), pixels)
    x1 = x0 - draw.uniform(0.05, 0.6, pixels)
    drift = {"falls": -0.05, "rests": 0.0, "rises": 0.05}[drive] * draw.uniform(0.1, 1, pixels)
    light, times = single(np.exp([x0, x1, x1 + drift])), clock([1.0, 30.0])
    circuit = Circuit(on=0.5, off=FAR, leak_hz=leaks[0], photo_leak_hz=leaks[1])
    paths = solve_signal(light, times, circuit)
    level = np.array([tangent_level(path, -1, circuit.on) for path in paths])
    falls = level > 0.01  # the others never get below where they began
    assert np.count_nonzero(falls) > pixels // 2
    light, level = light[:, falls], level[falls]
    paths = [path for path, used in zip(paths, falls, strict=True) if used]
    for short in (1e-3, 1e-5, 1e-6):
        reached = check(light, times, replace(circuit, off=level - short), paths=paths)
        assert all(np.any(events[:, 1] < 0) for events in reached)
        missed = find_events(paths, replace(circuit, off=level + short))
        assert not any(np.any(truth.events[:, 1] < 0) for truth in missed)
        check(light, times, replace(circuit, off=level + short), paths=paths, at_least=0)


@pytest.mark.parametrize("dead_time_us", [None, 900.0])
@pytest.mark.parametrize("leaks", [(100.0, 0.0), (0.0, 100.0), (100.0, 300.0)])
@pytest.mark.quick_cases(1)
def test_leak_that_outruns_the_signal(dead_time_us, leaks):
    light = walks(21, 7, 20, steps=(0.01, 0.1, 0.4))
    circuit = Circuit(
        leak_hz=leaks[0], photo_leak_hz=leaks[1], dead_time_us=dead_time_us, on=0.1, off=0.08
    )
    check(light, clock([33.0, 4.0, 1.0, 33.0, 8.0, 100.0]), circuit, at_least=150)


# --- what takes pieces, or the slow path ----------------------------------------------------------

BEYOND = {
    "knee inside": (Circuit(on=0.1, off=0.07), {"lo": 3.0, "hi": 60.0, "steps": (0.1, 0.5)}),
    "knee at e": (
        Circuit(linear_below=math.e, on=0.05, off=0.07),
        {"lo": 0.3, "hi": 12.0, "steps": (0.1, 0.5)},
    ),
    "steps above an e-fold": (
        replace(PURE, dark_cutoff_hz=21.8),
        {"lo": 1.0, "hi": 255.0, "steps": (0.9, 1.1, 2.5)},
    ),
    "steps about an e-fold": (Circuit(on=0.1), {"lo": 21.0, "steps": (0.97, 0.99, 1.01)}),
    "brighter than white": (Circuit(), {"lo": 100.0, "hi": 4000.0, "steps": (0.3, 1.0)}),
    "around 382 DN": (Circuit(on=0.05), {"lo": 330.0, "hi": 430.0, "steps": (0.1,)}),
    "leak, knee and brightness": (
        Circuit(linear_below=2.72, leak_hz=20.0, photo_leak_hz=20.0, dead_time_us=800.0),
        {"lo": 1.0, "hi": 1000.0, "steps": (0.1, 0.9, 2.0)},
    ),
}


@pytest.mark.parametrize("name", BEYOND)
@pytest.mark.quick_cases(1)
def test_light_that_takes_pieces(name):
    circuit, options = BEYOND[name]
    light = walks(len(name), 8, 24, **options)
    check(light, clock([4.0, 1.0, 12.0, 33.0, 4.0, 4.0, 12.0]), circuit, at_least=25)


@pytest.mark.parametrize("dark_cutoff_hz", [5.0, 21.8])
@pytest.mark.parametrize("leak_hz", [0.0, 10.0])
@pytest.mark.quick_cases(1)
def test_into_darkness_and_out_of_it(dark_cutoff_hz, leak_hz):
    light = walks(2, 9, 24, lo=0.2, hi=40.0)
    light[2, ::2] = light[5:7, ::3] = light[3:5, 1::4] = 0.0
    circuit = Circuit(dark_cutoff_hz=dark_cutoff_hz, leak_hz=leak_hz, on=0.05, off=0.05)
    check(light, clock([12.0] * 8), circuit, at_least=200)


@pytest.mark.parametrize("floor", [5.0, 0.1, 0.002])
@pytest.mark.quick_cases(1)
def test_the_floor_under_a_pure_logarithm(floor):
    light = walks(2, 9, 24, lo=0.5 * floor, hi=200.0, steps=(0.3, 2.0))
    light[3, ::3] = 0.0
    circuit = replace(PURE, floor=floor, dark_cutoff_hz=21.8)
    check(light, clock([12.0] * 8), circuit, at_least=100)


# --- everything at once --------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(16))
def test_random_circuits_and_stimuli(seed):
    draw = np.random.default_rng(seed)
    lo, hi = (0.3, 900.0) if seed % 2 else (3.0, 255.0)
    light = walks(seed, 6, 24, lo=lo, hi=hi, steps=(0.02, 0.3, 1.5))
    circuit = Circuit(
        on=float(draw.choice([0.02, 0.05, 0.2, 0.4])),
        off=float(draw.choice([0.02, 0.05, 0.2, 0.4])),
        leak_hz=float(draw.choice([0.0, 3.0, 30.0, 100.0])),
        photo_leak_hz=float(draw.choice([0.0, 10.0, 100.0])),
        dead_time_us=[None, 50.0, 700.0, 5_000.0][seed % 4],
        linear_below=float(draw.choice([0.0, 2.72, 20.0])),
        dark_cutoff_hz=float(draw.choice([1.0, 21.8])),
        cutoff_hz=float(draw.choice([40.0, 300.0, 2000.0])),
    )
    check(light, clock(draw.choice([0.3, 1.0, 4.0, 12.0, 40.0], 5)), circuit, at_least=20)


# --- faults that there were, and what single precision costs --------------------------------------


def test_a_signal_whose_slope_is_exactly_zero():
    """Out of full darkness, where the corner follows the light alone: nothing moves at first."""
    light = single([[0.506, 0.3, 0.3007, 0.8838, 0.0, 1.4117]]).T
    circuit = Circuit(linear_below=2.72, cutoff_hz=2000.0, dark_cutoff_hz=0.0, on=0.01)
    check(light, clock([40.0, 4.0, 4.0, 4.0, 40.0]), replace(circuit, dead_time_us=700.0))


def test_a_floor_below_a_thousandth():
    light = single([[0.0, 0.0, 50.0, 50.0, 0.0, 0.0]]).T
    circuit = replace(PURE, floor=1e-4, dark_cutoff_hz=21.8)
    check(light, clock([20.0] * 5), circuit)


@pytest.mark.thorough
def test_leak_events_long_after_an_edge():
    """Default leak and dead time: after steps of three e-folds, the lag at the reset is rounded by
    some 1e-7, which a leak of 0.02 a second takes microseconds to cross, seconds later.
    """
    draw = np.random.default_rng(0)
    x0 = draw.uniform(math.log(21.0), math.log(255.0), 60)
    x1 = np.clip(x0 + draw.uniform(-3.0, 3.0, 60), math.log(21.0), math.log(255.0))
    light = single(np.exp(np.vstack([x0, x0, np.repeat(x1[None], 8, 0)])))
    circuit = Circuit(leak_hz=0.1, dead_time_us=500.0)
    check(light, clock([4.0] * 7 + [40.0, 12_000.0]), circuit, within_us=20.0)
