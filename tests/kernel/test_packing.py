"""Packed events into order: parting by time, sorting slice by slice, unpacking; against NumPy."""

import itertools

import numpy as np
import pytest
from harness import advance, quiet, start

from adv2e.config.model import LowPass, Thresholds
from adv2e.effects.pixel.shot_noise import ShotNoise
from adv2e.errors import DataError
from adv2e.events import EVENT_DTYPE
from adv2e.kernel import packing as order
from adv2e.kernel.packing import PIXEL_BITS, pack_limit_us
from adv2e.pixel import merge as sorting

LAST_PIXEL = (1 << PIXEL_BITS) - 1
LONGEST_US = pack_limit_us() // 2 - 1
"""The longest span that a call takes [us]."""


def pack(stamps, pixels, polarities):
    """Pack events as the module's first lines say."""
    stamps, pixels = np.asarray(stamps, np.int64), np.asarray(pixels, np.int64)
    return stamps * (1 << (PIXEL_BITS + 1)) + pixels * 2 + np.asarray(polarities, np.int64)


def part(keys, span_us):
    """Return (parted, ends) of the events of a call over `span_us`."""
    ends, parted = np.empty(order.SLICES + 1, np.int64), np.full(len(keys), -1, np.int64)
    # room for more than there are, as a worker has
    room = np.append(keys, np.full(7, -5, np.int64))
    order.part_by_time(room, len(keys), order.SLICES / (span_us + 2.0), ends, parted)
    return parted, ends


def in_order(keys, span_us, columns, t0):
    """Return the events, sorted slice by slice."""
    parted, ends = part(keys, span_us)
    events = np.zeros(len(keys), EVENT_DTYPE)
    for a, b in itertools.pairwise(ends):
        order.unpack(np.sort(parted[a:b]), columns, t0, events[a:b])
    return events


def expected(stamps, pixels, polarities, columns, t0):
    """Return the events in order, by NumPy alone."""
    events = np.empty(len(stamps), EVENT_DTYPE)
    events["t"], events["p"] = np.asarray(stamps, np.int64) + t0, polarities
    events["y"], events["x"] = np.divmod(np.asarray(pixels, np.int64), columns)
    return events[np.lexsort((events["p"], events["x"], events["y"], events["t"]))]


def borders(span_us):
    """Whole microseconds on both sides of every border of slices, and the first and last ones."""
    at = np.arange(order.SLICES + 1) * ((span_us + 2.0) / order.SLICES)
    near = np.concatenate([np.floor(at) - 1, np.floor(at), np.ceil(at), [0, 1, span_us + 1]])
    return np.clip(near, 0, span_us + 2).astype(np.int64)


def draw(kind, span_us, seed=0, count=5000):
    """Return stamps [us since the base], of which a call gives 0 to span + 2."""
    rng = np.random.default_rng(seed)
    if kind == "empty":
        return np.empty(0, np.int64)
    if kind == "one":
        return rng.integers(0, span_us + 3, 1)
    if kind == "all at one time":
        return np.full(count, span_us // 2)
    if kind == "all at the end":
        return np.full(count, span_us + 2)
    if kind == "at the borders of slices":
        return rng.permutation(np.repeat(borders(span_us), 8))
    if kind == "in order":
        return np.sort(rng.integers(0, span_us + 3, count))
    if kind == "backwards":
        return np.sort(rng.integers(0, span_us + 3, count))[::-1].copy()
    return rng.integers(0, span_us + 3, count)


KINDS = [
    "empty",
    "one",
    "all at one time",
    "all at the end",
    "at the borders of slices",
    "in order",
    "backwards",
    "random",
]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("span_us", [1, 50, 63, 64, 4_167, 1_000_003, LONGEST_US])
@pytest.mark.parametrize("columns", [1, 346, 65_535])
def test_order_is_that_of_numpy(kind, span_us, columns):
    stamps = draw(kind, span_us)
    rng = np.random.default_rng(1)
    # few pixels, so that times and pixels tie, and those with the largest numbers
    most = min(LAST_PIXEL, columns * 65_536 - 1)
    pixels = rng.choice([0, 1, columns - 1, columns, 700, most - 1, most], stamps.size)
    polarities = rng.integers(0, 2, stamps.size)
    found = in_order(pack(stamps, pixels, polarities), span_us, columns, t0=12_345)
    assert np.array_equal(found, expected(stamps, pixels, polarities, columns, 12_345))


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("span_us", [1, 4_167, LONGEST_US])
def test_slices_hold_all_events_and_follow_each_other(kind, span_us):
    stamps = draw(kind, span_us)
    keys = pack(stamps, np.arange(stamps.size), stamps % 2)
    parted, ends = part(keys, span_us)
    assert ends[0] == 0
    assert ends[-1] == keys.size
    assert np.all(np.diff(ends) >= 0)
    assert np.array_equal(np.sort(parted), np.sort(keys))
    slices = [parted[a:b] >> (PIXEL_BITS + 1) for a, b in itertools.pairwise(ends)]
    filled = [times for times in slices if times.size]
    # also between tiles, whose slices are put together: no time lies in two of them
    assert all(a.max() < b.min() for a, b in itertools.pairwise(filled))
    # in each slice they stay as they came
    for slice_keys, times in zip(np.split(parted, ends[1:-1]), slices, strict=True):
        came = keys[np.isin(keys, slice_keys)]
        assert times.size == came.size
        assert np.array_equal(slice_keys, came)


def test_random_times_fill_the_slices_evenly():
    _, ends = part(pack(draw("random", 1_000_000, count=64_000), 0 * np.arange(64_000), 0), 1e6)
    assert np.diff(ends).min() > 800


def test_a_time_is_in_one_slice_whatever_its_pixel():
    """Smallest and largest pixel of one time are not told apart by the rounding to slices."""
    span_us = LONGEST_US
    for stamp in borders(span_us):
        keys = pack([stamp, stamp], [0, LAST_PIXEL], [0, 1])
        _, ends = part(keys, span_us)
        assert sorted(np.diff(ends))[-1] == 2


@pytest.mark.parametrize("t0", [-3, 0, 1_700_000_000_000_000])
def test_the_largest_number_that_can_be_packed(t0):
    stamp = pack_limit_us() - 1
    keys = pack([stamp], [LAST_PIXEL], [1])
    assert keys[0] == np.iinfo(np.int64).max
    events = np.zeros(1, EVENT_DTYPE)
    columns = 16_384
    order.unpack(keys, columns, t0, events)
    assert events[0]["t"] == stamp + t0
    assert events[0]["x"] == LAST_PIXEL % columns
    assert events[0]["y"] == LAST_PIXEL // columns
    assert events[0]["p"] == 1


@pytest.mark.parametrize("threads", [1, 3])
@pytest.mark.parametrize("times_ns", [[0, 1_000], [5_000_400, 9_167_066, 13_333_733]])
@pytest.mark.parametrize("yielded", [1, 5_000, 1 << 20])
@pytest.mark.quick_cases(1)
def test_tiles_are_put_together_in_order(monkeypatch, threads, times_ns, yielded):
    """Bursts of several tiles at a few times: many ties, more events than are sorted at once."""
    monkeypatch.setattr(sorting, "_YIELDED", yielded)
    rng = np.random.default_rng(3)
    rows, columns = 30, 300
    light = rng.choice([2.0, 40.0, 250.0], (len(times_ns), rows, columns)).astype(np.float32)
    pixel = quiet(low_pass=None, thresholds=Thresholds(on=0.1, off=0.1, mismatch=0.0))
    found = []
    for options in ({"tile": 2048}, {}):
        array = start(light, times_ns, pixel, exact_times=True, **options)
        events, exact = advance(array, light, times_ns, threads=threads)
        assert events.size > 1 << 16
        fields = (events["p"], events["x"], events["y"], events["t"])
        assert np.array_equal(np.lexsort(fields), np.arange(events.size))
        # the unrounded times go along
        assert np.abs(exact + array.origin_us - events["t"]).max() <= 0.5 + 1e-6
        found.append(events)
    assert np.array_equal(*found)


def test_columns_that_an_event_cannot_hold_are_refused():
    light = np.full((2, 1, 70_000), 20.0, np.float32)
    with pytest.raises(DataError, match="65536"):
        start(light, [0], quiet())


def test_a_call_may_be_as_long_as_the_packing_allows():
    """Two frames hours apart: times are whole, in order and not wrapped round."""
    end_us = LONGEST_US - 10
    light = np.array([[[20.0, 30.0]], [[50.0, 25.0]]], np.float32)
    times_ns = [7_000, 7_000 + end_us * 1_000]
    pixel = quiet(low_pass=LowPass(), thresholds=Thresholds(on=0.2, off=0.1, mismatch=0.0))
    events, _ = advance(start(light, times_ns, pixel), light, times_ns)
    share = 0.2 * np.arange(1, 5) / np.log(2.5)
    on = events[events["x"] == 0]
    # so slow that the signal is the light itself: thresholds lie at equal shares of the interval
    assert on.size == 4
    assert np.allclose((on["t"] - 7) / end_us, share, rtol=1e-5)
    assert np.all(np.diff(events["t"]) >= 0)


def test_a_pixel_that_fires_both_ways_within_a_microsecond_does_so_as_it_happened():
    made = [(5, 34, 1), (5, 34, 0), (5, 34, 1), (5, 3, 0), (6, 34, 1), (6, 34, 0), (6, 2, 1)]
    keys = np.array([t << (PIXEL_BITS + 1) | i << 1 | p for t, i, p in made], np.int64)
    part = sorting.Parted(keys, np.zeros(0), keys.size, 1.0)
    events = np.concatenate(list(sorting.in_order([part], 10, 0, None)))
    assert [(e["t"], 10 * e["y"] + e["x"], e["p"]) for e in events] == [
        made[k] for k in (3, 0, 1, 2, 6, 4, 5)
    ]


def test_unrounded_times_of_a_pixel_never_fall():
    """Much noise and no dead time: some pixels fire both ways within a microsecond."""
    light = np.random.default_rng(0).integers(0, 256, (6, 20, 30)).astype(np.float32)
    times_ns = [8_000_000 * k for k in range(6)]
    pixel = quiet(refractory=None, shot_noise=ShotNoise(rate_hz=20_000.0))
    array = start(light, times_ns, pixel, exact_times=True)
    events, exact = advance(array, light, times_ns)
    pixels = events["y"].astype(np.int64) * 30 + events["x"]
    order = np.argsort(pixels, kind="stable")
    same = pixels[order][1:] == pixels[order][:-1]
    assert np.all(np.diff(exact[order])[same] >= 0)
    tied = same & (np.diff(events["t"][order]) == 0)
    assert np.any(events["p"][order][:-1][tied] > events["p"][order][1:][tied])
