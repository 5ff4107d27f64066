"""What is measured of a sensor is what closed forms say of its circuit."""

import json
import math
from functools import cache

import numpy as np
import pytest

from adv2e import ConfigError, UsageError, load_config, sensor

LIGHT = 10.0 ** (-0.5 * np.arange(6))  # share of white
PURE = (
    *("pixel.log_response.linear_below=0", "pixel.log_response.floor=0.001"),
    *(f"pixel.{effect}=null" for effect in ("low_pass", "refractory", "shot_noise", "leak")),
    *("pixel.thresholds.mismatch=0", "pixel.initial_reference=settled"),
)
"""A logarithm and two thresholds, and nothing else."""


def low_pass(white, dark, *more):
    section = f"pixel.low_pass={{cutoff_hz: {white}, dark_cutoff_hz: {dark}}}"
    return (*(key for key in PURE if "low_pass" not in key), section, *more)


@cache
def found(sets, **options):
    return sensor(load_config(None, sets), **options)["sensors"][0]


def numbers(of, name):
    """Return the numbers of that name, by where they were measured."""
    return {one["at"]: one for one in of["numbers"] if one["name"] == name}


def series(of, key, name):
    plot = next(one for one in of["plots"] if one["key"] == key)
    return next(one for one in plot["series"] if one["name"] == name)


def inside(number, truth, times=2.0):
    """Tell whether a truth is in the interval, widened from 95 % to one in ten thousand."""
    value = number["value"]
    low, high = (value + times * (number[end] - value) for end in ("low", "high"))
    return low <= truth <= high


def test_thresholds_and_their_spread_are_those_that_were_drawn():
    sets = "pixel.thresholds={on: 0.3, off: 0.15, mismatch: 0.04}"
    of = found((*PURE, sets))
    for word, threshold in (("ON", 0.3), ("OFF", 0.15)):
        mean, spread = (
            numbers(of, f"{what} threshold, {word}") for what in ("contrast", "spread of the")
        )
        assert list(mean) == ["100 % of white", "10 % of white", "1 % of white"]
        for one in mean.values():
            assert inside(one, threshold)
            assert one["high"] - one["low"] < 0.1 * threshold
        for one in spread.values():
            assert inside(one, 0.04)
        curve = series(of, f"s_curve_{word.lower()}", "10 % of white")
        x = np.log1p(np.array(curve["x"]) / 100.0)
        truth = np.array([0.5 * math.erfc((threshold - one) / (0.04 * math.sqrt(2))) for one in x])
        # bins have a width, and so have the lowest thresholds, which are cut off
        assert np.abs(np.array(curve["y"]) - truth).max() < 0.15
        assert np.abs(np.array(curve["y"]) - truth).mean() < 0.02


def test_intervals_are_of_95_percent():
    sets = (*PURE, "pixel.thresholds={on: 0.3, off: 0.15, mismatch: 0.04}")
    deviations = []
    for seed in range(8):
        of = sensor(load_config(None, sets, seed=seed))["sensors"][0]
        spreads = [(f"spread of the threshold, {word}", 0.04) for word in ("ON", "OFF")]
        means = [("contrast threshold, ON", 0.3), ("contrast threshold, OFF", 0.15)]
        for name, truth in (*means, *spreads):
            deviations += [
                1.96 * (one["value"] - truth) / (one["high"] - one["value"])
                for one in numbers(of, name).values()
            ]
    assert len(deviations) == 96
    assert abs(np.mean(deviations)) < 0.4
    assert 0.75 < np.std(deviations) < 1.25


def test_thresholds_of_pixels_that_are_alike_are_as_fine_as_the_contrasts():
    one = numbers(found(PURE), "contrast threshold, ON")["100 % of white"]
    assert abs(one["value"] - 0.2) < 2e-4
    assert inside(one, 0.2)


def test_below_the_knee_of_the_log_map_more_contrast_is_needed():
    knee, dn = 20.0, 2.55
    of = found(
        (
            *(key for key in PURE if "log_resp" not in key),
            f"pixel.log_response.linear_below={knee:g}",
        )
    )
    # x = dn ln(knee)/knee
    truth = -math.log(1.0 - 0.2 / (dn * math.log(knee) / knee))
    for word in ("ON", "OFF"):
        by_light = numbers(of, f"contrast threshold, {word}")
        assert by_light["1 % of white"]["value"] == pytest.approx(truth, rel=2e-3)
        assert by_light["100 % of white"]["value"] == pytest.approx(0.2, rel=2e-3)


def test_pixels_that_are_dead_or_fire_by_chance_leave_the_threshold():
    noise = "pixel.hot_pixels={fraction: 0.3, rate_hz: 5}", "pixel.dead_pixels={fraction: 0.1}"
    of = found((*PURE, *noise, "pixel.thresholds.mismatch=0.02"))
    for word in ("ON", "OFF"):
        for one in numbers(of, f"contrast threshold, {word}").values():
            assert inside(one, 0.2)
            assert abs(one["value"] - 0.2) < 0.02


@pytest.mark.parametrize("contrast", [0.5, 1.5])
def test_latency_is_that_of_a_pole_at_the_corner_of_the_light_after_the_step(contrast):
    of = found(low_pass(500, 20, "pixel.thresholds={on: 0.25, off: 0.1}"), contrast=contrast)
    corner = 2.0 * math.pi * (20.0 + 480.0 * LIGHT)
    dim = 2.0 * math.pi * (20.0 + 480.0 * LIGHT * math.exp(-contrast))
    for word, rate, threshold in (("ON", corner, 0.25), ("OFF", dim, 0.1)):
        truth = -1e6 / rate * math.log(1.0 - threshold / contrast)
        curve = series(of, "latency", word)
        assert curve["x"] == pytest.approx(LIGHT)
        # the step takes 1 us, and times are whole us
        assert np.abs(np.array(curve["y"]) - truth).max() < 1.6
        assert numbers(of, f"latency, {word}, median")["1 % of white"]["value"] == curve["y"][4]


def test_latency_spreads_as_thresholds_do():
    of = found(low_pass(500, 20, "pixel.thresholds.mismatch=0.05"))
    curve = series(of, "latency", "ON")
    normal = 1.2815515655446004  # of 90 %
    for k in (0, 3, 5):
        rate = 2.0 * math.pi * (20.0 + 480.0 * LIGHT[k])
        for end, threshold in (("low", 0.2 - normal * 0.05), ("high", 0.2 + normal * 0.05)):
            assert curve[end][k] == pytest.approx(-1e6 / rate * math.log(1.0 - threshold), rel=0.08)


def test_no_latency_is_told_where_most_pixels_have_no_event():
    of = found((*PURE, "pixel.thresholds.on=1.1"))
    assert series(of, "latency", "ON")["y"] == [None] * 6
    assert series(of, "latency", "OFF")["y"] == [1.0] * 6
    assert numbers(of, "latency, ON, median")["1 % of white"]["value"] is None


def test_noise_is_that_of_poisson_events_and_of_the_leak():
    leak = "pixel.leak={rate_hz: 0.2, photo_rate_hz: 0.5}", "pixel.shot_noise.rate_hz=1"
    off = ("leak=null", "shot_noise=null", "settled")
    of = found((*(key for key in PURE if not key.endswith(off)), *leak))
    shot, pixels = 1.0 - 0.75 * LIGHT, 1000
    for name, truth in (("OFF", 0.5 * shot), ("by shot noise", shot)):
        key = "noise" if name == "OFF" else "noise_by_cause"
        rate = np.array(series(of, key, name)["y"])
        seconds = 60 if (rate * 10 * pixels < 100).any() else 10
        assert (np.abs(rate - truth) < 4.5 * np.sqrt(truth / (pixels * seconds))).all()
    # shot noise of rate r takes the reference anew: a leak of rate l waits 1/l without an event
    whole = 0.2 + 0.5 * LIGHT
    truth = shot / np.expm1(shot / whole)
    leaks = np.array(series(of, "noise_by_cause", "by leak")["y"])
    error = np.sqrt(truth / (pixels * 10))
    assert (np.abs(leaks - truth) < 4.5 * error).all()
    assert np.array(series(of, "noise", "ON")["y"]) == pytest.approx(leaks + 0.5 * shot, rel=0.05)


def test_where_no_event_came_a_rate_has_a_limit():
    one = numbers(found(PURE), "noise events, ON")["100 % of white"]
    assert (one["value"], one["low"]) == (0.0, 0.0)
    assert one["high"] == pytest.approx(3.0 / (60 * 1000))
    assert all(plot["key"] != "noise_by_cause" for plot in found(PURE)["plots"])


def test_gain_is_that_of_a_pole():
    of = found(low_pass(400, 10))
    for share, at in ((1.0, "100 %"), (0.1, "10 %"), (0.01, "1 %")):
        corner = 10 + 390 * share
        curve = series(of, "bandwidth", f"{at} of white")
        gain = np.array([math.nan if one is None else one for one in curve["y"]])
        truth = 1.0 / np.sqrt(1.0 + (np.array(curve["x"]) / corner) ** 2)
        truth /= truth[0]  # the lowest frequency that is tried
        seen = gain > 0.2
        assert seen.sum() > 5
        # the burst has a width, and its amplitude is known to a part in 150; far above the corner
        # that is large, and as the corner moves with the light, its mean moves the pixel, too
        assert gain[gain > 0.5] == pytest.approx(truth[gain > 0.5], rel=0.025)
        assert gain[seen] == pytest.approx(truth[seen], rel=0.12)
        one = numbers(of, "bandwidth, -3 dB")[f"{at} of white"]
        assert one["value"] == pytest.approx(corner, rel=0.04)
        assert one["low"] < one["value"] < one["high"]


def test_two_poles_share_a_corner():
    of = found(low_pass(300, 300, "pixel.source_follower.cutoff_hz=100"))
    a, b = 300.0**2, 100.0**2  # (1 + f2/a)(1 + f2/b) = 2
    truth = math.sqrt(0.5 * (math.sqrt((a + b) ** 2 + 4.0 * a * b) - (a + b)))
    for one in numbers(of, "bandwidth, -3 dB").values():
        assert one["value"] == pytest.approx(truth, rel=0.03)


def test_without_a_pole_the_corner_is_above_all_that_was_tried():
    for one in numbers(found(PURE), "bandwidth, -3 dB").values():
        assert (one["value"], one["low"], one["high"]) == (None, pytest.approx(1e5), None)


@pytest.mark.thorough
def test_a_high_pass_is_told_from_a_low_pass():
    of = found(low_pass(300, 300, "pixel.high_pass.cutoff_hz=10"))
    curve = series(of, "bandwidth", "100 % of white")
    f = np.array(curve["x"])
    gain = np.array([math.nan if one is None else one for one in curve["y"]])
    truth = f / 10 / np.sqrt(1 + (f / 10) ** 2) / np.sqrt(1 + (f / 300) ** 2)
    seen = (gain > 0.3) & (f > 3)
    assert gain[seen] / np.nanmax(gain) == pytest.approx(truth[seen] / truth.max(), rel=0.08)
    assert numbers(of, "bandwidth, -3 dB")["100 % of white"]["value"] == pytest.approx(320, rel=0.1)


def test_a_pixel_fires_as_often_as_the_light_crosses_its_thresholds():
    of = found((*PURE, "pixel.thresholds={on: 0.1931, off: 0.2873}"))
    curve = series(of, "rate", "ON and OFF")
    signal, reference, counts = math.log(100.0), math.log(100.0), []
    for _ in range(40):  # a leap and its events
        signal, count = math.log(100.0) - signal, 0
        step = 0.1931 if signal else -0.2873
        while (signal - reference) * step >= step * step:
            reference, count = reference + step, count + 1
        counts.append(count)
    assert curve["x"][-1] == pytest.approx(1e5)
    assert curve["y"] == pytest.approx(2 * np.mean(counts) * np.array(curve["x"]), rel=0.03)


def test_the_dead_time_limits_the_rate():
    of = found((*PURE, "pixel.refractory.period_us=700"))
    least = numbers(of, "least time between events of a pixel")
    assert 700 <= next(iter(least.values()))["value"] <= 702
    most = next(iter(numbers(of, "highest rate of a pixel").values()))["value"]
    assert 0.6 / 700e-6 < most <= 1.001 / 700e-6


ARBITER = "readout.arbiter={event_ns: 100, row_ns: 3900}", "sensor={width: 40, height: 60}"


def test_the_readout_saturates_where_all_pixels_ask():
    of = found((*PURE, *ARBITER))
    capacity = 40 / (3.9e-6 + 40 * 0.1e-6)
    assert numbers(of, "capacity of the readout")["40x60 pixels"]["value"] == pytest.approx(
        capacity, rel=0.02
    )
    lost, used = series(of, "readout_loss", "lost"), series(of, "readout_loss", "capacity used")
    assert (
        lost["x"]
        == used["x"]
        == pytest.approx([0.1, 0.3, 0.5, 0.7, 0.8, 0.9, 0.95, 1, 1.1, 1.3, 2])
    )
    # what is not lost leaves the readout
    assert np.array(used["y"]) == pytest.approx((1 - np.array(lost["y"])) * lost["x"], rel=0.03)
    assert lost["y"] == sorted(lost["y"])
    assert lost["y"][-1] == pytest.approx(0.5, abs=0.1)


def test_a_readout_without_rows_delays_as_a_queue_with_one_server_does():
    of = found(
        (*PURE, "readout.arbiter={event_ns: 20000, row_ns: 0}", "sensor={width: 2, height: 200}")
    )
    assert numbers(of, "capacity of the readout")["2x200 pixels"]["value"] == pytest.approx(
        5e4, rel=0.02
    )
    delay = series(of, "readout_delay", "delay")
    # at a load of 0.1, nine in ten find it free, and then wait for their own service only
    assert delay["y"][0] == pytest.approx(20, abs=1)
    assert delay["low"][0] == pytest.approx(20, abs=1)
    lost = series(of, "readout_loss", "lost")["y"]
    assert lost[0] < 0.001
    assert lost[-1] > 0.3


def test_without_an_arbiter_no_limit_is_told():
    keys = {plot["key"] for plot in found(PURE)["plots"]}
    assert keys == {"s_curve_on", "s_curve_off", "latency", "noise", "bandwidth", "rate"}
    assert "There is no readout limit in this configuration." in found(PURE)["conditions"]


def test_the_same_for_any_number_of_threads_and_another_seed_is_another_chip():
    config = ["gen4", {"pixel": {"hot_pixels": {"fraction": 0.1, "rate_hz": 10}}}]
    one, two = sensor(config, threads=1), sensor(config, threads=3)
    assert json.dumps(one, allow_nan=False) == json.dumps(two, allow_nan=False)
    other = sensor(load_config(config, seed=1))["sensors"][0]
    values = [
        [number["value"] for number in of["numbers"] if number["name"].startswith("contrast")]
        for of in (one["sensors"][0], other)
    ]
    assert values[0] != values[1]
    assert values[0] == pytest.approx(values[1], rel=0.1)


def test_light_may_be_in_lux():
    plain, lux = found(low_pass(300, 20)), found(low_pass(300, 20), white_lux=500.0)
    assert series(lux, "latency", "ON")["x"] == pytest.approx(500.0 * LIGHT)
    assert series(lux, "latency", "ON")["y"] == series(plain, "latency", "ON")["y"]
    labels = [
        next(plot["x_label"] for plot in of["plots"] if plot["key"] == "latency")
        for of in (plain, lux)
    ]
    assert [label.rpartition("[")[2] for label in labels] == ["DN/255 of white]", "lux]"]
    assert list(numbers(lux, "bandwidth, -3 dB"))[1] == "10 % of white (50 lux)"


def test_what_is_done_in_steps_says_so():
    of = found(
        (
            *low_pass(300, 20),
            "pixel.low_pass.update=zero_order_hold",
            "sampling.L=4",
            "sampling.K=3",
        )
    )
    assert "960 times a second" in of["conditions"][-1]
    # the light is held over each of the steps, of which the last is whole
    assert numbers(of, "contrast threshold, ON")["100 % of white"]["value"] == pytest.approx(
        0.2, rel=0.01
    )
    assert max(series(of, "bandwidth", "100 % of white")["x"]) <= 960 / 8


@pytest.mark.parametrize(
    "sets",
    [
        ("thresholds.on=5", "thresholds.off=5"),
        ("thresholds.drift_per_s=0.01", "leak.jitter=0.1"),
        ("photoreceptor_noise.rms=0.05", "high_pass.cutoff_hz=1", "dark_current.dn=1"),
        ("slew_limit.per_s=100", "reset_overshoot.fraction=0.2"),
    ],
)
@pytest.mark.quick_cases(2)
def test_any_effect_may_be_on(sets):
    written = (*(f"pixel.{one}" for one in sets), "readout.loss.fraction=0.1")
    of = sensor(load_config(None, written))["sensors"][0]
    json.dumps(of, allow_nan=False)
    assert {plot["key"] for plot in of["plots"]} >= {"s_curve_on", "latency", "noise", "bandwidth"}


def test_several_sensors_keep_their_order_and_names():
    of = sensor("ideal", ["ideal", {"pixel": {"thresholds": {"on": 0.4}}}])["sensors"]
    assert [one["name"] for one in of] == ["ideal", "ideal, a dict"]
    firsts = [one["numbers"][0]["value"] for one in of]
    assert firsts == pytest.approx([0.2, 0.4], rel=1e-3)


def test_what_cannot_be_is_refused():
    with pytest.raises(ConfigError, match="davis34"):
        sensor("davis34")
    with pytest.raises(UsageError, match="contrast: must be a number above 0, got 0"):
        sensor("ideal", contrast=0)
    with pytest.raises(UsageError, match="white_lux"):
        sensor("ideal", white_lux=-1)
    with pytest.raises(TypeError, match="did you mean 'contrast'"):
        sensor("ideal", contrasts=1)
