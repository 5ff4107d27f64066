"""What tests of the lanes share: few intervals, the kernel beside the dense truth."""

import math

import numpy as np
from harness import advance, by_pixel, quiet, start
from reference.agreement import count_and_time_errors
from reference.dense_ode import as_lists, find_events
from reference.dense_signal import solve_signal, turning_points

from adv2e.config.model import Leak, LogResponse, LowPass, Refractory
from adv2e.kernel import per_pixel


def clock(intervals_ms):
    """Times of the knots [s], in whole nanoseconds, from the lengths of the intervals."""
    at = np.concatenate([[0.0], np.cumsum(intervals_ms)]) * 1e-3
    return np.round(at * 1e9) * 1e-9


def sections_of(circuit):
    """Return the configuration's sections for a circuit of the reference."""
    sections = {
        "log_response": LogResponse(linear_below=circuit.linear_below, floor=circuit.floor),
        "low_pass": LowPass(cutoff_hz=circuit.cutoff_hz, dark_cutoff_hz=circuit.dark_cutoff_hz),
    }
    if circuit.dead_time_us is not None:
        sections["refractory"] = Refractory(period_us=circuit.dead_time_us)
    if circuit.leak_hz or circuit.photo_leak_hz:
        sections["leak"] = Leak(
            rate_hz=circuit.leak_hz, photo_rate_hz=circuit.photo_leak_hz, jitter=0.0
        )
    return sections


def fire(light, times, circuit, seed=0, **sections):
    """Return the kernel's events, one (events, 2) array a pixel, with the circuit's thresholds."""
    pixel = quiet(**sections_of(circuit), **sections)
    times_ns = [round(float(t) * 1e9) for t in times]
    array = start(light, times_ns, pixel, seed=seed, exact_times=True)
    array.state[per_pixel.ON], array.state[per_pixel.OFF] = circuit.levels(array.pixels)
    return by_pixel(array, *advance(array, light, times_ns))


def check(light, times, circuit, *, paths=None, at_least=1, within_us=1.0):
    """Compare kernel and truth; returns the truth's events."""
    truths = find_events(paths or solve_signal(light, times, circuit), circuit)
    truth, until = as_lists(truths)
    found = count_and_time_errors(fire(light, times, circuit), truth, until)
    assert sum(map(len, truth)) >= at_least
    assert found.left_out <= found.count_b, "hardly anything to compare: ties"
    assert not found.differing
    assert found.max_dt_us < within_us
    return truth


def turns(path):
    """Return when one pixel's signal turns [s]."""
    pieces = zip(path.start, path.length, path.signal, strict=True)
    return np.array(
        [
            t + 0.5 * (s + 1.0) * length
            for t, length, signal in pieces
            for s in turning_points(signal, -1.0, 1.0)
        ]
    )


def dense(path, points=400):
    """Return times [s], signal and leak of one pixel's path at many places."""
    s = np.cos(np.linspace(math.pi, 0.0, points))
    rows = [
        np.column_stack(
            [
                t + 0.5 * (s + 1.0) * h,
                np.polynomial.chebyshev.chebval(s, signal),
                np.polynomial.chebyshev.chebval(s, leak),
            ]
        )
        for t, h, signal, leak in zip(path.start, path.length, path.signal, path.leak, strict=True)
    ]
    return np.concatenate(rows)


def tangent_level(path, polarity, on=None):
    """Return the threshold that the distance from the reference just reaches.

    The reference falls in proportion to the ON threshold, so it takes part in its own tangent:
    y + on l = on at the most, which is on = max y / (1 - l).
    """
    _, y, leaked = dense(path).T
    away = y - y[0]
    if polarity > 0:
        return float(np.max(away / (1.0 - leaked)))
    return float(np.max(-(away + on * leaked)))
