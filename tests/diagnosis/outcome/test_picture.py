"""Curves and maps of a residual: shapes, labels, and numbers where there are data."""

import re

import numpy as np
import pytest
from made_up.streams import (
    HEIGHT,
    STOP_US,
    WIDTH,
    placed,
    random_stream,
    scene_of,
    some_scene,
    stream_of,
    wandering_light,
)

from adv2e.diagnosis.data.scene import STILL
from adv2e.diagnosis.outcome.picture import (
    contrast,
    curves_of,
    maps_of,
    snapshot_of,
    totals_of,
)
from adv2e.diagnosis.statistics.rates import by_load
from adv2e.reports.quantities import short_text

SCENE = some_scene(seed=5)
MEASURED = placed(random_stream(800, 1), SCENE)
BEFORE = [placed(random_stream(400, seed), SCENE) for seed in range(10, 15)]
AFTER = [placed(random_stream(800, seed), SCENE) for seed in range(20, 25)]
CURVES = {curve.title: curve for curve in curves_of(SCENE, MEASURED, BEFORE, AFTER)}


def test_thirds_are_named_with_their_bounds_and_units():
    dark, medium, bright = SCENE.bounds_of_light
    for where in ("in motion", "at rest"):
        for polarity in ("ON", "OFF"):
            curve = CURVES[f"Rate against brightness, {where}, {polarity}"]
            assert curve.x_names == ("dark", "medium", "bright")
            assert all(part in curve.x_label for part in (dark, medium, bright))
    low, high = SCENE.brightness_borders
    bounds = f"dark (below {short_text(low, 3)} DN)", f"bright (from {short_text(high, 3)} DN)"
    assert (dark, bright) == bounds
    light = wandering_light(seed=5)[1:].reshape(20, -1)
    assert light[SCENE.brightness == 0].max() <= low * 1.001
    assert light[SCENE.brightness == 2].min() >= high * 0.999
    speed = CURVES["Rate against speed"]
    assert speed.x_names == ("still", "slow", "moving", "fast")
    assert f"fast (from {short_text(SCENE.speed_borders[1], 2)} ln/s)" in speed.x_label


def test_rates_say_of_how_many_events_they_are():
    for curve in CURVES.values():
        if curve.title.startswith(("Rate", "Events over time")):
            assert re.search(r"rate \[events a (pixel a )?second\]", curve.y_label)


def test_totals_are_numbers_rates_and_times_with_units():
    on, off, rate, apart = totals_of(SCENE, MEASURED, BEFORE, AFTER)
    stream = MEASURED.stream
    number = np.count_nonzero(stream.on)
    assert (on.name, on.measured, on.unit) == ("ON events", number, "events")
    assert (off.name, off.measured) == ("OFF events", len(stream) - number)
    seconds = STOP_US * 1e-6
    assert rate.measured == pytest.approx(len(stream) / (WIDTH * HEIGHT * seconds))
    assert rate.unit == "events a pixel a second"
    gaps = [np.diff(stream.t[stream.pixel == pixel]) for pixel in range(WIDTH * HEIGHT)]
    assert apart.measured == pytest.approx(np.median(np.concatenate(gaps)) / 1e3)
    assert apart.unit == "ms"
    numbers = [np.count_nonzero(one.stream.on) for one in BEFORE]
    assert on.before.value == pytest.approx(np.mean(numbers))
    assert min(numbers) <= on.before.interval[0] <= on.before.interval[1] <= max(numbers)
    assert off.after.value == pytest.approx(2 * off.before.value, rel=0.2)


def test_totals_of_nothing_are_no_numbers():
    nothing = [placed(random_stream(0), SCENE)] * 2
    on, _, _, apart = totals_of(SCENE, MEASURED, nothing, nothing)
    assert on.before.value == 0.0
    assert np.isnan(apart.before.value)


def test_a_snapshot_holds_the_events_of_its_time_in_all_three():
    seen = snapshot_of(SCENE, MEASURED, BEFORE, AFTER)
    first = SCENE.times_us[0] + 1e6 * seen.start_s
    last = first + 1e6 * seen.length_s
    for number, of in ((seen.measured, MEASURED), (seen.before, BEFORE[0]), (seen.after, AFTER[0])):
        stream = of.stream
        inside = (stream.t >= first) & (stream.t < last)
        assert number.shape == (2, HEIGHT, WIDTH)
        for on in (0, 1):
            pixel = stream.pixel[inside & (stream.on == on)]
            expected = np.bincount(pixel, minlength=WIDTH * HEIGHT).reshape(HEIGHT, WIDTH)
            np.testing.assert_array_equal(number[on], expected)
    assert seen.measured.sum() > 0.05 * WIDTH * HEIGHT


def test_a_snapshot_is_of_the_busiest_time():
    t = np.r_[np.arange(0, STOP_US, 2000), np.arange(120_100, 122_000, 10)]
    busy = placed(stream_of(t, t % WIDTH, t % HEIGHT, t % 2), SCENE)
    seen = snapshot_of(SCENE, busy, [busy], [busy])
    assert 0.118 <= seen.start_s <= 0.121
    assert seen.length_s == pytest.approx(0.001)


def test_a_snapshot_of_few_events_is_of_all_the_time():
    few = placed(random_stream(3, 1), SCENE)
    seen = snapshot_of(SCENE, few, [few], [placed(random_stream(0), SCENE)])
    assert (seen.start_s, seen.length_s) == (0.0, pytest.approx(STOP_US * 1e-6))
    assert (seen.measured.sum(), seen.after.sum()) == (3, 0)


def test_titles_are_unique_and_axes_have_labels():
    assert len(CURVES) == len(curves_of(SCENE, MEASURED, BEFORE, AFTER)) >= 8
    for curve in CURVES.values():
        assert curve.x_label
        assert curve.y_label


@pytest.mark.parametrize("curve", CURVES.values(), ids=CURVES.keys())
def test_a_curve_has_places_or_borders_that_increase(curve):
    n = len(curve.measured)
    assert len(curve.x) in (n, n + 1)
    assert np.all(np.diff(curve.x) > 0)
    assert not curve.x_log or curve.x[0] > 0
    for band in (curve.before, curve.after):
        assert band.middle.shape == band.low.shape == band.high.shape == (n,)
        known = np.isfinite(curve.measured)  # some classes no place has
        assert np.all((band.low <= band.middle)[known])
        assert np.all((band.middle <= band.high)[known])


@pytest.mark.parametrize("curve", CURVES.values(), ids=CURVES.keys())
def test_there_is_a_number_wherever_there_are_data(curve):
    known = np.isfinite(curve.measured)
    assert known.all() or "contrast" in curve.title  # not all heights of edges occur
    assert np.count_nonzero(known) >= 3
    np.testing.assert_array_equal(np.isfinite(curve.before.middle), known)


def test_times_between_events_are_counted():
    stream, total = MEASURED.stream, 0
    for text, same in (("same", True), ("other", False)):
        curve = CURVES[f"Time between events of a pixel, {text} polarity"]
        used = (stream.since >= 0) & ((stream.on == stream.on_before) == same)
        assert curve.measured.sum() == np.count_nonzero(used)
        k = np.searchsorted(curve.x, 30.0, "right") - 1
        low, high = curve.x[k : k + 2] * 1e3
        inside = used & (stream.since >= low) & (stream.since < high)
        assert curve.measured[k] == np.count_nonzero(inside)
        total += int(curve.measured.sum())
    assert total == np.count_nonzero(stream.since >= 0)


def test_times_between_events_of_the_sensor_are_counted_by_row():
    # after 0, 1, 2, 3 and 60,000 us: rows 2 2 5 5 5 1
    t = np.cumsum([10, 0, 1, 2, 3, 60_000])
    events = placed(stream_of(t, [0, 1, 2, 3, 3, 0], [2, 2, 5, 5, 5, 1], [1] * 6), SCENE)
    curves = {c.title: c for c in curves_of(SCENE, events, [events], [events])}
    same = curves["Time between events of the sensor, same row"]
    other = curves["Time between events of the sensor, other row"]
    np.testing.assert_array_equal(same.measured[:4], [1, 1, 1, 0])  # at most 1, 2, 3 to 4 us
    np.testing.assert_array_equal(other.measured[[0, -1]], [1, 1])
    assert (same.measured.sum(), other.measured.sum()) == (3, 2)


def test_rates_are_per_pixel_and_second():
    number, expected = 0.0, 0.0
    for where, moving in (("in motion", True), ("at rest", False)):
        for name in ("ON", "OFF"):
            curve = CURVES[f"Rate against brightness, {where}, {name}"]
            for k in range(3):
                place = ((SCENE.speed != STILL) == moving) & (SCENE.brightness == k)
                seconds = 0.01 * np.count_nonzero(place)
                number += curve.measured[k] * seconds
        expected = len(MEASURED.stream)
    assert number == pytest.approx(expected)
    curve = CURVES["Rate against speed"]
    seconds = 0.01 * np.bincount(SCENE.speed.ravel(), minlength=4)
    assert np.sum(curve.measured * seconds) == pytest.approx(len(MEASURED.stream))


def test_the_course_is_a_rate_of_the_whole_sensor():
    curve = CURVES["Events over time"]
    assert curve.x[0] == 0.0
    assert curve.x[-1] == pytest.approx(STOP_US * 1e-6)
    assert np.sum(curve.measured * np.diff(curve.x)) == pytest.approx(len(MEASURED.stream))
    # half the events, half the rate
    assert curve.before.middle.mean() == pytest.approx(curve.after.middle.mean() / 2, rel=0.2)


@pytest.mark.parametrize(("where", "moving"), [("in motion", True), ("at rest", False)])
def test_the_place_between_frames_is_of_what_moves_or_rests(where, moving):
    curve = CURVES[f"Place between two frames, {where}"]
    phase = MEASURED.stream.t[(MEASURED.speed != STILL) == moving] % 10_000
    np.testing.assert_array_equal(curve.measured, np.bincount(phase // 1000, minlength=10))


def test_rows_are_counted_from_the_top():
    events = placed(stream_of([1, 2, 3, 4], [0, 5, 5, 2], [0, 3, 3, 11], [1, 1, 0, 0]), SCENE)
    curves = {c.title: c for c in curves_of(SCENE, events, [events], [events])}
    rows = curves["Rate against row"]
    np.testing.assert_array_equal(rows.x, np.arange(HEIGHT + 1))
    number = rows.measured * WIDTH * STOP_US * 1e-6
    np.testing.assert_allclose(number, np.bincount([0, 3, 3, 11], minlength=HEIGHT))


def test_an_edge_of_some_height_is_that_contrast():
    # one edge of 0.3 in the middle of the recording, in every pixel
    light = np.full((21, HEIGHT, WIDTH), 50.0)
    light[11:] *= np.exp(0.3)
    edge = scene_of(light, period_s=0.005)
    on = placed(stream_of([51_000, 54_000], [3, 4], [1, 1], [1, 1]), edge)
    curves = {c.title: c for c in curves_of(edge, on, [on], [on])}
    curve = curves["Rate against contrast, ON"]
    k = np.searchsorted(curve.x, 0.3) - 1
    # of 5 ms intervals, 4 more on either side are within 50 ms
    assert curve.measured[k] == pytest.approx(2 / (WIDTH * HEIGHT * 9 * 0.005))
    assert curve.measured[0] == 0.0
    assert np.all(np.isnan(np.delete(curve.measured, [0, k])))
    assert curves["Rate against contrast, OFF"].measured[k] == 0.0


def test_the_rate_of_the_sensor_stands_against_the_declared_one():
    title = "Rate of the sensor, from times of few events to times of many"
    t = np.repeat(np.arange(20) * 10_000 + 5, np.arange(20) + 1)  # more and more of them
    many = placed(stream_of(t, t % 7, t % 5, t % 2), SCENE)
    half = placed(many.stream.chosen(np.arange(len(t)) % 2 == 0), SCENE)
    curves = {c.title: c for c in curves_of(SCENE, half, [many, many], [half])}
    load = curves[title]
    assert len(load.x) == 8
    np.testing.assert_allclose(load.before.middle, load.x)
    np.testing.assert_allclose(load.measured, load.x / 2, rtol=0.1)
    np.testing.assert_array_equal(load.measured, load.after.middle)


def test_light_about_events_follows_them():
    up = scene_of(np.exp(0.05 * np.arange(21))[:, None, None] * np.full((1, 12, 16), 30.0))
    on = placed(random_stream(300, 3), up)
    on.stream.on[:] = 1
    curve = next(c for c in curves_of(up, on, [on], [on]) if "Light before" in c.title)
    np.testing.assert_allclose(curve.measured, 5.0, rtol=1e-3)


def test_maps_are_of_the_sensor():
    maps = maps_of(SCENE, MEASURED, BEFORE, AFTER)
    assert [one.title.split()[0] for one in maps] == ["ON", "OFF"]
    for one in maps:
        assert one.before.shape == one.after.shape == (HEIGHT, WIDTH)
        assert np.all(np.isfinite(one.before))
        assert one.before.mean() > one.after.mean() + 0.3


def test_maps_count_the_excess():
    twice = placed(random_stream(300, 3), SCENE)
    found = maps_of(SCENE, twice, [twice, twice], [placed(random_stream(0), SCENE)])
    for one, on in zip(found, (1, 0), strict=True):
        assert np.all(one.before == 0.0)
        pixel = twice.stream.pixel[twice.stream.on == on]
        number = np.bincount(pixel, minlength=WIDTH * HEIGHT).reshape(HEIGHT, WIDTH)
        np.testing.assert_array_equal(one.after, number)


def test_simulations_without_events_are_drawn():
    nothing = [placed(random_stream(0), SCENE)] * 2
    for curve in curves_of(SCENE, MEASURED, nothing, AFTER):
        known = np.isfinite(CURVES[curve.title].measured[: len(curve.measured)])
        assert np.all(np.isfinite(curve.measured)[known])
        assert np.all(np.isfinite(curve.after.middle)[known])


def test_classes_that_no_place_has_are_gaps():
    still = scene_of(np.full((21, HEIGHT, WIDTH), 40.0, np.float32))
    events = placed(random_stream(200, 2), still)
    curves = {c.title: c for c in curves_of(still, events, [events], [events])}
    speed = curves["Rate against speed"].measured
    assert np.isfinite(speed[0])
    assert np.all(np.isnan(speed[1:]))
    assert np.all(np.isnan(curves["Rate against brightness, in motion, ON"].measured))


@pytest.mark.parametrize("period_s", [0.04, 0.01, 0.003])
def test_contrast_is_the_range_of_log_light_within_50_ms(period_s):
    light = wandering_light(seed=3)
    found = contrast(scene_of(light, period_s=period_s))
    beside = {0.04: 0, 0.01: 2, 0.003: 7}[period_s]
    log = np.log(light).reshape(len(light), -1)
    for k in range(len(light) - 1):
        window = log[max(0, k - beside) : k + 2 + beside]
        np.testing.assert_allclose(found[k], np.ptp(window, axis=0), atol=1e-5)


def test_many_rows_are_joined_evenly():
    tall = scene_of(np.full((3, 260, 4), 30.0, np.float32))
    events = placed(stream_of(np.arange(260), 0, np.arange(260), 1, 4, 260), tall)
    (rows,) = (
        curve
        for curve in curves_of(tall, events, [events], [events])
        if curve.title == "Rate against row"
    )
    assert rows.x[0] == 0 and rows.x[-1] == 260
    assert set(np.diff(rows.x)) <= {5, 6}
    np.testing.assert_allclose(rows.measured, 1 / (4 * 0.02))


def test_classes_of_load_hold_as_many_events():
    rate = np.random.default_rng(1).uniform(10.0, 1000.0, 400)
    step = by_load(rate, 5)
    np.testing.assert_allclose(np.bincount(step, rate), rate.sum() / 5, rtol=0.03)
    assert all(rate[step == k].max() < rate[step == k + 1].min() for k in range(4))
    assert set(by_load(np.zeros(9), 5)) == {0}
