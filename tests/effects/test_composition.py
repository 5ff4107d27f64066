"""Many effects as one, and effects that go wrong."""

from __future__ import annotations

import numpy as np
import pytest

from adv2e import load_config, simulate
from adv2e.config.active_effects import active_hooks
from adv2e.config.model import Pixel, Sampling
from adv2e.effects.composition import (
    begin,
    course,
    injected,
    inside_pixel,
    longest_step_us,
    map_events,
)
from adv2e.effects.hooks import INJECTED_DTYPE, Hooks, View
from adv2e.effects.reorder_buffer import InOrder
from adv2e.errors import ConfigError, DataError
from adv2e.events import make_events
from adv2e.parameters import Fit, Section, parameter
from adv2e.pixel.state import make_circuit
from adv2e.pixel.steps import Coarseness, steps_of

ROWS, COLUMNS = 3, 4
TIMES = np.array([0.1, 0.2, 0.3])


class Lamp(Hooks):
    step_us = 40.0

    def gain(self, times_s):
        return 1.0 + times_s

    def drive(self, times_s):
        return times_s

    def thresholds(self, times_s):
        return np.full(times_s.size, 2.0), np.full(times_s.size, 0.5)


class Spots(Hooks):
    step_us = 70.0

    def gain(self, times_s):
        return None

    def drive(self, times_s):
        return np.ones((times_s.size, self.view.rows, self.view.columns))

    def signal(self, times_s):
        return -times_s

    def thresholds(self, times_s):
        return np.full(times_s.size, 3.0), np.full(times_s.size, 3.0)

    def inject(self, start_s, stop_s):
        return rows_of([start_s, 0.5 * (start_s + stop_s)], 1)


class Later(Hooks):
    def inject(self, start_s, stop_s):
        return rows_of([0.75 * start_s + 0.25 * stop_s], 2)


def rows_of(times, x):
    found = np.zeros(len(times), INJECTED_DTYPE)
    found["t"], found["x"] = times, x
    return found


def begun(*hooks):
    for hook in hooks:
        hook.begin(View(ROWS, COLUMNS, 0, 0.0))
    return hooks


def test_a_course_is_followed_every_100_us_in_a_diagnosis_too_unless_it_says_more():
    class Slow(Hooks):
        def gain(self, times_s):
            return 1.0 + times_s

    class Slower(Slow):
        step_us = 1000.0

    circuit = make_circuit(Pixel(), Sampling(), 0)

    def steps(hook, coarseness):
        (begun_hook,) = begun(hook())
        step_us = longest_step_us([begun_hook], 0.0, 0.01)
        return steps_of(10_000.0, circuit, step_us, coarseness=coarseness)

    assert steps(Slow, Coarseness()) == steps(Slower, Coarseness()) == 100
    assert steps(Slow, Coarseness(5.0)) == 100
    assert steps(Slower, Coarseness(5.0)) < 50


class Swallow(Hooks):
    stage = "readout"

    def events(self, chunks):
        for _ in chunks:
            yield from ()


@pytest.mark.parametrize(
    ("sets", "effects"),
    [((), []), (["readout.arbiter={event_ns: 100, row_ns: 1000}"], []), ((), [Swallow()])],
)
def test_where_nothing_fires_there_is_an_array_without_events(sets, effects):
    quiet = [f"pixel.{name}=null" for name in ("leak", "shot_noise")]
    config = load_config((), [*quiet, *sets])
    still = [np.full((3, 4), 0.2)] * 3
    chunks = list(simulate(still, [0.0, 0.01, 0.02], config, effects=effects))
    assert chunks
    assert not np.concatenate(chunks).size


def test_drives_add_up_and_factors_multiply():
    both = begun(Lamp(), Spots())
    assert longest_step_us(both, 0.0, 1.0) == 40.0
    wide = np.repeat(TIMES[:, None] + 1.0, 12, 1)
    np.testing.assert_array_equal(course(both, "drive", TIMES), wide)
    np.testing.assert_array_equal(course(both, "gain", TIMES)[:, 0], 1.0 + TIMES)
    np.testing.assert_array_equal(course(both, "signal", TIMES)[:, 0], -TIMES)
    np.testing.assert_array_equal(course(both, "on", TIMES)[:, 0], [6.0] * 3)
    np.testing.assert_array_equal(course(both, "off", TIMES)[:, 0], [1.5] * 3)
    assert course(begun(Lamp()), "signal", TIMES) is None


def test_steps_are_those_of_the_effect_that_needs_the_shortest_then():
    class Pulse(Lamp):
        def longest_step_us(self, start_s, stop_s):
            return 7.0 if start_s < 0.3 < stop_s else np.inf

    both = begun(Pulse(), Spots())
    assert longest_step_us(both, 0.1, 0.2) == 70.0
    assert longest_step_us(both, 0.2, 0.4) == 7.0
    assert longest_step_us(begun(Pulse()), 0.4, 0.5) == np.inf
    assert longest_step_us(begun(Later()), 0.0, 1.0) == np.inf


def test_injected_events_are_merged_by_time():
    found = injected(begun(Spots(), Later()), 1.0, 2.0)
    assert found["t"].tolist() == [1.0, 1.25, 1.5]
    assert found["x"].tolist() == [1, 2, 1]


def test_without_anything_inside_the_pixel_the_fast_path_stays():
    config = load_config([], ["frames.shift_px=[1, 0]", "readout.tick_us=10"])
    assert not inside_pixel(active_hooks(config))


def test_frames_reach_each_effect_as_the_one_before_left_them():
    seen = {}

    class Watching(Hooks):
        stage = "frames"

        def begin(self, view):
            super().begin(view)
            seen["start_s"] = view.start_s

        def light(self, frames):
            for t_ns, light in frames:
                seen.setdefault("first", (t_ns, float(light[0, 0])))
                yield t_ns, 2.0 * light

    sets = ["frames.clock_offset_us=500", "frames.black_level_dn=3"]
    hooks = active_hooks(load_config([], sets), [Watching()])
    frames = [(k * 10**6, np.full((ROWS, COLUMNS), 7.0)) for k in range(4)]
    found = list(begin(hooks, iter(frames), 0))
    assert seen == {"start_s": 0.0005, "first": (500_000, 10.0)}
    assert [t for t, _ in found] == [500_000 + k * 10**6 for k in range(4)]
    assert all(np.all(light == 20.0) for _, light in found)


def test_ticks_come_after_effects_of_ones_own():
    class Mine(Hooks):
        stage = "readout"

    config = load_config([], ["readout.tick_us=10", "readout.loss.fraction=0.5"])
    assert [hook.name for hook in active_hooks(config, [Mine()])] == [
        "event_loss", "mine", "timestamp_tick",
    ]  # fmt: skip


def test_names_and_parameters_of_an_effect():
    class Strength(Section):
        pass

    class RowNoiseHooks(Hooks):
        Parameters = Strength

    assert RowNoiseHooks.name == "row_noise"
    assert isinstance(RowNoiseHooks().parameters, Strength)
    with pytest.raises(TypeError):
        RowNoiseHooks(depth=3)


def test_numbers_drawn_for_a_purpose_are_uniform_and_its_own():
    view = View(ROWS, COLUMNS, 5, 0.0)
    draws = view.uniforms("a", np.arange(1000)[:, None], np.arange(20))
    assert draws.shape == (1000, 20)
    assert draws.mean() == pytest.approx(0.5, abs=0.01)
    assert np.unique(draws).size == draws.size
    assert np.array_equal(view.uniforms("a", 7, [3, 2]), draws[7, [3, 2]])
    assert not np.any(view.uniforms("b", np.arange(1000)) == draws[:, 0])
    assert not np.any(View(ROWS, COLUMNS, 6, 0.0).uniforms("a", np.arange(1000)) == draws[:, 0])


FRAMES = [np.full((ROWS, COLUMNS), 20.0 + 4 * k) for k in range(6)]


def run(hook):
    config = load_config([], ["frames.full_scale=255"])
    return list(simulate(FRAMES, [0.001 * k for k in range(6)], config, effects=[hook]))


def effect(**methods):
    return type("Mine", (Hooks,), {"__module__": __name__, **methods})()


BROKEN = {
    r"effect mine: drive: shape \(3,\), must be \(1,\) or \(1, 3, 4\)": {
        "drive": lambda self, t: np.zeros(3)
    },
    "effect mine: signal: values that are NaN": {"signal": lambda self, t: t * np.nan},
    "effect mine: thresholds: a factor of 0, must be above 0": {
        "thresholds": lambda self, t: (np.ones(t.size), np.zeros(t.size))
    },
    "effect mine: gain: a factor of -1, must be above 0": {
        "gain": lambda self, t: -np.ones(t.size)
    },
    "effect mine: light: a frame of shape": {
        "light": lambda self, frames: ((t, light[:2]) for t, light in frames)
    },
    "effect mine: longest_step_us: 0 us, must be above 0": {
        "signal": lambda self, t: t,
        "longest_step_us": lambda self, a, b: 0.0,
    },
    "effect mine: longest_step_us: nan us": {"signal": lambda self, t: t, "step_us": np.nan},
    "effect mine: inject: must be .* got float64": {"inject": lambda self, a, b: np.zeros(2)},
    "effect mine: inject: times must be sorted": {"inject": lambda self, a, b: rows_of([b], 0)},
    "effect mine: inject: x must be below 4": {"inject": lambda self, a, b: rows_of([a], 4)},
    "effect mine: events: must yield arrays": {"events": lambda self, chunks: iter([[1, 2]])},
    "effect mine: events: times must not decrease": {
        "events": lambda self, chunks: iter([make_events([5, 3], [0, 0], [0, 0], [1, 1])])
    },
    r"test_composition\.py:\d+: effect mine: ZeroDivisionError": {"drive": lambda self, t: 1 / 0},
    r"test_composition\.py:\d+: effect mine: KeyError: 'x'": {
        "events": lambda self, chunks: (events[{}["x"]] for events in chunks)
    },
}


@pytest.mark.parametrize("text", BROKEN)
def test_what_an_effect_does_wrong_is_one_line_that_names_it(text):
    with pytest.raises(DataError, match=text) as caught:
        run(effect(**BROKEN[text]))
    assert "\n" not in str(caught.value)


def test_what_goes_wrong_before_an_effect_is_not_blamed_on_it():
    def failing():
        yield make_events([1], [0], [0], [1])
        raise OSError("disk")

    hook = effect(events=lambda self, chunks: (events for events in chunks))
    begun(hook)
    with pytest.raises(OSError, match="disk"):
        list(map_events([hook], failing()))


def test_where_to_fit_must_make_sense():
    assert Fit(0.1, 10.0, 1.0, log=True).log
    for wrong in ((1.0, 0.5, 0.7), (0.0, 1.0, 2.0), (1.0, 1.0, 1.0)):
        with pytest.raises(ValueError, match="start"):
            Fit(*wrong)
    with pytest.raises(ValueError, match="above 0"):
        Fit(0.0, 1.0, 0.5, log=True)


def test_each_part_of_a_tuple_is_in_range():
    from dataclasses import dataclass

    @dataclass(frozen=True, kw_only=True)
    class Pair(Section):
        both: tuple[float, float] = parameter((1.0, 2.0), unit="px", meaning="two", at_least=0)

    assert Pair(both=(0.0, 3.0)).both == (0.0, 3.0)
    with pytest.raises(ConfigError, match="both: must be at least 0 px, got -1"):
        Pair(both=(0.0, -1.0))


def test_events_wait_until_none_before_them_can_come():
    order = InOrder()

    def times(t, end):
        events = make_events(t, [0] * len(t), [0] * len(t), [1] * len(t))
        return [e for part in order.add(events, end) for e in part["t"].tolist()]

    assert times([1, 5, 9], 5) == [1]
    assert times([6, 7, 12], 8) == [5, 6, 7]
    assert times([], 9) == []
    assert order.rest()["t"].tolist() == [9, 12]
    assert order.rest().size == 0
