"""Steps of time, counted before a simulation, beside those that the pixel asks for in it."""

from __future__ import annotations

import numpy as np
import pytest

from adv2e.config import load_config
from adv2e.config.active_effects import active_hooks
from adv2e.conversion.simulation import events_from_light
from adv2e.diagnosis.data.evidence import Evidence, RunIn
from adv2e.diagnosis.data.splits import Stream
from adv2e.diagnosis.simulation.affordable import FINE, steps_of_time
from adv2e.effects.hooks import Hooks

TIMES_S = 3.0 + np.cumsum([0.0, 0.004, 0.004, 0.02, 0.004, 0.013])

COUPLED = ["readout.frame_coupling.amplitude=0.05", "readout.frame_coupling.tau_us=500"]
PULSED = [
    *COUPLED[:1],
    "readout.frame_coupling.tau_us=20000",
    "readout.frame_coupling.width_us=800",
    "readout.frame_coupling.delay_us=-300",
    "readout.frame_coupling.rise_us=30",
]


class Asked(Hooks):
    """Adds nothing, and counts the times at which it is asked for it."""

    stage = "pixel"
    step_us = float("inf")

    def begin(self, view):
        super().begin(view)
        self.times = set()

    def signal(self, times_s):
        self.times.update(np.round(times_s * 1e9).tolist())
        return np.zeros(len(times_s))


def recording(times_s=TIMES_S, run_in=None):
    frames = [np.full((4, 6), 40 + 7 * k, np.uint8) for k in range(len(times_s))]
    nothing = np.zeros(0, np.int64)
    stream = Stream(nothing, nothing.astype(np.int32), nothing.astype(np.bool_), 6, 4)
    return Evidence("flat", frames, times_s, stream, 6, 4, run_in=run_in or RunIn())


@pytest.mark.parametrize(
    "keys",
    [
        ["pixel.slew_limit.per_s=80"],
        ["pixel.slew_limit.per_s=80", "frames.full_scale=16"],  # brighter than white
        ["pixel.slew_limit.per_s=80", "frames.full_scale=50", "sampling.L=1"],
        ["pixel.source_follower.cutoff_hz=900", "pixel.slew_limit.per_s=50"],
        ["pixel.slew_limit.per_s=50"],
        ["pixel.low_pass.update=paper", "sampling.K=6"],
        ["pixel.thresholds.drift_per_s=0.1", "pixel.slew_limit.per_s=50", "sampling.L=1"],
        ["pixel.reset_overshoot.fraction=0.1", "pixel.low_pass.update=euler", "sampling.K=7"],
        ["frames.flicker.frequency_hz=100", "frames.flicker.depth=0.1"],
        COUPLED,
        PULSED,
        ["pixel.reset_overshoot.fraction=0.1", "sampling.last_interval=printed", "sampling.K=3"],
        [*COUPLED, "frames.clock_offset_us=1500", "frames.exposure_us=2000", "sampling.L=3"],
    ],
)
def test_as_many_steps_are_counted_as_the_pixel_takes(keys):
    config = load_config(["adv2e"], keys)
    shown, asked = recording(), Asked()
    light = zip(shown.times_ns, shown.lights(config), strict=True)
    hooks = active_hooks(config, [asked])
    for _ in events_from_light(light, config, threads=1, hooks=hooks, coarseness=FINE):
        pass
    taken = len(asked.times) - 1  # the first is where it begins
    assert steps_of_time(shown, config) == taken


@pytest.mark.parametrize(
    "keys", [[], ["pixel.source_follower.cutoff_hz=900"], ["pixel.thresholds.drift_per_s=0.1"]]
)
def test_no_steps_where_the_pixel_is_solved_from_event_to_event(keys):
    assert steps_of_time(recording(), load_config(["davis346"], keys)) == 0


def test_what_pixels_saw_before_is_counted():
    config = load_config(["adv2e"], ["pixel.slew_limit.per_s=80"])
    before = recording(TIMES_S[:3]), recording(TIMES_S[2:])
    parted = recording(TIMES_S[3:], RunIn(before[0].frames, TIMES_S[:3]))
    assert steps_of_time(parted, config) == steps_of_time(recording(), config)
    assert sum(steps_of_time(part, config) for part in before) == steps_of_time(parted, config)


def test_effects_of_ones_own_see_the_frames():
    seen = []

    class Looks(Hooks):
        stage = "frames"

        def light(self, frames):
            for t_ns, light in frames:
                seen.append(light.copy())
                yield t_ns, light

    config = load_config(["adv2e"], ["pixel.slew_limit.per_s=80"], effects=[Looks])
    shown = recording()
    assert steps_of_time(shown, config) > 0
    np.testing.assert_array_equal(seen, list(shown.lights(config)))
