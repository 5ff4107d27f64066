"""The pixel by plain differences in steps of 1 us; it shares no code with the package."""

import numpy as np

from reference.agreement import count_and_time_errors
from reference.circuit import Circuit
from reference.twin import log_of

STEP_S = 1e-6
PURE = Circuit(linear_below=0.0)


_DRAW = np.random.default_rng(5)
_WALK = np.log(50) + np.cumsum(_DRAW.normal(0, 0.35, (11, 20)), 0)

LIGHT = np.exp(np.clip(_WALK, 0.0, np.log(255))).astype(np.float32).astype(np.float64)
"""Light of 20 pixels that wanders, at 11 `TIMES` [DN]."""

TIMES = np.arange(11) * 0.004
"""[s]"""


def check(found, truth, *, least=60):
    """Compare events with those of the truth: nearly all pixels, and every time within 1 us."""
    agreement = count_and_time_errors(found, truth)
    assert agreement.count_b > least
    assert len(agreement.differing) <= len(truth) // 20
    times = [abs(a[:, 0] - b[:, 0]) for a, b in zip(found, truth, strict=True) if len(a) == len(b)]
    apart = 1e6 * np.concatenate(times)
    assert np.median(apart) < 0.2
    assert apart.max() < 1.0


class Truth:
    """Signal of all pixels in steps of 1 us, (steps + 1, pixels), and the events on it."""

    def __init__(self, signal):
        self.signal = signal
        self.at = np.arange(len(signal)) * STEP_S

    @classmethod
    def of_light(
        cls, light, times, *, slew=None, follower_hz=None, high_hz=None, drive=None, signal=None
    ):
        steps = round(times[-1] / STEP_S)
        at = np.arange(steps + 1) * STEP_S
        x = log_of(light, PURE)
        drive, signal = (f or (lambda t: np.zeros((len(t), 1))) for f in (drive, signal))
        y = x[0] + drive(at[:1])[0]
        z, b = y.copy(), 2 * np.pi * (follower_hz or 0.0) * STEP_S
        slow, c = y.copy(), 2 * np.pi * (high_hz or 0.0) * STEP_S
        middles = at[:-1] + 0.5 * STEP_S
        added = drive(middles)
        result = np.empty((steps + 1, light.shape[1]))
        result[0] = y
        k = np.clip(np.searchsorted(times, middles, "right") - 1, 0, len(times) - 2)
        share = (middles - times[k]) / (times[k + 1] - times[k])
        for j in range(steps):
            xm = x[k[j]] + (x[k[j] + 1] - x[k[j]]) * share[j]
            a = 2 * np.pi * (21.8 + 278.2 * np.exp(xm) / 255) * STEP_S
            move = a / (1 + a / 2) * (xm + added[j] - y)
            if slew is not None:
                move = np.clip(move, -slew * STEP_S, slew * STEP_S)
            before = z if follower_hz else y
            if follower_hz:
                z = z + b / (1 + b / 2) * (y + 0.5 * move - z)
            y = y + move
            after = z if follower_hz else y
            slow = slow + c / (1 + c / 2) * (0.5 * (before + after) - slow)
            result[j + 1] = after - (slow - result[0])
        return cls(result + signal(at))

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
