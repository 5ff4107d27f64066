"""The fast pass over all pixels: its end values, and that its bounds are never exceeded."""

import math

import numpy as np
import pytest
from harness import quiet

from adv2e.config.model import Leak, LogResponse, LowPass
from adv2e.kernel import screen
from adv2e.pixel import make_circuit

PIXELS = 384


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

    def slope(s, y):
        x = x0 + (x1 - x0) * s
        return length_us * (circuit.dark + circuit.per_dn * light(x, circuit)) * (x - y)

    h, y = 1 / steps, x0 + lag
    path = [y]
    for k in range(steps):
        s = k * h
        k1 = slope(s, y)
        k2 = slope(s + h / 2, y + h / 2 * k1)
        k3 = slope(s + h / 2, y + h / 2 * k2)
        k4 = slope(s + h, y + h * k3)
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


def screened(pixel, x0, x1, lag, length):
    circuit = make_circuit(pixel, 10, 0)
    fastest = circuit.dark + 255 * circuit.per_dn
    nodes, weights = screen.quadrature(length, fastest)
    i0, i1 = light(x0, circuit), light(x1, circuit)
    end, low, high = (np.empty(PIXELS) for _ in range(3))
    columns = np.zeros((13, screen.STRIP))
    screen.end_lags(i0, i1, x0, x1, lag, length, circuit, nodes, weights, PIXELS, columns, end)
    screen.hull(i0, x0, x1, lag, end, length, circuit, PIXELS, low, high)
    return circuit, end, low, high


@pytest.mark.parametrize(("pixel", "knee"), CASES)
@pytest.mark.parametrize("length", [500.0, 4167.0, 33_333.0])
def test_end_values_and_bounds(pixel, knee, length):
    for seed in range(3):
        x0, x1, lag = draw(seed, knee)
        circuit, end, low, high = screened(pixel, x0, x1, lag, length)
        fastest = (circuit.dark + 255 * circuit.per_dn) * length
        path = integrate(x0, x1, lag, length, circuit, steps=max(2000, int(25 * fastest)))
        # in terms of event time: an error of the lag moves an event by error / slope, the slope
        # being rate times lag, or what the lag comes to be while x moves
        rate = circuit.dark + circuit.per_dn * light(x1, circuit)
        usual = np.abs(x1 - x0) / np.maximum(1.0, rate * length)
        error = np.abs(path[-1] - x1 - end)
        moved = error / (rate * np.maximum(np.maximum(np.abs(end), usual), 3e-5))
        assert moved.max() < 0.05
        assert (path.max(0) - high).max() < screen.MARGIN
        assert (low - path.min(0)).max() < screen.MARGIN


def test_bounds_on_the_foot_of_the_map():
    pixel = quiet()
    rng = np.random.default_rng(5)
    x0 = rng.uniform(0, 0.99 * math.log(20), PIXELS)
    x1 = np.clip(x0 + rng.uniform(-1, 1, PIXELS), 0, 0.999 * math.log(20))
    lag = rng.normal(0, 0.2, PIXELS)
    circuit, end, low, high = screened(pixel, x0, x1, lag, 4167.0)
    path = integrate(x0, x1, lag, 4167.0, circuit)
    assert np.abs(path[-1] - x1 - end).max() < 1e-8
    assert (path.max(0) - high).max() < screen.MARGIN
    assert (low - path.min(0)).max() < screen.MARGIN


def test_stepped_forms_stay_between_their_steps():
    for update in ("paper", "euler", "zero_order_hold", "first_order_hold"):
        pixel = quiet(low_pass=LowPass(update=update), leak=Leak(rate_hz=1.0))
        circuit = make_circuit(pixel, 7, 0)
        x0, x1, lag = draw(1, 20.0)
        end, low, high = (np.empty(PIXELS) for _ in range(3))
        columns = np.zeros((13, screen.STRIP))
        i0, i1 = light(x0, circuit), light(x1, circuit)
        screen.stepped_lags(i0, i1, x0, x1, lag, 4167.0, circuit, PIXELS, columns, end, low, high)
        assert np.all(low <= np.minimum(x0 + lag, x1 + end) + 1e-12)
        assert np.all(high >= np.maximum(x0 + lag, x1 + end) - 1e-12)


def test_quadrature_is_chosen_by_its_error():
    short, long = screen.quadrature(100.0, 1.9e-3)[0], screen.quadrature(33_000.0, 1.9e-3)[0]
    assert 3 <= short.size < long.size < screen.NODES_MAX
