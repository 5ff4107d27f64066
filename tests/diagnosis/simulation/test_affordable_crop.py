from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from adv2e import simulate
from adv2e.config import load_config
from adv2e.diagnosis.data import evidence as evidence_module
from adv2e.diagnosis.data.evidence import Evidence, RunIn
from adv2e.diagnosis.data.splits import Stream
from adv2e.diagnosis.simulation import affordable as affordable_module
from adv2e.diagnosis.simulation.affordable import affordable
from adv2e.errors import DataError

WIDTH, HEIGHT = 96, 80
TIMES = np.arange(6) * 0.01
CONFIG = load_config(["ideal"], ["frames.encoding=linear"])


def recording():
    """A spot that moves in one corner, and an ideal pixel's events of it."""
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    frames = [
        np.rint(50 + 150 * np.exp(-((x - 70 - 2 * k) ** 2 + (y - 60) ** 2) / 40)).astype(np.uint8)
        for k in range(len(TIMES))
    ]
    events = np.concatenate(list(simulate(frames, TIMES, CONFIG, threads=1)))
    stream = Stream.of(events, WIDTH, HEIGHT)
    return Evidence("spot", frames, TIMES, stream, WIDTH, HEIGHT)


def limit(monkeypatch, pixels, steps=1, event_s=0.0):
    instants = (len(TIMES) - 1) * CONFIG.sampling.L
    monkeypatch.setattr(affordable_module, "INSTANT_S", 1.0)
    monkeypatch.setattr(affordable_module, "EVENT_S", event_s)
    monkeypatch.setattr(affordable_module, "SECOND_S", 0.0)
    monkeypatch.setattr(affordable_module, "AFFORDABLE_S", 1.001 * pixels * instants * steps)


def test_what_is_affordable_stays_as_it_is(monkeypatch):
    whole = recording()
    limit(monkeypatch, WIDTH * HEIGHT)
    assert affordable(whole, CONFIG) is whole


def test_a_crop_holds_the_busiest_pixels_and_says_so(monkeypatch):
    whole = recording()
    limit(monkeypatch, WIDTH * HEIGHT // 3)
    crop = affordable(whole, CONFIG)
    assert (crop.width, crop.height) == (56, 48)
    assert crop.width * crop.height < WIDTH * HEIGHT // 2
    assert len(crop.stream) == len(whole.stream)
    assert crop.masked[-1].what == "pixels outside the 56x48 at column 40, row 24"
    assert crop.masked[-1].share == 0.0
    assert "cropped from 96x80" in crop.notes[-1]


def test_what_pixels_saw_before_is_cropped_and_costs_its_time(monkeypatch):
    whole = recording()
    before = RunIn(whole.frames[:5], whole.times_s[:5] - 0.05)
    with_run_in = replace(whole, run_in=before)
    limit(monkeypatch, WIDTH * HEIGHT // 3, steps=2)  # twice as many instants
    crop, same = affordable(with_run_in, CONFIG), affordable(whole, CONFIG)
    assert (crop.width, crop.height) == (56, 48)
    assert same.width * same.height > 1.5 * crop.width * crop.height
    np.testing.assert_array_equal(crop.run_in.frames, crop.frames[:5])
    assert crop.run_in.times_s is before.times_s


def test_a_crop_simulates_to_what_its_pixels_saw_in_the_whole(monkeypatch):
    whole = recording()
    limit(monkeypatch, WIDTH * HEIGHT // 3)
    crop = affordable(whole, CONFIG)
    events = np.concatenate(list(simulate(crop.frames, crop.times_s, CONFIG, threads=1)))
    np.testing.assert_array_equal(events, crop.stream.events())


def test_a_stepped_filter_costs_more(monkeypatch):
    whole = recording()
    limit(monkeypatch, WIDTH * HEIGHT)
    stepped = load_config(["paper"])
    monkeypatch.setattr(affordable_module, "STEP_S", 1.0)
    assert affordable(whole, stepped).width < WIDTH
    limit(monkeypatch, WIDTH * HEIGHT, steps=1 + stepped.sampling.K)
    assert affordable(whole, stepped) is whole


def test_events_cost_too_and_a_crop_where_they_crowd_is_smaller(monkeypatch):
    whole = recording()
    instants = (len(TIMES) - 1) * CONFIG.sampling.L
    # all events are in one corner: each crop around them costs them in full
    event_s = WIDTH * HEIGHT * instants / 4 / len(whole.stream)
    limit(monkeypatch, WIDTH * HEIGHT)
    assert affordable(whole, CONFIG) is whole
    limit(monkeypatch, WIDTH * HEIGHT, event_s=event_s)
    crop = affordable(whole, CONFIG)
    assert len(crop.stream) == len(whole.stream)
    assert 0.5 < crop.width * crop.height / (WIDTH * HEIGHT) <= 0.75


def test_time_costs_too(monkeypatch):
    """Effects that are solved in steps of time are simulated, too, however few frames there are."""
    whole = recording()
    instants = (len(TIMES) - 1) * CONFIG.sampling.L
    limit(monkeypatch, WIDTH * HEIGHT)
    monkeypatch.setattr(affordable_module, "SECOND_S", instants / whole.seconds)
    crop = affordable(whole, CONFIG)
    assert crop.width * crop.height == pytest.approx(0.5 * WIDTH * HEIGHT, rel=0.15)


def test_steps_of_time_of_the_declared_model_cost_too(monkeypatch):
    whole = recording()
    quick = ["pixel.slew_limit.per_s=80", "pixel.low_pass.cutoff_hz=9000"]
    slewed = load_config(["adv2e"], quick)
    limit(monkeypatch, WIDTH * HEIGHT)
    monkeypatch.setattr(affordable_module, "STEP_S", 0.0)
    assert affordable(whole, slewed) is whole
    instants = (len(TIMES) - 1) * CONFIG.sampling.L
    steps = affordable_module.steps_of_time(whole, slewed)
    assert steps > instants
    monkeypatch.setattr(affordable_module, "STEP_S", instants / steps)
    assert affordable(whole, CONFIG) is whole
    crop = affordable(whole, slewed)
    assert crop.width * crop.height == pytest.approx(0.5 * WIDTH * HEIGHT, rel=0.15)
    assert "cropped from 96x80" in crop.notes[-1]


@pytest.mark.parametrize("pixels", [1, 48 * 48])
def test_a_crop_is_not_smaller_than_statistics_allow(monkeypatch, pixels):
    limit(monkeypatch, pixels)
    crop = affordable(recording(), CONFIG)
    assert crop.width >= 48
    assert crop.height >= 48


def test_of_long_recordings_the_busiest_stretch_is_kept(monkeypatch):
    """Where the smallest crop is too much: 20 of 100 intervals, with many events, and 10 before."""
    draw = np.random.default_rng(1)
    times = 2.0 + 0.01 * np.arange(101)
    t = np.sort(np.rint(1e6 * np.r_[draw.uniform(2.0, 3.0, 500), draw.uniform(2.4, 2.7, 3000)]))
    frames = [np.full((48, 48), k, np.uint8) for k in range(101)]
    pixel = draw.integers(0, 48 * 48, t.size).astype(np.int32)
    stream = Stream(t.astype(np.int64), pixel, pixel % 2 > 0, 48, 48)
    monkeypatch.setattr(affordable_module, "INSTANT_S", 1.0)
    monkeypatch.setattr(affordable_module, "EVENT_S", 0.0)
    monkeypatch.setattr(affordable_module, "SECOND_S", 0.0)
    monkeypatch.setattr(affordable_module, "AFFORDABLE_S", 31.0 * 48 * 48 * CONFIG.sampling.L)
    kept = affordable(Evidence("long", frames, times, stream, 48, 48), CONFIG)
    assert (kept.width, kept.height, len(kept.frames)) == (48, 48, 21)
    assert kept.times_s[0] > 2.39
    assert kept.times_s[-1] < 2.71
    before = kept.run_in
    assert len(before.frames) in (9, 10)  # half of 20, as times are rounded
    assert [frame[0, 0] for frame in (*before.frames, kept.frames[0])] == list(
        range(before.frames[0][0, 0], kept.frames[0][0, 0] + 1)
    )
    assert np.diff(np.r_[before.times_s, kept.times_s[0]]) == pytest.approx(0.01)
    assert kept.frames[0][0, 0] == round((kept.times_s[0] - 2.0) * 100)
    inside = (t >= kept.times_s[0] * 1e6) & (t < kept.times_s[-1] * 1e6)
    np.testing.assert_array_equal(kept.stream.t, t[inside])
    assert kept.masked[-1].what == f"time outside {kept.times_s[0]:.3f} to {kept.times_s[-1]:.3f} s"
    assert kept.masked[-1].share == pytest.approx(1 - inside.mean())
    assert kept.notes[-1].startswith("0.2 of 1 s were looked at")


def test_a_crop_with_too_few_events_is_told(monkeypatch):
    whole = recording()
    limit(monkeypatch, WIDTH * HEIGHT // 3)
    monkeypatch.setattr(evidence_module, "LEAST_EVENTS", len(whole.stream) + 1)
    expected = f"spot: {len(whole.stream)} events in the 56x48 pixels and 0.05 s that can be"
    with pytest.raises(DataError, match=expected):
        affordable(whole, CONFIG)
    limit(monkeypatch, WIDTH * HEIGHT)  # the reader has checked what is not cropped
    assert affordable(whole, CONFIG) is whole
