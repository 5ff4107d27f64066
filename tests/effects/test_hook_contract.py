"""What must hold of every effect that works through hooks."""

from __future__ import annotations

import importlib
import re

import numpy as np
import pytest

from adv2e import load_config, simulate
from adv2e.config import all_keys
from adv2e.config.active_effects import active_hooks
from adv2e.effects import EFFECTS
from adv2e.effects.hooks import Hooks
from adv2e.events import sort_events
from adv2e.light import intervals

# effect: (values that do something here, neutral ones)
CASES = {
    "clock_drift": ("frames.clock_drift_ppm=2000", "frames.clock_drift_ppm=0"),
    "clock_offset": ("frames.clock_offset_us=-1500", "frames.clock_offset_us=0"),
    "black_level": ("frames.black_level_dn=4", "frames.black_level_dn=0"),
    "exposure_blur": ("frames.exposure_us=5000", "frames.exposure_us=0"),
    "misregistration": ("frames.shift_px=[0.4, -1]", "frames.shift_px=[0, 0]"),
    "flicker": (
        "frames.flicker={frequency_hz: 120, depth: 0.3}",
        "frames.flicker={frequency_hz: 120, depth: 0}",
    ),
    "dark_current": ("pixel.dark_current.dn=10", "pixel.dark_current.dn=0"),
    "dead_pixels": ("pixel.dead_pixels.fraction=0.2", "pixel.dead_pixels.fraction=0"),
    "frame_coupling": (
        "readout.frame_coupling={amplitude: 0.3, tau_us: 900}",
        "readout.frame_coupling={amplitude: 0, tau_us: 900}",
    ),
    "readout": (
        "readout.arbiter={event_ns: 3000, row_ns: 30000}",
        "readout.arbiter={event_ns: 0, row_ns: 0}",
    ),
    "double_read": (
        "readout.double_read={on: 0.1, off: 0.2, polarity: on}",
        "readout.double_read={on: 0, off: 0}",
    ),
    "event_loss": ("readout.loss.fraction=0.3", "readout.loss.fraction=0"),
    "timestamp_tick": ("readout.tick_us=250", "readout.tick_us=1"),
}
ROWS, COLUMNS, COUNT = 9, 14, 40
TIMES = [3.0 + 0.002 * k for k in range(COUNT)]
LIGHT = "frames.encoding=linear"


def frames():
    y, x = np.mgrid[:ROWS, :COLUMNS]
    for k in range(COUNT):
        yield (110 + 90 * np.sin(0.5 * (x - 0.4 * k)) * np.cos(0.4 * y)).astype(np.uint8)


def events(*sets, L=1, threads=1):
    config = load_config([], [LIGHT, f"sampling.L={L}", "pixel.shot_noise.rate_hz=20", *sets])
    chunks = list(simulate(frames(), TIMES, config, threads=threads))
    return np.concatenate(chunks)


def test_every_effect_by_hooks_is_tested():
    hooks = (h.name for case in CASES.values() for h in active_hooks(load_config([], [case[0]])))
    assert len(set(hooks)) == len(CASES)
    kernel = {effect.name for effect in EFFECTS} - set(CASES)
    assert kernel >= {"encoding", "low_pass", "leak", "hot_pixels"}


@pytest.mark.parametrize("name", CASES)
def test_does_something_and_neutral_values_do_nothing(name):
    plain, (active, neutral) = events(), CASES[name]
    assert events(active).tobytes() != plain.tobytes()
    assert events(neutral).tobytes() == plain.tobytes()


@pytest.mark.parametrize("name", CASES)
def test_same_bytes_for_any_threads_and_chunks(name, monkeypatch):
    active = CASES[name][0]
    whole = events(active)
    assert whole.tobytes() == sort_events(whole).tobytes()
    assert events(active, threads=2).tobytes() == whole.tobytes()
    monkeypatch.setattr(intervals, "_MOST", 1)
    assert events(active).tobytes() == whole.tobytes()


def test_all_together_give_the_same_bytes_with_frames_made_in_between(monkeypatch):
    sets = [case[0] for case in CASES.values()]
    whole = events(*sets, L=3)
    assert len(whole) > 100
    monkeypatch.setattr(intervals, "_MOST", 2)
    assert events(*sets, L=3, threads=2).tobytes() == whole.tobytes()


@pytest.mark.parametrize("name", CASES)
def test_says_what_it_is_and_where_to_fit_it(name):
    (effect,) = (effect for effect in EFFECTS if effect.name == name)
    module = importlib.import_module(
        f"adv2e.effects.{effect.stage}.{effect.own_module or effect.name}"
    )
    assert re.search(r"doi:10\.|arXiv:|https://", module.__doc__)
    keys = [key for key in all_keys() if key.path.startswith(effect.paths) and not key.is_section]
    assert keys
    for key in (key for key in keys if not key.about.choices):
        fit, about = key.about.fit, key.about
        assert fit is not None, key.path
        assert about.complaint(fit.low) is about.complaint(fit.high) is None


def test_neutral_hooks_change_nothing_and_are_not_called():
    class Nothing(Hooks):
        pass

    config = load_config([], [LIGHT])
    plain = np.concatenate(list(simulate(frames(), TIMES, config)))
    found = np.concatenate(list(simulate(frames(), TIMES, config, effects=[Nothing()])))
    assert found.tobytes() == plain.tobytes()
    assert not active_hooks(config)


def test_converting_a_file_gives_what_simulating_its_frames_does(adv2e, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    np.save("clip.npy", np.stack(list(frames())))
    sets = [LIGHT, "sampling.L=1", *(case[0] for case in CASES.values())]
    options = [part for text in sets for part in ("--set", text)]
    outcome = adv2e("convert", "clip.npy", "--fps", "500", "-q", "-o", "out.txt", *options)
    assert outcome == (0, "", "")
    config = load_config([], sets)
    found = np.concatenate(list(simulate(frames(), [k / 500 for k in range(COUNT)], config)))
    lines = [f"{t / 1e6:.6f}000 {x} {y} {p}" for t, x, y, p in found.tolist()]
    assert (tmp_path / "out.txt").read_text("ascii").splitlines() == lines
    assert len(lines) > 100
