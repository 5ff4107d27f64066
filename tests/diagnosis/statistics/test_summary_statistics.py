"""Statistics of all groups: their form, and that each responds to what its meaning says."""

import dataclasses
import re

import numpy as np
import pytest
from hypothesis import given, settings
from made_up.streams import (
    FRAMES,
    HEIGHT,
    STOP_US,
    WIDTH,
    placed,
    random_stream,
    scene_of,
    some_scene,
    statistics,
    stream_of,
    streams,
    wandering_light,
)

from adv2e.diagnosis.data import splits
from adv2e.diagnosis.data.splits import Split, Stream
from adv2e.diagnosis.hints.lamps import strongest_lines
from adv2e.diagnosis.statistics import rates, spectrum, timing
from adv2e.diagnosis.statistics.summary import BOTH, VIEWS, SummaryStatistics

SCENE = some_scene(seed=5)
PILOT = [random_stream(400, seed) for seed in range(3)]
ALL = SummaryStatistics(SCENE, PILOT)
SIZES = [(1, 1), (4, 4), (64, 1), (1, 64), (300, 2), (2, 2)]


def undivided(scene):
    """Return the scene with all data in one part."""
    whole = Split(scene.split.borders_us, np.zeros_like(scene.split.label))
    return dataclasses.replace(scene, split=whole)


def test_names_are_unique_and_meanings_are_given():
    names = [entry.name for entry in ALL.entries]
    assert len(set(names)) == len(names) > 200
    assert all(len(entry.meaning) > 20 for entry in ALL.entries)
    assert len(ALL.titles) == len(ALL.least) == len(names)
    titles = [group.title for group in ALL.groups]
    assert len(set(titles)) >= len(titles) - 1  # intervals, and those at rest


def test_every_statistic_has_a_unit_and_covariances_say_of_what():
    for entry in ALL.entries:
        assert entry.unit, entry.name
        assert "(log" not in entry.meaning
        if entry.unit == "sd²":
            assert re.search("covariance .* with |mean square of the surplus", entry.meaning)
        if entry.unit in ("sd", "sd²"):
            assert "of chance" in entry.meaning
    with_light = [e.meaning for e in ALL.entries if "where the picture is" in e.meaning]
    assert len(with_light) == 24
    assert all(" DN)" in meaning for meaning in with_light)
    times = [e.meaning for e in ALL.entries if ", time " in e.name]
    assert times
    assert all(re.search(r"from [\d.]+ to [\d.]+ s of the recording", one) for one in times)


def test_statistics_have_kinds_by_which_they_are_sorted():
    kinds = dict(zip(ALL.titles, ALL.kinds, strict=True))
    assert kinds["number of events"] == kinds["events over time"] == "count"
    assert kinds["time between events of a pixel"] == kinds["time between rows"] == "time"
    assert kinds["from pixel to pixel"] == kinds["frequencies in the rate"] == "other"


def test_logarithms_are_told_as_what_they_are_of():
    entries = {entry.name: entry for entry in ALL.entries}
    assert entries["50 % of gaps between rows"].plain(np.log(80.0)) == pytest.approx(80.0)
    assert entries["loudest pixel"].plain(np.log1p(6.0)) == pytest.approx(6.0)
    assert entries["rows"].plain(np.log(0.25 + 1e-3)) == pytest.approx(0.5)
    assert entries["silent pixels"].plain(2.0 * np.sqrt(7.375)) == pytest.approx(7.0)
    assert np.isfinite(entries["line in the total rate, 99-101 Hz"].plain(1e6))


def test_numbers_of_events_are_told_as_such():
    stream = random_stream(3000, 9)
    values = ALL.measure(stream)
    told = {
        entry.name: entry.plain(value)
        for entry, value in zip(ALL.entries, values[splits.TEST], strict=True)
    }
    inside = placed(stream, SCENE).part == splits.TEST
    rates = ALL.groups[0].entries
    assert sum(told[entry.name] for entry in rates) == pytest.approx(np.count_nonzero(inside))
    for entry in ALL.entries:
        is_told = entry.meaning.startswith("number of")
        assert (entry.unit in ("events", "pixels", "pairs")) == is_told, entry


@pytest.mark.parametrize("group", ALL.groups, ids=lambda group: group.title)
def test_a_group_has_as_many_values_as_entries(group):
    raw = group.count(placed(PILOT[0], SCENE))
    assert raw.shape[0] == splits.COUNT
    for row in raw:
        assert group.values(row).shape == (len(group.entries),)
    assert np.all(np.asarray(group.least) > 0)


def test_the_order_of_events_of_one_stamp_does_not_matter():
    draw = np.random.default_rng(4)
    events = random_stream(4000, 11).events()
    events["t"] -= events["t"] % 500  # many of one stamp, of other pixels mostly
    _, first = np.unique(events[["t", "x", "y"]], return_index=True)
    events = events[first]
    shuffled = draw.permutation(events)
    shuffled = shuffled[np.argsort(shuffled["t"], kind="stable")]
    assert np.any(shuffled != events)
    measured = (ALL.measure(Stream.of(one, WIDTH, HEIGHT)) for one in (events, shuffled))
    np.testing.assert_array_equal(*measured)


@settings(deadline=None, max_examples=25)
@given(streams())
def test_sums_add_up_over_the_parts(stream):
    where, whole = placed(stream, SCENE), placed(stream, undivided(SCENE))
    for group in ALL.groups:
        divided, together = group.count(where), group.count(whole)
        if group.title == "from pixel to pixel":  # the last numbers say which parts were added
            divided, together = divided[:, : -splits.COUNT], together[:, : -splits.COUNT]
        np.testing.assert_allclose(divided.sum(axis=0), together[0], atol=1e-6)
        assert not together[1:].any()


@settings(deadline=None, max_examples=25)
@given(streams())
def test_the_joined_view_is_that_of_the_sums(stream):
    where = placed(stream, SCENE)
    values = ALL.measure(stream)
    assert values.shape == (VIEWS, len(ALL.entries))
    joined = [
        group.values(raw[splits.TRAIN] + raw[splits.VALIDATION])
        for group, raw in ((group, group.count(where)) for group in ALL.groups)
    ]
    np.testing.assert_array_equal(values[BOTH], np.concatenate(joined))


@pytest.mark.parametrize("count", [0, 1, 2])
@pytest.mark.parametrize(("width", "height"), [(WIDTH, HEIGHT), *SIZES])
def test_few_events_on_any_sensor_have_finite_statistics(count, width, height):
    scene = some_scene(width, height)
    pilot = [random_stream(20 * k, k, width, height) for k in range(2)]
    statistics = SummaryStatistics(scene, pilot)
    values = statistics.measure(random_stream(count, 9, width, height))
    assert np.all(np.isfinite(values))


@pytest.mark.parametrize("frames", [3, 4])
def test_short_recordings_have_finite_statistics(frames):
    scene = some_scene(frames=frames)
    stop = 10_000 * (frames - 1)
    pilot = [random_stream(100, k, stop_us=stop) for k in range(2)]
    assert np.all(np.isfinite(SummaryStatistics(scene, pilot).measure(pilot[0])))


def test_constant_frames_have_finite_statistics():
    scene = scene_of(np.full((6, HEIGHT, WIDTH), 40.0, np.float32))
    pilot = [random_stream(100, k, stop_us=50_000) for k in range(2)]
    assert np.all(np.isfinite(SummaryStatistics(scene, pilot).measure(pilot[0])))


def test_measuring_leaves_nothing_behind():
    stream = random_stream(200, 7)
    first = ALL.measure(stream)
    ALL.measure(random_stream(500, 8))
    np.testing.assert_array_equal(ALL.measure(stream), first)


# --- what each responds to -----------------------------------------------------------------------


def following_events(scene, late_us=0, seed=0, share=0.3):
    """Return events where and when the light changes, in its direction, `late_us` after it."""
    draw = np.random.default_rng(seed)
    interval, pixel = np.nonzero(draw.random(scene.slope.shape) * share < np.abs(scene.slope) / 60)
    t = interval * 10_000 + draw.integers(0, 10_000, len(interval)) + late_us
    kept = t < STOP_US
    x, y = pixel % WIDTH, pixel // WIDTH
    on = scene.slope[interval, pixel] > 0
    return stream_of(t[kept], x[kept], y[kept], on[kept])


def pan(shift, frames=FRAMES):
    """Return frames of one row of texture that moves right, and `shift` pixels besides."""
    draw = np.random.default_rng(4)
    texture = np.convolve(draw.normal(size=400), np.hanning(9), "same")
    x = np.arange(WIDTH)[None, :] - 0.7 * np.arange(frames)[:, None] - shift
    row = np.interp(x, np.arange(-200, 200), texture)
    wobble = 1.0 + 0.2 * np.sin(np.arange(HEIGHT))
    return (50.0 * np.exp(0.8 * row[:, None, :] * wobble[None, :, None])).astype(np.float32)


def test_lag_is_greatest_where_the_change_is():
    names = [f"change {lag} ms before, medium" for lag in ("-8", "0", "8")]
    for late_us, best in ((-8000, 0), (0, 1), (8000, 2)):
        late = placed(following_events(SCENE, late_us), SCENE)
        found = statistics(timing.lag(timing.Slopes(SCENE)), late)
        assert int(np.argmax([found[name] for name in names])) == best
        assert max(found[name] for name in names) > 0.3


def test_lag_is_nothing_for_events_of_no_cause():
    found = statistics(timing.lag(timing.Slopes(SCENE)), placed(random_stream(6000, 1), SCENE))
    assert np.abs(list(found.values())).max() < 0.15


def test_drift_sees_a_clock_that_goes_away():
    stream = following_events(SCENE, share=1.0)
    found = []
    for drift in (-0.2, 0.0, 0.2):
        t = stream.t + (drift * (stream.t - STOP_US // 2)).astype(np.int64)
        kept = (t >= 0) & (t < STOP_US)
        x, y = stream.pixel[kept] % WIDTH, stream.pixel[kept] // WIDTH
        moved = placed(stream_of(t[kept], x, y, stream.on[kept]), SCENE)
        found.append(statistics(timing.drift(timing.Slopes(SCENE)), moved))
    # early, then late: the change comes after the event first, and before it later
    slow, none, fast = (
        one["lag 16 less -8 ms, time 3/4"] - one["lag 16 less -8 ms, time 2/4"] for one in found
    )
    assert slow < none - 0.15
    assert fast > none + 0.15


def test_shift_sees_which_way_the_frames_lie():
    events = following_events(scene_of(pan(0.0)))
    found = []
    for shift in (-1.0, 0.0, 1.0):
        scene = scene_of(pan(shift))
        found.append(statistics(timing.shift(timing.Slopes(scene)), placed(events, scene)))
    right = [one["change right of the event, 2 ms before"] for one in found]
    # frames that lie left of the events have what makes an event left of it
    assert right[0] < right[1] - 0.05
    assert right[2] > right[1] + 0.05


def test_shift_has_the_axes_apart():
    light = np.ascontiguousarray(wandering_light(seed=3, still_columns=0))
    smooth = np.exp(
        sum(np.roll(np.log(light), k, axis) for k in (-1, 0, 1) for axis in (1, 2)) / 6.0
    )
    events = following_events(scene_of(smooth))
    for axis, name in ((2, "right"), (1, "below")):
        scene = scene_of(np.roll(smooth, 1, axis))
        found = statistics(timing.shift(timing.Slopes(scene)), placed(events, scene))
        other = {"right": "below", "below": "right"}[name]
        moved = found[f"change {name} of the event, 2 ms before"]
        assert moved > 0.1
        assert moved > 3 * abs(found[f"change {other} of the event, 2 ms before"])


def test_phase_sees_events_locked_to_frames():
    draw = np.random.default_rng(2)
    t = 10_000 * draw.integers(0, FRAMES - 1, 500) + 3200
    x, y = draw.integers(0, 4, 500), draw.integers(0, HEIGHT, 500)  # the still columns
    found = statistics(rates.phase(SCENE), placed(stream_of(t, x, y, np.ones(500)), SCENE))
    assert max(found, key=found.get) == "ON events, at rest, 30-40 % after a frame"
    assert found["ON events, at rest, 30-40 % after a frame"] > 30
    assert all(value == 0.0 for name, value in found.items() if name.startswith("OFF"))


def test_phase_of_events_at_any_time_is_within_chance():
    found = statistics(rates.phase(SCENE), placed(random_stream(4000, 3), SCENE))
    assert np.abs(list(found.values())).max() < 4.5


def test_spectrum_sees_a_line():
    scene = some_scene(frames=101)
    draw = np.random.default_rng(5)
    t = draw.integers(0, 1_000_000, 8000)
    lamp = draw.random(8000) < 0.5 + 0.5 * np.sin(2 * np.pi * 137.0 * t * 1e-6)
    x, y = draw.integers(0, WIDTH, 8000), draw.integers(0, HEIGHT, 8000)
    chance = placed(stream_of(t, x, y, draw.integers(0, 2, 8000)), scene)
    lines = placed(stream_of(t[lamp], x[lamp], y[lamp], np.ones(lamp.sum())), scene)
    name = "line in the total rate, 121-240 Hz"
    group = spectrum.spectrum(scene)
    assert statistics(group, lines)[name] > statistics(group, chance)[name] + 2.0
    assert (
        min(abs(hz - 137.0) for hz in strongest_lines(lines.stream, [chance.stream], scene)) < 0.5
    )


def test_spectrum_sees_a_line_of_polarity():
    scene = some_scene(frames=101)
    draw = np.random.default_rng(6)
    t = draw.integers(0, 1_000_000, 8000)
    on = draw.random(8000) < 0.5 + 0.4 * np.sin(2 * np.pi * 137.0 * t * 1e-6)
    where = placed(stream_of(t, *draw.integers(0, 12, (2, 8000)), on), scene)
    found = statistics(spectrum.spectrum(scene), where)
    signed, total = (found[f"line in the {kind} rate, 121-240 Hz"] for kind in ("signed", "total"))
    assert signed > total + 2.0
    chance = random_stream(8000, 7, stop_us=1_000_000)
    assert min(abs(hz - 137.0) for hz in strongest_lines(where.stream, [chance], scene)) < 0.5


@pytest.mark.parametrize("tick", [2, 10, 500])
def test_ticks_see_whole_multiples(tick):
    stream = random_stream(3000, 4)
    ticked = stream_of(stream.t // tick * tick, stream.pixel % WIDTH, stream.pixel // WIDTH, 1)
    found = statistics(timing.ticks(), placed(ticked, SCENE))
    free = statistics(timing.ticks(), placed(stream, SCENE))
    assert found[f"stamps on {tick} us"] == 1.0
    assert free[f"stamps on {tick} us"] == pytest.approx(1 / tick, abs=0.03)


def test_gaps_see_rows_that_are_read_together():
    draw = np.random.default_rng(7)
    t = np.repeat(np.sort(draw.integers(0, STOP_US, 200)), 5) + np.tile(np.arange(5), 200)
    y = np.repeat(draw.integers(0, HEIGHT, 200), 5)
    x = draw.integers(0, WIDTH, 1000)
    rows = statistics(timing.gaps(), placed(stream_of(t, x, y, x % 2), SCENE))
    any_row = statistics(timing.gaps(), placed(stream_of(t, x, draw.permutation(y), x % 2), SCENE))
    assert rows["same row within 3 us"] > 0.9
    assert any_row["same row within 3 us"] < 0.2
    assert rows["next after 1-2 us"] > 50


@pytest.mark.parametrize("row_us", [20.0, 20.8, 24.0, 170.0])
def test_gaps_between_rows_see_the_time_that_a_row_takes(row_us):
    draw = np.random.default_rng(8)
    rows = int(STOP_US // row_us)
    t = np.arange(rows) * row_us
    y = np.arange(rows) % HEIGHT
    where = placed(stream_of(t, draw.integers(0, WIDTH, rows), y, 1), SCENE)
    found = statistics(timing.row_gaps(), where)
    for name in ("25 % of gaps between rows", "50 % of gaps between rows"):
        assert np.exp(found[name]) == pytest.approx(row_us, rel=0.05)


def test_neighbours_see_pairs():
    draw = np.random.default_rng(8)
    t = draw.integers(0, STOP_US - 1000, 400)
    x, y = draw.integers(0, WIDTH - 1, 400), draw.integers(0, HEIGHT, 400)
    on = draw.integers(0, 2, 400)
    both = np.r_[t, t + 200], np.r_[x, x + 1], np.r_[y, y]
    same = statistics(timing.neighbours(), placed(stream_of(*both, np.r_[on, on]), SCENE))
    other = statistics(timing.neighbours(), placed(stream_of(*both, np.r_[on, 1 - on]), SCENE))
    name = "0.1-0.3 ms after a neighbour's {}"
    assert same[name.format("same")] > 30 > 3 * same[name.format("other")]
    assert other[name.format("other")] > 30 > 3 * other[name.format("same")]


def test_runs_see_how_far_one_goes():
    t = 1000 * np.arange(12)
    found = statistics(timing.runs(), placed(stream_of(t, [3] * 12, [3] * 12, [1] * 12), SCENE))
    nothing = statistics(timing.runs(), placed(stream_of([], [], [], []), SCENE))
    grown = {name for name in found if found[name] > nothing[name]}
    places = ("1st", "2nd", "3rd", "4th", "5th-6th", "7th-9th", "10th or later")
    assert grown == {f"{place} ON event of a run" for place in places}
