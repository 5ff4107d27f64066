"""What the groups of statistics count, against plain loops over the events."""

import bisect
import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from made_up.streams import HEIGHT, STOP_US, WIDTH, placed, some_scene, streams

from adv2e.diagnosis.statistics import pixels, rates, spectrum, timing

SCENE = some_scene(seed=5)
PARTS = 3
several = settings(deadline=None, max_examples=40)


def events(where):
    """Yield each event with its part, as plain numbers."""
    stream = where.stream
    columns = (stream.t, stream.pixel, stream.on, where.part)
    yield from zip(*(column.tolist() for column in columns), strict=True)


def histories(where):
    """Yield each event of a pixel that has one before it: (index, gap, on, on before, part)."""
    last = {}
    for k, (t, pixel, on, part) in enumerate(events(where)):
        if pixel in last:
            then, before = last[pixel]
            yield k, t - then, on, before, part
        last[pixel] = t, on


def interval_at(time_us):
    """Return the frame interval of a time, the first and last ones beyond the ends."""
    return min(max(bisect.bisect_right(SCENE.times_us.tolist(), time_us) - 1, 0), 19)


def bounded_slope(interval, pixel):
    typical = np.median(np.abs(SCENE.slope[SCENE.speed > 0]))
    slope = float(SCENE.slope[interval, pixel])
    return slope / (abs(slope) + typical)


def same(found, expected):
    assert found.shape == expected.shape
    np.testing.assert_allclose(found, expected, rtol=1e-5, atol=1e-5)


@several
@given(streams())
def test_rates(stream):
    where, expected = placed(stream, SCENE), np.zeros((PARTS, 4, 3, 2))
    for k, (_, _, on, part) in enumerate(events(where)):
        expected[part, where.speed[k], where.brightness[k], on] += 1
    same(rates.rates(SCENE).count(where), expected.reshape(PARTS, -1))


@several
@given(streams())
def test_course(stream):
    where, expected = placed(stream, SCENE), np.zeros((PARTS, 6, 2, 2))
    for k, (t, _, on, part) in enumerate(events(where)):
        expected[part, min(5, 6 * t // STOP_US), int(where.speed[k] > 0), on] += 1
    same(rates.course(0.0, STOP_US).count(where), expected.reshape(PARTS, -1))


@several
@given(streams())
def test_load(stream):
    rate = np.arange(20.0)[::-1] % 7
    group = rates.load(rate)
    # fifths of the declared model's events, from the least rate to the largest
    fifth, total = {}, 0.0
    for k in np.argsort(rate, kind="stable").tolist():
        total += rate[k]
        fifth[k] = min(4, int(5 * total / rate.sum() * (1 + 1e-12)))
    where, expected = placed(stream, SCENE), np.zeros((PARTS, 5, 2))
    for t, _, on, part in events(where):
        expected[part, fifth[t // 10_000], on] += 1
    same(group.count(where), expected.reshape(PARTS, -1))


@several
@given(streams())
def test_intervals(stream):
    where = placed(stream, SCENE)
    borders = [round(1000 * border) for border in timing.BORDERS_MS]
    expected = np.zeros((PARTS, len(borders) + 1, 2, 2))
    for _, gap, on, before, part in histories(where):
        expected[part, sum(gap >= border for border in borders), on, before] += 1
    same(timing.intervals().count(where), expected.reshape(PARTS, -1))


@several
@given(streams())
def test_intervals_at_rest(stream):
    where, expected = placed(stream, SCENE), np.zeros((PARTS, 6, 2, 2))
    for k, gap, on, before, part in histories(where):
        if where.speed[k] == 0:
            place = sum(gap >= border for border in (1e3, 4e3, 16e3, 64e3, 256e3))
            expected[part, place, on, before] += 1
    same(timing.intervals(at_rest=True).count(where), expected.reshape(PARTS, -1))


def test_the_order_of_a_pair_is_that_of_its_name():
    group = timing.intervals()
    names = [entry.name for entry in group.entries]
    from made_up.streams import stream_of

    where = placed(stream_of([0, 150], [5, 5], [5, 5], [0, 1]), SCENE)
    raw = group.count(where).sum(axis=0)
    assert names[int(np.argmax(raw))] == "OFF-ON after 0.1-0.25 ms"


@several
@given(streams())
def test_runs(stream):
    where, expected = placed(stream, SCENE), np.zeros((PARTS, 7, 2))
    run = {}
    for t, pixel, on, part in events(where):
        then, before, length = run.get(pixel, (t, on, 0))
        length = length + 1 if on == before and t - then <= 50_000 else 1
        run[pixel] = t, on, length
        place = bisect.bisect_left([1, 2, 3, 4, 6, 9], length)
        expected[part, place, on] += 1
    same(timing.runs().count(where), expected.reshape(PARTS, -1))


@several
@given(streams())
@pytest.mark.thorough
def test_lag(stream):
    where = placed(stream, SCENE)
    number, sums = np.zeros((PARTS, 3)), np.zeros((PARTS, len(timing.LAGS_MS), 3))
    for k, (t, pixel, on, part) in enumerate(events(where)):
        light = where.brightness[k]
        number[part, light] += 1
        for n, lag in enumerate(timing.LAGS_MS):
            slope = bounded_slope(interval_at(t - 1000 * lag), pixel)
            sums[part, n, light] += slope if on else -slope
    counted = timing.lag(timing.Slopes(SCENE)).count(where)
    same(counted, np.hstack([number, sums.reshape(PARTS, -1)]))


@several
@given(streams())
def test_drift(stream):
    where = placed(stream, SCENE)
    number, sums = np.zeros(4), np.zeros((2, 4))
    for t, pixel, on, _ in events(where):
        segment = min(3, t // 50_000)
        number[segment] += 1
        for n, (a, b) in enumerate(((-2, 4), (-8, 16))):
            later, earlier = (bounded_slope(interval_at(t - 1000 * lag), pixel) for lag in (a, b))
            sums[n, segment] += (earlier - later) * (1 if on else -1)
    group = timing.drift(timing.Slopes(SCENE))
    expected = sums / np.maximum(number, 1)
    same(group.values(group.count(where).sum(axis=0)), expected.ravel())


@several
@given(streams())
def test_shift(stream):
    where = placed(stream, SCENE)
    number, sums = np.zeros((PARTS, 1)), np.zeros((PARTS, 2, 2))
    for t, pixel, on, part in events(where):
        x, y = pixel % WIDTH, pixel // WIDTH
        if not (0 < x < WIDTH - 1 and 0 < y < HEIGHT - 1):
            continue
        number[part] += 1
        for n, lag in enumerate((2000, 10_000)):
            k = interval_at(t - lag)
            for side, step in enumerate((1, WIDTH)):
                beside = bounded_slope(k, pixel + step) - bounded_slope(k, pixel - step)
                sums[part, n, side] += beside if on else -beside
    counted = timing.shift(timing.Slopes(SCENE)).count(where)
    same(counted, np.hstack([number, sums.reshape(PARTS, -1)]))


@several
@given(streams())
def test_phase(stream):
    where, expected = placed(stream, SCENE), np.zeros((PARTS, 10, 2, 2))
    for k, (t, _, on, part) in enumerate(events(where)):
        expected[part, t % 10_000 // 1000, int(where.speed[k] > 0), on] += 1
    same(rates.phase(SCENE).count(where), expected.reshape(PARTS, -1))


@several
@given(streams())
def test_spectrum(stream):
    where, expected = placed(stream, SCENE), np.zeros((PARTS, 2, 200))
    for t, _, on, part in events(where):
        expected[part, 0, t // 1000] += 1
        expected[part, 1, t // 1000] += 1 if on else -1
    same(spectrum.spectrum(SCENE).count(where), expected.reshape(PARTS, -1))


@several
@given(streams())
def test_ticks(stream):
    where, expected = placed(stream, SCENE), np.zeros((PARTS, 1 + len(timing.TICKS_US)))
    for t, _, _, part in events(where):
        expected[part] += [1, *(t % tick == 0 for tick in timing.TICKS_US)]
    same(timing.ticks().count(where), expected)


@several
@given(streams())
def test_gaps(stream):
    where = placed(stream, SCENE)
    gaps, near = np.zeros((PARTS, 11)), np.zeros((PARTS, 4, 2))
    listed = list(events(where))
    for (t0, pixel0, *_), (t, pixel, _, part) in itertools.pairwise(listed):
        gap = t - t0
        gaps[part, sum(gap >= border for border in (1, 2, 3, 5, 8, 12, 20, 40, 80, 160))] += 1
        for n, reach in enumerate((3, 12, 40, 160)):
            if gap < reach:
                near[part, n] += [1, pixel // WIDTH == pixel0 // WIDTH]
    group = timing.gaps()
    shares = (near[..., 1] + 0.5) / (near[..., 0] + 1.0)
    expected = np.hstack([2.0 * np.sqrt(gaps + 0.375), shares])
    same(np.array([group.values(part) for part in group.count(where)]), expected)


@several
@given(streams())
def test_gaps_between_rows(stream):
    where = placed(stream, SCENE)
    found = [[] for _ in range(PARTS)]
    for (t0, pixel0, *_), (t, pixel, _, part) in itertools.pairwise(events(where)):
        if pixel // WIDTH != pixel0 // WIDTH:
            found[part].append(t - t0)
    counted = timing.row_gaps().count(where)
    assert list(counted.sum(axis=1)) == [len(gaps) for gaps in found]
    for row, gaps in zip(counted, found, strict=True):
        if gaps:
            longest = 100_000  # what is longer counts as that
            expected = np.quantile(
                np.minimum(gaps, longest), [0.1, 0.25, 0.5, 0.75], method="inverted_cdf"
            )
            off = np.abs(np.exp(timing.row_gaps().values(row)) - expected)
            assert np.all(off <= 0.501 + 0.08 * expected)  # bins of a microsecond, or of 7 %


@several
@given(streams())
def test_neighbours(stream):
    where, expected = placed(stream, SCENE), np.zeros((PARTS, 2, 8))
    listed = list(events(where))
    for k, (t, pixel, on, part) in enumerate(listed):
        x, y = pixel % WIDTH, pixel // WIDTH
        for same_kind in (0, 1):
            gap = np.inf
            for then, other, polarity, _ in listed[:k]:
                apart = abs(other % WIDTH - x) + abs(other // WIDTH - y)
                if apart == 1 and (polarity == on) == bool(same_kind):
                    gap = min(gap, t - then)
            borders = (100, 300, 1000, 3000, 10_000, 30_000, 100_000)
            expected[part, same_kind, sum(gap >= border for border in borders)] += 1
    same(timing.neighbours().count(where), expected.reshape(PARTS, -1))


@several
@given(streams())
def test_pixels(stream):
    where, expected = placed(stream, SCENE), np.zeros((PARTS, 2, 2, WIDTH * HEIGHT))
    for t, pixel, on, part in events(where):
        expected[part, min(1, t // 100_000), on, pixel] += 1
    same(pixels.count_pixels(where, SCENE), np.hstack([expected.reshape(PARTS, -1), np.eye(PARTS)]))
