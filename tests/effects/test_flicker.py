"""Flicker: a sine on the light, at its frequency and phase."""

from __future__ import annotations

import math

import numpy as np

from adv2e import load_config, simulate
from adv2e.effects.frames.flicker import Flicker, FlickerHooks


def test_flicker_is_a_sine_on_the_light_at_the_phase_given():
    hook = FlickerHooks(Flicker(frequency_hz=100.0, depth=0.4, phase_rad=math.pi / 6))
    times = np.array([0.0, 0.0025, 0.005, 1e6 + 0.0075])
    expected = [1 + 0.4 * math.sin(math.pi / 6 + a * math.pi / 2) for a in range(4)]
    np.testing.assert_allclose(hook.gain(times), expected, atol=1e-6)
    assert hook.step_us == 100.0


def test_frequency_of_flicker_is_that_of_the_rate():
    def strongest_line(*sets):
        """Return the frequency of the strongest line of ON events, and its power beside others."""
        t = np.arange(501) / 500
        y, x = np.mgrid[:12, :16]
        moving = (
            (110 + 90 * np.sin(0.5 * (x - 0.1 * k)) * np.cos(0.4 * y)).astype(np.uint8)
            for k in range(t.size)
        )
        config = load_config([], ["frames.encoding=linear", "sampling.L=1", *sets])
        events = np.concatenate(list(simulate(moving, t, config)))
        seconds = 1e-6 * events["t"][events["p"] == 1]
        hz = np.arange(50.0, 240.0, 0.5)
        power = np.abs(np.exp(-2j * np.pi * hz[:, None] * seconds).sum(axis=1)) ** 2
        return hz[np.argmax(power)], power.max() / np.median(power)

    frequency, strength = strongest_line("frames.flicker={frequency_hz: 118.5, depth: 0.25}")
    assert frequency == 118.5
    assert strength > 200
    assert strongest_line()[1] < 50
