"""Noise tables made by Monte Carlo of the circuit's events, with a known effect."""

from __future__ import annotations

import numpy as np
import pytest
from harness import at_rest, quiet

from adv2e.config.model import (
    LowPass,
    PhotoreceptorNoise,
    Refractory,
    SourceFollower,
    Thresholds,
)
from adv2e.diagnosis.tables.characterise import characterise, problem_of
from adv2e.diagnosis.tables.noise import NoisySources, noise_rates
from adv2e.diagnosis.tables.problem import Settings, read_declared
from adv2e.diagnosis.tables.selection import Selector
from adv2e.diagnosis.tables.table import parse_table
from adv2e.diagnosis.tables.threshold_noise import event_rates
from adv2e.errors import DataError

LUX = np.array([1.0, 30.0, 100.0, 300.0, 1000.0])
PIXELS, SECONDS = 2000, 50.0


def table(on, off, on_median=None, **columns):
    """Counts drawn about the rates."""
    rng = np.random.default_rng(5)

    def drawn(rate):
        return rng.poisson(np.asarray(rate) * PIXELS * SECONDS) / (PIXELS * SECONDS)

    cells = {"illuminance_lux": LUX, "on_rate_hz": drawn(on), "off_rate_hz": drawn(off)}
    if on_median is not None:
        cells["on_median_hz"] = drawn(on_median)
    cells["pixels"] = np.full(LUX.shape, PIXELS)
    cells["duration_s"] = np.full(LUX.shape, SECONDS)
    cells.update(columns)
    lines = [",".join(cells)]
    lines += [",".join(str(c) for c in row) for row in zip(*cells.values(), strict=True)]
    return parse_table("\n".join(lines), "noise.csv")


def verdict_of(measured, sets=()):
    return characterise(measured, read_declared([], sets), Settings(draws=40))


def walked_rates(on, off, dead_time, correlation_times=6000.0, step=0.004):
    """Rates of many pixels whose noise is stepped finely; the reference is the signal."""
    rng = np.random.default_rng(1)
    pixels = 300
    noise = rng.standard_normal(pixels)
    reference, until = noise.copy(), np.zeros(pixels)
    counts = np.zeros(2)
    decay = np.exp(-step)
    spread = np.sqrt(1.0 - decay**2)
    steps = int(correlation_times / step / pixels)
    dead = np.zeros(pixels, dtype=bool)
    for k in range(steps):
        noise = decay * noise + spread * rng.standard_normal(pixels)
        ended = dead & (k * step >= until)
        reference[ended] = noise[ended]
        dead &= ~ended
        rise, fall = ~dead & (noise - reference > on), ~dead & (reference - noise > off)
        counts += rise.sum(), fall.sum()
        fired = rise | fall
        dead |= fired
        until[fired] = k * step + dead_time
    return counts / (steps * step * pixels)


@pytest.mark.parametrize(("on", "off"), [(2.0, 2.0), (2.5, 1.8)])
def test_event_rates_of_band_limited_noise_are_those_of_a_fine_walk(on, off):
    dead, step = 0.8, 0.004
    shift = 0.5826 * np.sqrt(2 * step)
    ours = np.array(event_rates(on + shift, off + shift, dead))
    np.testing.assert_allclose(ours, walked_rates(on, off, dead, step=step), rtol=0.12)


def test_leak_becomes_rare_beside_noise():
    rng = np.random.default_rng(2)
    noise_hz, leak_hz = 3.0, 2.0
    waits = rng.exponential(1.0 / noise_hz, 200_000)
    leaks = np.floor(waits * leak_hz).sum()  # every 1/leak_hz until noise takes the reference anew
    rates = noise_rates(NoisySources(leak_hz=leak_hz, shot_hz=noise_hz), np.zeros(1))
    assert rates.leak_of[0, 0] == pytest.approx(leaks / waits.sum(), rel=0.02)


def test_nothing_missing_is_consistent():
    shot = 0.5 * (1.0 - 0.75 * LUX / 1000)
    found = verdict_of(table(shot, shot), ["pixel.shot_noise.rate_hz=1.0"])
    assert found.verdict == "consistent"
    assert found.effects == []


@pytest.mark.parametrize(
    ("name", "on", "off"),
    [
        ("leak", np.full(5, 0.4), np.zeros(5)),
        ("photo_leak", 0.5 * LUX / 1000, np.zeros(5)),
        ("shot_noise", 1.0 - 0.75 * LUX / 1000, 1.0 - 0.75 * LUX / 1000),
    ],
)
@pytest.mark.quick_cases(1)
def test_the_effect_is_named_with_its_rate(name, on, off):
    found = verdict_of(table(on, off, on_median=on))
    assert [effect.name for effect in found.effects] == [name]
    assert found.verdict == "explained"
    (value,) = found.effects[0].parameters.values()
    expected = {"leak": 0.4, "photo_leak": 0.5, "shot_noise": 2.0}[name]
    assert value == pytest.approx(expected, rel=0.1)


def test_a_mean_alone_does_not_tell_leak_from_hot_pixels():
    found = verdict_of(table(np.full(5, 0.4), np.zeros(5)))
    assert found.verdict == "not_identifiable"
    assert {*(e.name for e in found.effects), *found.alternatives} == {"leak", "hot_pixels"}


def test_a_median_tells_hot_pixels():
    found = verdict_of(table(np.full(5, 0.4), np.zeros(5), on_median=np.zeros(5)))
    assert [effect.name for effect in found.effects] == ["hot_pixels"]
    parameters = found.effects[0].parameters
    mean = parameters["pixel.hot_pixels.fraction"] * parameters["pixel.hot_pixels.rate_hz"]
    assert mean == pytest.approx(0.4, rel=0.1)
    assert found.model["pixel"]["hot_pixels"]["fraction"] == 0.01


def test_off_events_that_stay_in_bright_light_are_those_of_hot_pixels():
    """Drawn pixel by pixel: one in 50 fires 20 times a second, three in ten of those OFF."""
    rng = np.random.default_rng(8)
    hot, off = rng.random(PIXELS) < 0.02, rng.random(PIXELS) < 0.3
    counts = rng.poisson(20.0 * SECONDS * hot, (5, PIXELS))
    on_hz, off_hz = ((counts * (off == of)).mean(axis=1) / SECONDS for of in (False, True))
    median = np.zeros(5)
    found = verdict_of(table(on_hz, off_hz, on_median=median))
    assert [effect.name for effect in found.effects] == ["hot_pixels"]
    parameters = found.effects[0].parameters
    assert parameters["pixel.hot_pixels.off_fraction"] == pytest.approx(off[hot].mean(), rel=0.05)
    mean = parameters["pixel.hot_pixels.fraction"] * parameters["pixel.hot_pixels.rate_hz"]
    assert mean == pytest.approx(20.0 * hot.mean(), rel=0.05)


def test_dark_current_lifts_the_corner_of_the_noise():
    """Counts of simulated pixels: noise in the dark follows as much light as dark current is."""
    dark, sets = 8.0, {"dark_cutoff_hz": 0.1, "cutoff_hz": 600.0}
    pixel = quiet(
        photoreceptor_noise=PhotoreceptorNoise(rms=0.055),
        low_pass=LowPass(**sets),
        source_follower=SourceFollower(cutoff_hz=100.0),
        thresholds=Thresholds(on=0.2, off=0.23, mismatch=0.0),
        refractory=Refractory(period_us=500.0),
        initial_reference="running",
    )
    counts = []
    for lux in LUX:
        events, _ = at_rest(0.255 * lux + dark, pixel, SECONDS, pixels=PIXELS)
        on = np.count_nonzero(events["p"])
        counts.append((on, len(events) - on))
    on_hz, off_hz = np.transpose(counts) / (PIXELS * SECONDS)
    keys = [f"pixel.low_pass.{key}={value}" for key, value in sets.items()]
    keys += ["pixel.photoreceptor_noise.rms=0.055", "pixel.source_follower.cutoff_hz=100"]
    keys += ["pixel.thresholds.off=0.23", "pixel.refractory.period_us=500"]
    measured = table(on_hz, off_hz)
    found = verdict_of(measured, keys)
    assert [effect.name for effect in found.effects] == ["dark_current"]
    assert found.effects[0].parameters["pixel.dark_current.dn"] == pytest.approx(dark, rel=0.15)
    held = verdict_of(measured, [*keys, f"pixel.dark_current.dn={dark}"])
    assert held.errors[0].before.value < 0.3 * found.errors[0].before.value


@pytest.mark.thorough
def test_noise_that_falls_as_one_over_light_is_unexplained():
    found = verdict_of(table(5.0 / LUX, 5.0 / LUX, on_median=5.0 / LUX))
    assert found.verdict == "unexplained"
    assert found.effects == []


def test_what_fits_the_light_it_was_fitted_to_must_predict_what_was_held_out():
    """A leak fits three levels within their errors; the two held out have a hundred times more."""
    on = np.where(LUX < 100, 40.0, 0.4)
    part = np.where(LUX < 100, "dim", "bright")
    measured = table(on, np.zeros(5), on_median=on, part=part)
    problem = problem_of(measured, read_declared([], []), Settings(judge=["part=dim"]))
    problem.candidates = [one for one in problem.candidates if one.name == "leak"]
    found = Selector(problem, Settings(draws=40)).select()
    (leak,) = found.rejected
    assert leak.held_out < 1.0
    assert found.verdict == "unexplained"
    assert "leaves too much" in leak.reason


def test_effects_that_are_not_found_are_off_in_the_model():
    found = verdict_of(table(np.full(5, 0.4), np.zeros(5), on_median=np.full(5, 0.4)))
    assert found.model["pixel"]["shot_noise"]["rate_hz"] == 0.0
    assert found.model["pixel"]["leak"]["rate_hz"] == pytest.approx(0.4, rel=0.1)


def test_a_share_needs_the_length_of_the_recording():
    text = "illuminance_lux,on_rate_hz,on_share\n1,2,0.5\n2,2,0.5\n3,2,0.5\n"
    with pytest.raises(DataError, match="duration_s"):
        verdict_of(parse_table(text, "noise.csv"))


@pytest.mark.thorough
def test_a_share_counts_as_the_rate_that_gives_it():
    share = 1.0 - (1.0 - 0.6) * np.ones(5)
    measured = table(np.full(5, 0.012), np.zeros(5), on_share=share)
    found = verdict_of(measured)  # 0.012 Hz for 50 s: six pixels in ten
    assert found.effects[0].name == "leak"
    (value,) = found.effects[0].parameters.values()
    assert value == pytest.approx(0.012, rel=0.1)


@pytest.mark.parametrize("seconds", [0.5, 2.0, 20.0])
@pytest.mark.quick_cases(1)
def test_medians_of_few_events_are_those_of_whole_numbers(seconds):
    rng = np.random.default_rng(1)
    shot = 0.5 * (1.0 - 0.75 * LUX / 1000)
    counts = rng.poisson(shot * seconds, (2, 4000, 5))
    lines = ["illuminance_lux,on_rate_hz,off_rate_hz,on_median_hz,off_median_hz,pixels,duration_s"]
    for row in zip(LUX, *counts.mean(axis=1), *np.median(counts, axis=1), strict=True):
        lines.append(",".join(f"{v:.6g}" for v in (row[0], *np.array(row[1:]) / seconds)))
        lines[-1] += f",4000,{seconds}"
    text = "\n".join(lines)
    found = verdict_of(parse_table(text, "noise.csv"), ["pixel.shot_noise.rate_hz=1.0"])
    assert found.verdict == "consistent"
    named = verdict_of(parse_table(text, "noise.csv"))
    assert [effect.name for effect in named.effects] == ["shot_noise"]
    assert named.verdict == "explained"
    (value,) = named.effects[0].parameters.values()
    assert value == pytest.approx(1.0, rel=0.05)
