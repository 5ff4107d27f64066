"""Bursts of all pixels with a period that no frame of the recording has."""

import numpy as np
import pytest
from made_up.sampler import HINTS
from made_up.streams import placed, some_scene, statistics, stream_of

from adv2e.config import load_config
from adv2e.diagnosis.fitting.fitted import Fitted
from adv2e.diagnosis.fitting.library import library
from adv2e.diagnosis.hints.own_period import OwnPeriod, own_period_of
from adv2e.diagnosis.hints.readouts import DELAY, Burst
from adv2e.diagnosis.outcome.findings import finding_of
from adv2e.diagnosis.statistics.rates import since_burst

SECONDS = 0.8
NAME = "readout.frame_coupling."


def events(period_us, on_us=None, off_us=None, start_s=0.0, burst=60, lasts_us=60.0, seed=1):
    """Return events whose rate wanders, with bursts of one or both polarities."""
    draw = np.random.default_rng(seed)
    moving = 1.0 + 0.8 * np.sin(np.linspace(0.0, 9.0, 999) + 6.0 * draw.random())
    at = np.interp(draw.random(20_000), np.cumsum(moving) / moving.sum(), np.linspace(0, 1, 999))
    t, on = [1e6 * (start_s + SECONDS * at)], [draw.integers(0, 2, at.size)]
    for polarity, delay_us in ((1, on_us), (0, off_us)):
        if delay_us is not None:
            first = np.ceil((1e6 * start_s - delay_us) / period_us)
            leaps = delay_us + period_us * (first + np.arange(1000))
            leaps = leaps[leaps < 1e6 * (start_s + SECONDS) - 500.0]
            t.append((leaps[:, None] + lasts_us * draw.random((leaps.size, burst))).ravel())
            on.append(np.full(t[-1].size, polarity))
    return stream_of(np.concatenate(t).astype(np.int64), 0, 0, np.concatenate(on))


def frames(start_s=0.0, interval_us=2000.0):
    return start_s + 1e-6 * interval_us * np.arange(SECONDS * 1e6 / interval_us + 1)


@pytest.mark.parametrize(
    ("period_us", "delay_us", "start_s"),
    [(40_000.0, 13_310.0, 0.0), (33_333.3, 7100.0, 3.0), (16_683.3, 16_600.0, 60.0)],
)
@pytest.mark.quick_cases(1)
def test_period_and_begin_are_read_off_with_how_well_they_are_known(period_us, delay_us, start_s):
    inside = []
    for seed in range(10):
        stream = events(period_us, on_us=delay_us, start_s=start_s, seed=seed)
        found = own_period_of(stream, frames(start_s))
        half = 0.5 * period_us
        late = (found.first.begins_us - delay_us + half) % period_us - half
        assert found.period_us == pytest.approx(period_us, abs=2.0)
        assert found.first is found.on
        assert found.off is None
        inside.append(abs(found.period_us - period_us) < 1.96 * found.period_sd_us)
        inside.append(abs(late) < 1.96 * found.begin_sd_us)
        assert found.period_sd_us < 1.0
        # far from zero of the clock, a period that is a little off has moved the begin
        assert found.begin_sd_us < 15.0 + start_s * 1e6 / period_us * found.period_sd_us
    assert np.mean(inside) >= 0.85


@pytest.mark.parametrize("lasts_us", [4.0, 40.0, 160.0])
def test_how_fast_a_leap_rises_is_read_off_beside_events_of_the_scene(lasts_us):
    for burst in (60, 600):
        found = own_period_of(
            events(40_000.0, on_us=13_310.0, burst=burst, lasts_us=lasts_us), frames()
        )
        # stamps are whole microseconds
        assert found.on.lasts_us == pytest.approx(lasts_us, rel=0.1, abs=1.5)
        assert found.on.begins_us == pytest.approx(13_310.0, rel=0, abs=1.5 + 0.05 * lasts_us)
        assert found.keys[f"{NAME}rise_us"] == found.on.lasts_us


@pytest.mark.parametrize(
    ("stream", "times_s"),
    [
        (events(40_000.0), frames()),
        (events(40_000.0, on_us=500.0, burst=3), frames()),
        (events(300_000.0, on_us=500.0), frames()),
        (events(20_000.0, on_us=500.0), frames(interval_us=20_000.0)),
        (events(40_000.0, on_us=500.0, lasts_us=20_000.0, burst=600), frames()),
        (events(2000.0, on_us=500.0), frames()),
    ],
    ids=["none", "few events", "few bursts", "of each frame", "a swing", "at each frame"],
)
def test_no_period_of_their_own(stream, times_s):
    assert own_period_of(stream, times_s) is None


def test_stamps_of_a_coarse_clock_are_no_bursts():
    fine = events(40_000.0)
    coarse = stream_of(fine.t // 4000 * 4000, 0, 0, fine.on)
    assert own_period_of(coarse, frames()) is None


def test_frames_of_film_that_are_further_apart_than_the_bursts():
    found = own_period_of(events(25_000.0, on_us=500.0), frames(interval_us=40_000.0))
    assert found.period_us == pytest.approx(25_000.0, abs=1.0)


@pytest.mark.parametrize(("on_us", "off_us"), [(9000.0, 10_500.0), (500.0, 39_000.0)])
def test_bursts_of_both_polarities_may_be_a_pulse(on_us, off_us):
    found = own_period_of(events(40_000.0, on_us, off_us), frames())
    # the leap is the one that is followed sooner
    is_up = (off_us - on_us) % 40_000.0 < 20_000.0
    assert found.first is (found.on if is_up else found.off)
    keys = found.keys_of_pulse(up=is_up)
    assert keys[DELAY] == pytest.approx(on_us if is_up else off_us, abs=25.0)
    assert keys[f"{NAME}width_us"] == pytest.approx(1500.0, abs=25.0)
    # the other way round it is the same signal
    assert found.keys_of_pulse(up=not is_up) is None


ON, OFF = Burst(13_000.0, 60.0, 0.1), Burst(14_500.0, 90.0, 0.1)


def couplings(own_period, sets=()):
    hints = HINTS.__class__(**{**vars(HINTS), "own_period": own_period})
    made = library(load_config([], list(sets)), hints)
    return [one for one in made if one.name == "frame_coupling"]


def test_the_library_has_leaps_with_that_period_and_they_are_told_with_intervals():
    (leap,) = couplings(OwnPeriod(40_000.0, 0.5, 15.0, ON, None))
    config = leap.applied(load_config([], ["frames.exposure_us=5000"]), leap.scaled((0.05, 300.0)))
    coupling = config.readout.frame_coupling
    assert (coupling.period_us, coupling.delay_us, coupling.width_us) == (40_000.0, 13_000.0, 0.0)
    finding = finding_of(Fitted.at((0.05, 300.0), leap, config), 100, config)
    assert finding.parameters[f"{NAME}period_us"] == 40_000.0
    assert finding.interval[f"{NAME}period_us"] == pytest.approx((39_999.02, 40_000.98))
    assert finding.interval[f"{NAME}delay_us"] == pytest.approx((12_970.6, 13_029.4))
    pulses = couplings(OwnPeriod(40_000.0, 0.5, 15.0, ON, OFF))
    widths = [dict(one.extra).get(f"{NAME}width_us") for one in pulses]
    assert widths == [None, 1500.0]
    assert all(a > 0.0 and tau <= 30_000.0 for a, tau in pulses[1].starts)
    (_, downwards) = couplings(OwnPeriod(40_000.0, 0.5, 15.0, OFF, ON))
    assert dict(downwards.extra)[f"{NAME}width_us"] == 1500.0
    assert all(a < 0.0 and tau <= 30_000.0 for a, tau in downwards.starts)
    # of a camera that is known to disturb its pixels, the period is known, too
    for known in ("width_us: 900", "period_us: 20000"):
        sets = [f"readout.frame_coupling={{amplitude: 0.1, tau_us: 500, {known}}}"]
        (declared,) = couplings(OwnPeriod(40_000.0, 0.5, 15.0, ON, None), sets)
        assert declared.extra == ()


def test_events_are_counted_by_the_time_since_a_burst():
    scene = some_scene()
    t = 7000 + 15_000 * np.repeat(np.arange(5), 4) + np.tile([-40, 10, 400, 5500], 5)
    where = placed(stream_of(t, 0, 0, 1), scene)
    group = since_burst(15_000.0, 7000.0)
    counted = {
        name: group.entries[0].plain(value) for name, value in statistics(group, where).items()
    }
    named = {name: round(value) for name, value in counted.items() if value > 0.5}
    assert named == {
        "ON events 0-150 us after a burst, at rest": 10,
        "ON events 300-600 us after a burst, at rest": 5,
    }
