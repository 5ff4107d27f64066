"""Effects of the stepping path against plain differences in steps of 1 us."""

import numpy as np
import pytest
from harness import quiet, solve
from reference.agreement import count_and_time_errors
from reference.circuit import Circuit
from reference.twin import light_of, log_of

from adv2e.additions import INJECTED_DTYPE, Additions
from adv2e.config.model import (
    LogResponse,
    LowPass,
    Refractory,
    ResetOvershoot,
    SlewLimit,
    SourceFollower,
    Thresholds,
)
from adv2e.errors import ConfigError, DataError

STEP_S = 1e-6
PURE = Circuit(linear_below=0.0)
SPEEDS = 0.35


def moving_light(knots, pixels, seed, step=SPEEDS):
    draw = np.random.default_rng(seed)
    walk = np.log(50) + np.cumsum(draw.normal(0, step, (knots, pixels)), 0)
    return np.exp(np.clip(walk, 0.0, np.log(255))).astype(np.float32).astype(np.float64)


class Truth:
    """Signal of all pixels in steps of 1 us, and the events on it."""

    def __init__(self, light, times, *, slew=None, follower_hz=None, drive=None, signal=None):
        steps = round(times[-1] / STEP_S)
        self.at = np.arange(steps + 1) * STEP_S
        x = log_of(light, PURE)
        drive, signal = (f or (lambda t: np.zeros((len(t), 1))) for f in (drive, signal))
        y = x[0] + drive(self.at[:1])[0]
        z, b = y.copy(), 2 * np.pi * (follower_hz or 0.0) * STEP_S
        middles = self.at[:-1] + 0.5 * STEP_S
        added = drive(middles)
        self.signal = np.empty((steps + 1, light.shape[1]))
        self.signal[0] = y
        k = np.clip(np.searchsorted(times, middles, "right") - 1, 0, len(times) - 2)
        share = (middles - times[k]) / (times[k + 1] - times[k])
        for j in range(steps):
            xm = x[k[j]] + (x[k[j] + 1] - x[k[j]]) * share[j]
            a = 2 * np.pi * (21.8 + 278.2 * np.exp(xm) / 255) * STEP_S
            move = a / (1 + a / 2) * (xm + added[j] - y)
            if slew is not None:
                move = np.clip(move, -slew * STEP_S, slew * STEP_S)
            if follower_hz:
                z = z + b / (1 + b / 2) * (y + 0.5 * move - z)
            y = y + move
            self.signal[j + 1] = z if follower_hz else y
        self.signal += signal(self.at)

    def events(self, on=0.2, off=0.2, dead_s=None, overshoot=0.0, factor=None, noise=()):
        """Return (events, 2) a pixel; `noise`: (time [s], pixel, polarity), sorted."""
        factors = np.ones_like(self.at) if factor is None else factor(self.at)
        return [
            self._of(
                i, on * factors, off * factors, dead_s, overshoot, [n for n in noise if n[1] == i]
            )
            for i in range(self.signal.shape[1])
        ]

    def _of(self, i, on, off, dead_s, overshoot, noise):
        signal, events, t, reference = self.signal[:, i], [], 0.0, self.signal[0, i]
        while True:
            due = next((n for n in noise if n[0] >= t), None)
            first, polarity = self._next_crossing(signal - reference, on, off, t)
            if due is None and first is None:
                return np.array(events).reshape(-1, 2)
            noisy = first is None or (due is not None and due[0] < first)
            t, polarity = (due[0], due[2]) if noisy else (first, polarity)
            events.append((t, polarity))
            level = polarity * np.interp(t, self.at, on if polarity > 0 else off)
            if dead_s is not None:
                t += dead_s
                if t >= self.at[-1]:
                    return np.array(events)
            if noisy or dead_s is not None:
                reference = np.interp(t, self.at, signal)
                first_level = on[0] if polarity > 0 else -off[0]
                reference += overshoot * first_level
            else:
                reference += level * (1 + overshoot)
            if noisy and dead_s is None:
                t = np.nextafter(t, 1.0)

    def _next_crossing(self, d, on, off, t):
        k = int(t / STEP_S)
        beyond = np.maximum(d - on, -d - off)
        here = np.interp(t, self.at[k : k + 2], beyond[k : k + 2])
        ahead = np.flatnonzero(beyond[k + 1 :] >= 1e-9)
        if not len(ahead):
            return None, 0
        j = k + int(ahead[0])  # crossed between j and j + 1
        before = max(here, -1e300) if j == k else beyond[j]
        since = t if j == k else self.at[j]
        share = min(max(-before / (beyond[j + 1] - before), 0.0), 1.0)
        sign = 1 if d[j + 1] - on[j + 1] >= -d[j + 1] - off[j + 1] else -1
        return since + (self.at[j + 1] - since) * share, sign


def pixel(**sections):
    return quiet(log_response=LogResponse(linear_below=0), **sections)


def compare(found, truth, *, least=60):
    agreement = count_and_time_errors(found, truth)
    assert agreement.count_b > least
    assert len(agreement.differing) <= len(truth) // 20
    times = [abs(a[:, 0] - b[:, 0]) for a, b in zip(found, truth, strict=True) if len(a) == len(b)]
    apart = 1e6 * np.concatenate(times)
    assert np.median(apart) < 0.2
    assert apart.max() < 3.0


LIGHT = moving_light(11, 20, seed=5)
TIMES = np.arange(11) * 0.004
DEAD = {"refractory": Refractory(period_us=900.0)}


@pytest.mark.parametrize("per_s", [15.0, 40.0, 120.0])
@pytest.mark.parametrize("follower_hz", [None, 250.0])
def test_slew_limit(per_s, follower_hz):
    sections = {"slew_limit": SlewLimit(per_s=per_s)}
    if follower_hz:
        sections["source_follower"] = SourceFollower(cutoff_hz=follower_hz)
    truth = Truth(LIGHT, TIMES, slew=per_s, follower_hz=follower_hz)
    compare(solve(LIGHT, TIMES, pixel(**sections)), truth.events(), least=20)


def test_slew_limit_of_no_account_changes_nothing():
    found = solve(LIGHT, TIMES, pixel(slew_limit=SlewLimit(per_s=1e6)))
    plain = solve(LIGHT, TIMES, pixel(), method="dense")
    assert all(np.array_equal(a, b) for a, b in zip(found, plain, strict=True))


def test_slew_limit_holds_for_the_stepped_forms_too():
    """A step of the light becomes a ramp whatever the update."""
    light = np.array([[2.0], [200.0], [200.0]])
    slew = SlewLimit(per_s=40.0)
    for update in ("first_order_hold", "zero_order_hold", "euler"):
        low_pass = LowPass(cutoff_hz=3000.0, update=update)
        events = solve(light, [0.0, 0.001, 0.2], pixel(low_pass=low_pass, slew_limit=slew), K=200)
        np.testing.assert_allclose(np.diff(events[0][2:18, 0]), 0.2 / 40.0, rtol=1e-6)


@pytest.mark.parametrize("fraction", [-0.3, 0.15, 0.4])
@pytest.mark.parametrize("dead_us", [None, 900.0])
def test_reset_overshoot_and_noise_events(fraction, dead_us):
    noise = [(0.0031, 2, 1), (0.00312, 2, -1), (0.02004, 7, -1), (0.0391, 2, -1)]
    sections = {"reset_overshoot": ResetOvershoot(fraction=fraction)}
    if dead_us:
        sections["refractory"] = Refractory(period_us=dead_us)

    def inject(t0, t1):
        rows = [(t, i, 0, p > 0) for t, i, p in noise if t0 <= t < t1]
        return np.array(rows, INJECTED_DTYPE)

    options = {"additions": Additions(step_us=1000.0, inject=inject), "chunk": 3}
    found = solve(LIGHT, TIMES, pixel(**sections), **options)
    dead_s = dead_us and dead_us * 1e-6
    truth = Truth(LIGHT, TIMES).events(dead_s=dead_s, overshoot=fraction, noise=noise)
    compare(found, truth)


@pytest.mark.parametrize("per_s", [-8.0, 6.0])
def test_threshold_drift(per_s):
    thresholds = Thresholds(on=0.2, off=0.15, mismatch=0.0, drift_per_s=per_s)
    found = solve(LIGHT, TIMES, pixel(thresholds=thresholds, **DEAD))
    truth = Truth(LIGHT, TIMES)
    expected = truth.events(off=0.15, dead_s=9e-4, factor=lambda t: 1 + per_s * t)
    compare(found, expected)
    assert sum(map(len, found)) != sum(map(len, truth.events(off=0.15, dead_s=9e-4)))


def test_thresholds_that_drift_to_zero_are_an_error():
    thresholds = Thresholds(drift_per_s=-30.0)
    with pytest.raises(ConfigError, match=r"drift_per_s: -30 1/s .* 0\.0333 s after"):
        solve(LIGHT, TIMES, pixel(thresholds=thresholds))


def wave(share, frequency):
    return lambda t: share * np.sin(2 * np.pi * frequency * t)


@pytest.mark.parametrize("wide", [False, True])
def test_drive_signal_and_thresholds_that_change(wide):
    """Courses for all pixels alike, and one a pixel."""
    shape = np.linspace(0.5, 1.5, LIGHT.shape[1]) if wide else np.ones(1)

    def course(values):
        return lambda t: values(t)[:, None] * shape if wide else values(t)

    drive, signal = wave(0.3, 120.0), lambda t: 0.1 * np.cos(2 * np.pi * 90.0 * t)
    factor = lambda t: 1 + 0.3 * np.sin(2 * np.pi * 37.0 * t)  # noqa: E731
    ones = np.ones(LIGHT.shape[1])
    additions = Additions(
        step_us=25.0,
        drive=course(drive),
        signal=course(signal),
        on=(lambda t: factor(t)[:, None] * ones) if wide else factor,
        off=factor,
    )
    found = solve(LIGHT, TIMES, pixel(**DEAD), additions=additions)
    truth = Truth(
        LIGHT,
        TIMES,
        drive=lambda t: drive(t)[:, None] * shape,
        signal=lambda t: signal(t)[:, None] * shape,
    )
    expected = truth.events(dead_s=9e-4, factor=factor)
    agreement = count_and_time_errors(found, expected)
    assert agreement.count_b > 100
    assert len(agreement.differing) <= 1
    assert agreement.mean_dt_us < 0.6  # courses are lines within a step


def test_all_at_once():
    thresholds = Thresholds(on=0.2, off=0.15, mismatch=0.0, drift_per_s=4.0)
    sections = {
        "thresholds": thresholds,
        "slew_limit": SlewLimit(per_s=40.0),
        "source_follower": SourceFollower(cutoff_hz=250.0),
        "reset_overshoot": ResetOvershoot(fraction=0.2),
        **DEAD,
    }
    truth = Truth(LIGHT, TIMES, slew=40.0, follower_hz=250.0)
    expected = truth.events(off=0.15, dead_s=9e-4, overshoot=0.2, factor=lambda t: 1 + 4 * t)
    compare(solve(LIGHT, TIMES, pixel(**sections)), expected, least=40)


def test_light_of_the_reference_is_what_the_truth_here_takes():
    x = np.log(np.array([1.0, 50.0, 255.0]))
    np.testing.assert_allclose(light_of(x, PURE), np.exp(x))


WRONG = {
    "shape": (Additions(step_us=50.0, drive=lambda t: np.zeros((len(t), 3))), "drive: shape"),
    "not finite": (Additions(step_us=50.0, signal=lambda t: t * np.nan), "signal: all values"),
    "zero": (Additions(step_us=50.0, on=lambda t: 0.0 * t), "on: all values .* above 0"),
    "outside": (
        Additions(step_us=50.0, inject=lambda a, b: np.array([(a, 900, 0, 1)], INJECTED_DTYPE)),
        "outside of the picture",
    ),
    "late": (
        Additions(step_us=50.0, inject=lambda a, b: np.array([(b, 0, 0, 1)], INJECTED_DTYPE)),
        "inject: times",
    ),
    "not events": (Additions(step_us=50.0, inject=lambda a, b: np.zeros(3)), "inject: must"),
}


@pytest.mark.parametrize("name", WRONG)
def test_additions_that_are_wrong_are_errors(name):
    additions, message = WRONG[name]
    with pytest.raises(DataError, match=message):
        solve(LIGHT, TIMES, pixel(), additions=additions)


def test_a_step_of_nothing_is_an_error():
    with pytest.raises(DataError, match="step_us"):
        Additions(step_us=0.0)
