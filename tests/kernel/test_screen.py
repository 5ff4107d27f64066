"""The first pass over all pixels: its end values, and that no pixel that fires is missed."""

import itertools
import math
from typing import Any, NamedTuple

import numpy as np
import pytest
from harness import quiet

from adv2e.config.model import LogResponse, LowPass, Sampling
from adv2e.kernel import quadrature, screen
from adv2e.kernel import static_pixels as rest
from adv2e.kernel.quadrature import Rule
from adv2e.pixel.array import make_circuit

PIXELS = screen.STRIP


def draw(seed, knee, largest=0.99):
    """Return light at both ends on one branch of the map, and lags: random and adversarial ones."""
    rng = np.random.default_rng(seed)
    x0 = rng.uniform(np.log(max(knee, 0.2)), np.log(255), PIXELS)
    dx = rng.uniform(-largest, largest, PIXELS)
    dx[:40] = 0.0  # at rest
    dx[40:60] = 1e-9 * rng.standard_normal(20)
    x1 = np.clip(x0 + dx, np.log(max(knee, 0.2)), np.log(255))
    lag = rng.normal(0, 0.3, PIXELS)
    lag[60:100] = 0.0
    # y meets x late, early, and hardly at all: tangents
    lag[100:200] = -(x1 - x0)[100:200] * rng.uniform(0, 1.5, 100) ** 3
    return x0, x1, lag


def integrate(x0, x1, lag, length_us, circuit, steps=4000):
    """Return y at many instants, by a fourth-order Runge-Kutta method on the equation itself."""

    def at(s):
        x = x0 + (x1 - x0) * s
        return x, length_us * (circuit.dark + circuit.per_dn * light(x, circuit))

    h, y = 1 / steps, x0 + lag
    path = [y]
    end, end_rate = at(0.0)
    for k in range(steps):
        begin, begin_rate = end, end_rate
        middle, middle_rate = at((k + 0.5) * h)
        end, end_rate = at((k + 1) * h)
        k1 = begin_rate * (begin - y)
        k2 = middle_rate * (middle - y - h / 2 * k1)
        k3 = middle_rate * (middle - y - h / 2 * k2)
        k4 = end_rate * (end - y - h * k3)
        y = y + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        path.append(y)
    return np.array(path)


def light(x, circuit):
    if circuit.slope == 0:
        return np.exp(x)
    return np.where(x < circuit.knee, x * circuit.slope, np.exp(x))


CASES = [
    (quiet(log_response=LogResponse(linear_below=0), low_pass=LowPass(dark_cutoff_hz=0)), 0.0),
    (quiet(), 20.0),
    (quiet(low_pass=LowPass(cutoff_hz=2000.0, dark_cutoff_hz=1.0)), 20.0),
    (quiet(low_pass=LowPass(cutoff_hz=15.0, dark_cutoff_hz=15.0)), 20.0),
]


def fill(pixel, x0, x1, lag):
    """Return the circuit and the rows of one strip: thresholds and reference out of reach."""
    circuit = make_circuit(pixel, Sampling(), 0)
    rows = screen.new_rows()
    for row, values in (
        (screen.LIGHT_0, light(x0, circuit)),
        (screen.LIGHT_1, light(x1, circuit)),
        (screen.LAG_0, lag),
    ):
        rows[row : row + PIXELS] = values
    return circuit, rows


def run(circuit, rows, length, end=0.0):
    fastest = circuit.dark + 255 * circuit.per_dn
    nodes, weights = quadrature.quadrature(length, fastest)
    f = np.float32
    screen.screen(
        rows,
        f(end),
        f(circuit.dark * length),
        f(circuit.per_dn * length),
        f(circuit.slope * circuit.knee),
        f(circuit.slope),
        Rule(nodes, weights, nodes, weights),
    )


def row(rows, which):
    return rows[which : which + PIXELS].astype(float)


def true_path(circuit, rows, length):
    """Return x at both ends and the path of y, for the light and lag that the rows hold."""
    i0, i1 = row(rows, screen.LIGHT_0), row(rows, screen.LIGHT_1)
    knee_dn = circuit.slope * circuit.knee
    x0, x1 = (
        np.where(i >= knee_dn, np.log(np.maximum(i, 1e-3)), i / (circuit.slope or 1.0))
        for i in (i0, i1)
    )
    fastest = (circuit.dark + 255 * circuit.per_dn) * length
    steps = max(2000, int(25 * fastest))
    return x0, x1, integrate(x0, x1, row(rows, screen.LAG_0), length, circuit, steps=steps)


class Strip(NamedTuple):
    """A strip's pixels over one interval: what the pass is given, and what their signals do."""

    seed: int
    length: float
    circuit: Any
    given: np.ndarray
    x0: np.ndarray
    x1: np.ndarray
    last: np.ndarray
    highest: np.ndarray
    lowest: np.ndarray


@pytest.fixture(
    scope="module",
    params=itertools.product(range(len(CASES)), [500.0, 4167.0, 33_333.0], range(3)),
    ids=lambda param: "-".join(map(str, param)),
)
def strip(request):
    number, length, seed = request.param
    pixel, knee = CASES[number]
    circuit, rows = fill(pixel, *draw(seed, knee, largest=0.97))
    x0, x1, path = true_path(circuit, rows, length)
    signal = path[-1], path.max(0), path.min(0)
    return Strip(seed, length, circuit, rows, x0, x1, *signal)


@pytest.mark.quick_cases(1)
def test_end_values(strip):
    circuit, rows, length, x0, x1 = (
        strip.circuit, strip.given.copy(), strip.length, strip.x0, strip.x1
    )  # fmt: skip
    run(circuit, rows, length)
    # in terms of event time: an error of the lag moves an event by error / slope, the slope being
    # rate times lag, or what the lag comes to be while x moves, or was at the start
    rate = circuit.dark + circuit.per_dn * light(x1, circuit)
    usual = np.abs(x1 - x0) / np.maximum(1.0, rate * length)
    decayed = np.abs(row(rows, screen.LAG_0)) * np.exp(-np.minimum(rate * length, 50.0))
    lag = np.maximum(np.maximum(usual, decayed), 3e-5)
    moved = np.abs(strip.last - x1 - row(rows, screen.LAG_1)) / (rate * lag)
    # single precision itself: a few roundings of the lag, over the corner
    assert np.max(moved - 4e-7 / rate) < 0.1


def test_no_pixel_that_fires_is_missed(strip):
    """Thresholds that the signal just reaches: at its ends, at its turn, at a tangent."""
    rows = strip.given.copy()
    rng = np.random.default_rng(strip.seed)
    away = rng.uniform(-0.3, 0.3, PIXELS).astype(np.float32)
    high, low = strip.highest - strip.x0 + away, strip.lowest - strip.x0 + away
    reached = 1e-6
    for leak in (0.0, 0.01):
        for on, off in ((high + leak - reached, 1e3), (1e3, -low - reached)):
            rows[screen.AWAY_0 : screen.AWAY_0 + PIXELS] = away
            rows[screen.FALL : screen.FALL + PIXELS] = leak
            rows[screen.ON : screen.ON + PIXELS] = on - screen.MARGIN
            rows[screen.OFF : screen.OFF + PIXELS] = off - screen.MARGIN
            run(strip.circuit, rows, strip.length)
            assert np.all(row(rows, screen.HIT) > 0.0)


def test_the_bound_is_worth_having():
    """A threshold a little beyond what the signal reaches is seldom looked at."""
    circuit, rows = fill(quiet(), *draw(1, 20.0))
    x0, _, path = true_path(circuit, rows, 4167.0)
    rows[screen.ON : screen.ON + PIXELS] = path.max(0) - x0 + 0.02
    rows[screen.OFF : screen.OFF + PIXELS] = x0 - path.min(0) + 0.02
    run(circuit, rows, 4167.0)
    ordinary = np.abs(row(rows, screen.LAG_0)) < 0.1
    ordinary &= np.minimum(row(rows, screen.LIGHT_0), row(rows, screen.LIGHT_1)) > 20.1
    assert np.count_nonzero(ordinary) > 200
    assert row(rows, screen.HIT)[ordinary].mean() < 0.05


@pytest.mark.parametrize("largest", [0.5, 3.0])
def test_what_the_pass_cannot_judge_is_flagged(largest):
    """The knee inside the interval, steps above an e-fold, light beyond the quadrature."""
    rng = np.random.default_rng(3)
    x0 = rng.uniform(0.0, math.log(255), PIXELS)
    x1 = np.clip(x0 + rng.uniform(-largest, largest, PIXELS), 0.0, math.log(500))
    circuit, rows = fill(quiet(), x0, x1, 0.0)
    run(circuit, rows, 4167.0)
    far = np.abs(x1 - x0) > 1.0
    mixed = (x0 < circuit.knee) != (x1 < circuit.knee)
    bright = light(x1, circuit) > screen.LARGEST_LIGHT
    assert np.all(row(rows, screen.HIT)[far | mixed | bright] == screen.BY_ITSELF)
    assert np.count_nonzero(mixed) > 20
    clear = (np.abs(x1 - x0) < 0.97) & ~mixed & ~bright
    assert not np.any(row(rows, screen.HIT)[clear])


def test_ends_of_dead_times_and_noise_events_are_flagged():
    circuit, rows = fill(quiet(), *draw(0, 20.0, largest=0.5))
    rows[screen.DUE : screen.DUE + PIXELS] = np.linspace(0.0, 8000.0, PIXELS)
    run(circuit, rows, 4000.0, end=4000.0)
    due = row(rows, screen.DUE) < 4000.0
    assert np.array_equal(row(rows, screen.HIT) == screen.WHEN_DUE, due)


def test_at_rest_it_agrees_with_itself():
    """The shorter pass for strips at rest flags what the whole one flags."""
    x = np.linspace(0.5, 5.4, PIXELS)
    circuit, rows = fill(quiet(), x, x, 0.0)
    rng = np.random.default_rng(1)
    away = rng.uniform(-0.2, 0.2, PIXELS)
    rows[screen.AWAY_0 : screen.AWAY_0 + PIXELS] = away
    rows[screen.FALL : screen.FALL + PIXELS] = 0.01
    rows[screen.ON : screen.ON + PIXELS] = 0.19
    rows[screen.OFF : screen.OFF + PIXELS] = 0.19
    rows[screen.DUE : screen.DUE + PIXELS] = rng.uniform(0, 2e5, PIXELS)
    assert screen.is_still(rows)
    assert screen.is_settled(rows)
    run(circuit, rows, 4000.0, end=4000.0)
    whole = row(rows, screen.HIT)
    numbers = np.zeros(PIXELS + 16, np.int64)
    count = screen.flagged(rows, numbers)
    assert 20 < count < PIXELS // 2
    assert np.array_equal(numbers[:count], np.flatnonzero(whole))
    rows[screen.FALL : screen.FALL + PIXELS] /= 4000.0  # a us
    rest.begin_rest(np.float32(0.0), rows)
    starts = np.array([0.0, 4000.0])
    for b in range(0, PIXELS, rest.BLOCK):
        size = min(rest.BLOCK, PIXELS - b)
        due = np.flatnonzero(whole[b : b + size])
        assert rest.next_due(b, 0, 1, starts, rows) == (0 if due.size else 1)
        count = rest.flag_block(b, size, np.float32(4000.0), rows, numbers)
        assert np.array_equal(numbers[:count], b + due)


def test_quadrature_is_chosen_by_its_error():
    short, long = (
        quadrature.quadrature(100.0, 1.9e-3)[0],
        quadrature.quadrature(33_000.0, 1.9e-3)[0],
    )
    assert 3 <= short.size < long.size < quadrature.NODES_MAX
