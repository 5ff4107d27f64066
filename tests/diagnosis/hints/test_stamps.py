"""What stamps say of a readout, on streams whose readout is known."""

import bisect
from operator import itemgetter

import numpy as np
import pytest
from made_up.streams import stream_of

from adv2e.config import Config
from adv2e.diagnosis.fitting.library import library
from adv2e.diagnosis.hints.collect import Hints
from adv2e.diagnosis.hints.stamps import Service, service_times, tick_of

SIDE = 48


# --- ticks ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("tick", [1, 7, 30, 64, 300, 1000])
@pytest.mark.parametrize("start", [0, 9_999_000, 1_467_939_975_000_000])
def test_the_tick_of_stamps(tick, start):
    draw = np.random.default_rng(tick)
    t = tick * (start // tick + np.sort(draw.integers(0, 10_000, 500)))
    assert tick_of(t) == tick


def test_single_stamps_off_the_tick_do_not_hide_it():
    draw = np.random.default_rng(3)
    t = 10 * np.sort(draw.integers(0, 100_000, 3000))
    t[[7, 1500, 2999]] += 3
    assert tick_of(t) == 10
    t[::20] += 3
    assert tick_of(t) == 1


@pytest.mark.parametrize("t", [[], [0]])
def test_stamps_that_say_nothing(t):
    stream = stream_of(t, 0, 0, 1)
    assert tick_of(stream.t) == 1
    assert service_times(stream) is None


# --- arbiters ------------------------------------------------------------------------------------


def requests(mean_gap_us, count=6000, seed=1):
    """Return times, columns and rows of events that ask to be read, as edges do: near each other"""
    draw = np.random.default_rng(seed)
    groups = np.repeat(np.sort(draw.random(count // 4)) * mean_gap_us * count, 4)
    t = groups + draw.random(count) * 3.0
    order = np.argsort(t)
    return t[order], draw.integers(0, SIDE, count)[order], draw.integers(0, SIDE, count)[order]


def read_out(t, x, y, event_us, row_us):
    """Return the stream of a channel that takes the row that has waited longest, and all of it."""
    waiting, out, free = list(zip(t, x, y, strict=True)), [], 0.0
    while waiting:
        row = waiting[0][2]
        latch = max(free, waiting[0][0]) + row_us
        come = bisect.bisect_right(waiting, latch, key=itemgetter(0))
        served = [one for one in waiting[:come] if one[2] == row]
        waiting[:come] = [one for one in waiting[:come] if one[2] != row]
        free = latch
        for column in sorted({column for _, column, _ in served}):
            free += event_us
            out.append((round(free), column, row))
    return stream_of(*np.array(out).T, 1, SIDE, SIDE)


@pytest.mark.parametrize(
    ("event_us", "row_us"), [(0.5, 4.0), (2.0, 10.0), (4.0, 20.0), (1.3, 7.4), (0.1, 60.0)]
)
@pytest.mark.parametrize("busy", [0.3, 1.5])
def test_times_of_an_arbiter(event_us, row_us, busy):
    stream = read_out(*requests((event_us + row_us) / busy), event_us, row_us)
    found = service_times(stream)
    assert found is not None
    assert abs(found.event_ns - 1e3 * event_us) < 3.0 * found.event_sd_ns
    assert abs(found.row_ns - 1e3 * row_us) < 3.0 * found.row_sd_ns
    assert found.event_sd_ns < 40.0
    if event_us.is_integer():  # all gaps are alike
        assert found.event_sd_ns < 5.0


def test_times_of_an_event_that_gaps_say_little_of():
    # ten of a row at a time, each 2 us after the one before, the first 22 us after the last row
    t = (40 * np.arange(2000)[:, None] + 2 * np.arange(10)).ravel()
    x, y = np.tile(np.arange(10), 2000), np.repeat(np.arange(2000) % SIDE, 10)

    def of(kept):
        return service_times(stream_of(t[kept], x[kept], y[kept], 1, SIDE, SIDE))

    whole = of(np.full(t.size, True))
    assert whole.event_ns == pytest.approx(2000.0, abs=3.0 * whole.event_sd_ns)
    assert whole.event_sd_ns < 1.0
    # the gaps of those beside lost ones are longer
    lossy = of(np.random.default_rng(1).random(t.size) > 0.05)
    assert lossy.event_ns == pytest.approx(2000.0, abs=lossy.event_sd_ns)
    assert lossy.event_sd_ns > 20.0
    # no two of a row
    assert of(x == 0).event_sd_ns > 10_000.0


@pytest.mark.parametrize("both_us", [3.6, 4.5, 6.7, 11.0])
def test_what_comes_by_chance_after_it_does_not_count(both_us):
    draw = np.random.default_rng(8)
    gaps = np.concatenate([np.full(4000, both_us), both_us + 40.0 * draw.random(60_000)])
    draw.shuffle(gaps)
    t = np.cumsum(gaps)
    alternating = np.arange(len(t)) % SIDE
    found = service_times(stream_of(np.floor(t), 0, alternating, 1, SIDE, SIDE))
    assert found.event_ns + found.row_ns == pytest.approx(1e3 * both_us, abs=50.0)


@pytest.mark.parametrize("tick", [1, 10, 500])
@pytest.mark.parametrize("mean_gap_us", [2.0, 20.0, 200.0, 5000.0])
def test_no_arbiter(tick, mean_gap_us):
    t, x, y = requests(mean_gap_us)
    assert service_times(stream_of(t // tick * tick, x, y, 1, SIDE, SIDE)) is None


def test_all_events_of_one_row():
    t, x, _ = requests(20.0)
    assert service_times(stream_of(t, x, 0, 1, SIDE, SIDE)) is None


def readout(hint):
    made = library(Config(), Hints(1.0, (), 1, service=hint))
    return next(one for one in made if one.name == "readout")


def test_a_fit_starts_there_and_stays_near():
    hinted, plain = readout(Service(700.0, 8000.0, 30.0, 40.0)), readout(None)
    assert hinted.starts == (*plain.starts, (700.0, 8000.0))
    told = (700.0, 30.0), (8000.0, 40.0)
    for (at, sd), one, (ns, sd_ns) in zip(hinted.known, hinted.parameters, told, strict=True):
        assert one.value_at(at) == pytest.approx(ns)
        assert one.value_at(at + sd) - ns == pytest.approx(sd_ns, rel=0.05)
    assert not plain.known
