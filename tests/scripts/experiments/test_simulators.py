"""Simulators under one interface, and the equations of DVS-Voltmeter against other ways to them."""

from __future__ import annotations

import itertools
import sys
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from experiments.clip import Clip
from experiments.simulators import NAMES, ByFile, EventsOf, V2e, named
from experiments.voltmeter import (
    CONSTANTS,
    Voltmeter,
    chance_of_on,
    motion,
    passage_times,
)
from scipy import stats

from adv2e import load_config, simulate, write_events
from adv2e.errors import ConfigError, DataError
from adv2e.events import is_sorted, make_events

WIDTH, HEIGHT, FRAMES = 20, 12, 6
START_NS = 7_000_000_000
TIMES_NS = START_NS + np.array([0, 20, 40, 61, 80, 100]) * 1_000_000
DRAWN = 40_000
CHANCE = 1e-4
"""A test of a distribution fails by chance this often."""


def moving_waves():
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    phases = 2 * np.pi * (x / 11 + y / 17 - 0.24 * np.arange(FRAMES)[:, None, None])
    return np.rint(130 + 100 * np.sin(phases)).astype(np.uint8)


CLIP = Clip(moving_waves(), TIMES_NS)


@pytest.mark.parametrize("name", NAMES.split(","))
def test_each_gives_sorted_events_of_the_clip_that_its_seed_repeats(name):
    (simulator,) = named([name], threads=1)
    assert simulator.name == name
    events = simulator.events(CLIP, 3)
    assert len(events) > 100
    assert is_sorted(events)
    assert events["t"][0] >= 7_000_000
    assert events["t"][-1] <= 7_100_000
    assert events["x"].max() < WIDTH
    assert events["y"].max() < HEIGHT
    np.testing.assert_array_equal(events, simulator.events(CLIP, 3))


@pytest.mark.parametrize("name", ["adv2e", "dvs-voltmeter", "eventcv-quiet"])
def test_larger_thresholds_of_one_polarity_make_fewer_of_its_events(name):
    (simulator,) = named([name], threads=1)
    on, off = simulator.levels
    doubled = simulator.with_levels(2 * on, off)
    assert doubled.levels == (2 * on, off)
    counts = [np.bincount(one.events(CLIP, 3)["p"]) for one in (simulator, doubled)]
    assert counts[1][1] < 0.8 * counts[0][1]
    assert counts[1][0] > 0.5 * counts[0][0]  # as many changes down, some from another reference


def test_a_configuration_gives_the_events_of_the_package():
    (simulator,) = named(["adv2e"], sets=["pixel.thresholds.on=0.3"], threads=1)
    config = load_config(["adv2e"], ["frames.encoding=linear", "pixel.thresholds.on=0.3", "seed=5"])
    expected = list(simulate(CLIP.frames, 1e-9 * TIMES_NS, config, threads=1))
    np.testing.assert_array_equal(simulator.events(CLIP, 5), np.concatenate(expected))


def test_the_natures_tell_tools_from_their_parameters():
    natures = {one.name: one.nature for one in named(NAMES.split(","))}
    assert "not the tool" in natures["v2e"]
    assert "not the tool" in natures["vid2e"]
    assert "the tool itself, EventCV" in natures["eventcv"]
    assert "equations" in natures["dvs-voltmeter"]


def test_unknown_names_and_names_that_stand_twice_are_refused():
    with pytest.raises(ConfigError, match="nonsense"):
        named(["ideal", "nonsense"])
    with pytest.raises(ConfigError, match="ideal: is asked for twice"):
        named(["ideal"], [ByFile("ideal", Path("events.h5"))])


@pytest.mark.parametrize(
    ("text", "path", "added"),
    [("a.h5", "a.h5", 0.0), ("a.h5@start", "a.h5", None), ("a@b=c.h5", "a@b=c.h5", 0.0),
     ("a.h5@-0.5", "a.h5", -0.5)],
)  # fmt: skip
def test_names_with_files(text, path, added):
    assert EventsOf().convert(f"v2ce={text}", None, None) == ByFile("v2ce", Path(path), added)


# ------------------------------------------------------------------------------------------ clips


def test_light_between_frames_is_linear_and_even_times_keep_both_ends():
    frames = np.array([[[0.0]], [[100.0]], [[40.0]]], np.float32)
    clip = Clip(frames, np.array([0, 10, 30]))
    assert [clip.at(t)[0, 0] for t in (0, 5, 10, 20, 30)] == [0, 50, 100, 70, 40]
    light, rate = clip.even(3)  # 15 ns is usual: 2 intervals of it, 6 steps of 5 ns
    assert rate == Fraction(10**9, 5)
    np.testing.assert_allclose(light[:, 0, 0], [0, 50, 100, 85, 70, 55, 40])
    steps = list(clip.blended(2))
    assert [t for t, _ in steps] == [0, 5, 10, 20, 30]
    assert [float(light[0, 0]) for _, light in steps] == [0, 50, 100, 70, 40]


def test_a_clip_until_a_time_ends_with_the_frame_at_or_after_it():
    assert len(CLIP.until(7_040_000).frames) == 3
    assert len(CLIP.until(7_040_001).frames) == 4
    assert len(CLIP.until(0).frames) == 2
    assert len(CLIP.until(9_000_000).frames) == FRAMES


@pytest.mark.parametrize("times", [[0, 10], [0, 10, 10], [0, 20, 10]])
def test_clips_with_other_or_odd_times_are_refused(times):
    with pytest.raises(DataError, match="a clip"):
        Clip(np.zeros((3, 2, 2), np.uint8), np.array(times))


# ----------------------------------------------------------------------------------- DVS-Voltmeter


@pytest.mark.parametrize(
    ("distance", "drift", "deviation"),
    [(1.0, 2e-3, 1e-2), (0.3, 1e-5, 3e-3), (1.7, 1e-9, 1e-2), (1.0, 0.05, 1e-3)],
)
def test_passage_times_are_inverse_gaussian(distance, drift, deviation):
    columns = (np.full(DRAWN, value) for value in (distance, drift, deviation))
    drawn = passage_times(*columns, np.random.default_rng(1))
    mean, shape = distance / drift, (distance / deviation) ** 2
    law = stats.invgauss(mean / shape, scale=shape)
    assert stats.kstest(drawn, law.cdf).pvalue > CHANCE


def test_passage_times_without_drift_are_levy():
    columns = (np.full(DRAWN, value) for value in (0.5, 0.0, 0.02))
    drawn = passage_times(*columns, np.random.default_rng(2))
    assert stats.kstest(drawn, stats.levy(scale=(0.5 / 0.02) ** 2).cdf).pvalue > CHANCE


@pytest.mark.parametrize("drift", [-3e-3, -2e-4, 0.0, 1e-4, 2e-3])
@pytest.mark.parametrize(("up", "down"), [(1.0, 1.0), (0.4, 1.6)])
@pytest.mark.thorough
def test_the_chance_of_on_and_its_times_are_those_of_a_walk_in_small_steps(drift, up, down):
    deviation, paths, step = 0.03, 4_000, 0.25
    rng = np.random.default_rng(3)
    at, ends = np.zeros(paths), np.full(paths, np.nan)
    first = np.zeros(paths, np.bool_)
    for _ in range(200_000):
        going = np.isnan(ends)
        if not going.any():
            break
        at[going] += drift * step + deviation * np.sqrt(step) * rng.standard_normal(going.sum())
        # levels seen only at the steps are passed .583 of a step's deviation late (Siegmund 1979)
        late = 0.5826 * deviation * np.sqrt(step)
        first |= going & (at >= up - late)
        ends[going & ((at >= up - late) | (at <= -down + late))] = 1.0
    chance = float(chance_of_on(*(np.array([v]) for v in (up, down, drift, deviation)))[0])
    error = np.sqrt(max(chance * (1 - chance), 1 / paths) / paths)
    assert abs(first.mean() - chance) < 4 * error


def test_a_steady_rise_fires_at_the_rate_of_its_drift():
    frames = np.linspace(60, 200, 11)[:, None, None] * np.ones((1, 30, 40))
    clip = Clip(frames.astype(np.float32), np.arange(11) * 10_000_000)
    events = Voltmeter().events(clip, 0)
    steps = itertools.pairwise(frames)
    drifts = [motion(a, b, 10_000.0, CONSTANTS["DVS240"])[0].mean() * 10_000 for a, b in steps]
    # renewals without bias but for what is left on the way to the next
    assert abs((events["p"] == 1).sum() / 1200 - sum(drifts)) < 0.5
    assert (events["p"] == 0).sum() < 0.01 * len(events)
    assert len(Voltmeter(levels=(2.0, 1.0)).events(clip, 0)) < 0.6 * len(events)


# ------------------------------------------------------------------------------------------ by file


@pytest.fixture
def written(tmp_path):
    path = tmp_path / "made.h5"
    events = make_events([7_010_000, 7_020_000], [1, 2], [3, 4], [1, 0])
    write_events(path, events, (WIDTH, HEIGHT))
    return path


def test_events_by_file_are_read_and_cannot_be_made_with_other_thresholds(written):
    simulator = ByFile("other", written)
    assert simulator.events(CLIP, 0)["t"].tolist() == [7_010_000, 7_020_000]
    assert simulator.levels is None
    assert "made.h5" in simulator.nature


def test_events_of_another_size_or_clock_are_refused(written):
    with pytest.raises(DataError, match=r"made.h5: events of 20x12 pixels, but frames of 8x8"):
        ByFile("other", written).events(Clip(np.zeros((2, 8, 8), np.uint8), TIMES_NS[:2]), 0)
    with pytest.raises(DataError, match=r"other=\S+made.h5@start is for times that begin"):
        ByFile("other", written).events(Clip(CLIP.frames, TIMES_NS - START_NS), 0)


def test_events_as_v2ce_writes_them_are_put_on_the_clock_of_the_recording(tmp_path):
    """One structured array of times from 0, and no size."""
    fields = [("timestamp", "i8"), ("x", "i2"), ("y", "i2"), ("polarity", "i1")]
    stream = np.array([(k * 1000, k % WIDTH, k % 9, 2 * (k % 2) - 1) for k in range(90)], fields)
    np.savez(tmp_path / "v2ce.npz", event_stream=stream)
    events = ByFile("v2ce", tmp_path / "v2ce.npz", None).events(CLIP, 0)
    assert events["t"].tolist() == [7_000_000 + 1000 * k for k in range(90)]
    assert events["p"].tolist() == [0, 1] * 45
    later = ByFile("v2ce", tmp_path / "v2ce.npz", 7.01).events(CLIP, 0)
    assert later["t"][0] == 7_010_000


def test_v2e_without_its_sources_is_refused(tmp_path):
    with pytest.raises(DataError, match="a clone of"):
        V2e(tmp_path)


EMULATOR = """
import numpy as np

class EventEmulator:
    def __init__(self, device, seed, pos_thres, neg_thres, **rest):
        self.rest, self.seed, self.on = rest, seed, pos_thres

    def generate_events(self, frame, t):
        assert self.rest["cutoff_hz"] == 300.0 and frame.dtype == np.float32
        return np.array([[t, self.seed, round(self.on * 10), 1.0], [t, 0, 0, -1.0]])
"""


def test_v2e_is_given_even_frames_its_seed_and_its_thresholds(tmp_path, monkeypatch):
    monkeypatch.setattr(sys, "path", list(sys.path))
    (tmp_path / "v2ecore").mkdir()
    (tmp_path / "v2ecore" / "__init__.py").touch()
    (tmp_path / "v2ecore" / "emulator.py").write_text(EMULATOR)
    events = V2e(tmp_path, parts=2).with_levels(0.4, 0.2).events(CLIP, 3)
    on = events[events["p"] == 1]
    assert on["t"].tolist() == list(range(7_000_000, 7_100_001, 10_000))
    assert (on["x"] == 4).all()
    assert (on["y"] == 4).all()
    for name in ("v2ecore", "v2ecore.emulator"):
        sys.modules.pop(name)
